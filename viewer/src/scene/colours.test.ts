import { describe, expect, it } from "vitest";
import { agentColour, agentRgb, fromHex, heatRgb } from "./colours.ts";

describe("colours of agents", () => {
  const ids = Array.from({ length: 27 }, (_, id) => id);

  it("are CSS colours that parse back", () => {
    for (const id of ids) {
      expect(agentColour(id)).toMatch(/^#[0-9a-f]{6}$/);
      expect(agentRgb(id)).toEqual(fromHex(agentColour(id)));
    }
  });

  it("are distinct, and bright enough for a dark background", () => {
    for (const a of ids) {
      const [red, green, blue] = agentRgb(a);
      expect(0.2126 * red ** 2.2 + 0.7152 * green ** 2.2 + 0.0722 * blue ** 2.2).toBeGreaterThan(0.12);
      for (const b of ids.slice(0, a)) {
        const [x, y] = [agentRgb(a), agentRgb(b)];
        expect(Math.hypot(x[0] - y[0], x[1] - y[1], x[2] - y[2])).toBeGreaterThan(0.07);
      }
    }
  });
});

describe("colours of time", () => {
  it("increase in lightness and are clamped", () => {
    const lightness = Array.from({ length: 51 }, (_, step) => {
      const [red, green, blue] = heatRgb(step / 50);
      return 0.2126 * red ** 2.2 + 0.7152 * green ** 2.2 + 0.0722 * blue ** 2.2;
    });
    for (let step = 1; step < lightness.length; step++)
      expect(lightness[step]).toBeGreaterThan(lightness[step - 1]!);
    expect(heatRgb(-1)).toEqual(heatRgb(0));
    expect(heatRgb(2)).toEqual(heatRgb(1));
  });
});
