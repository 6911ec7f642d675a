import { describe, expect, it } from "vitest";
import { load, merged, save } from "./storage.ts";

const DEFAULTS = { rate: 10, isOpen: true, layers: { walls: true, heat: false }, size: [50, 50, 50] };

describe("stored settings", () => {
  it("are used where they fit", () => {
    const stored = { rate: 2, layers: { heat: true }, size: [30, 40, 50] };
    expect(merged(DEFAULTS, stored)).toEqual({
      ...DEFAULTS,
      rate: 2,
      layers: { walls: true, heat: true },
      size: [30, 40, 50],
    });
  });

  it.each([
    null,
    7,
    "x",
    [],
    { rate: "2", isOpen: 1, layers: null, size: [1], gone: 3 },
    { size: ["a", 1, 2] },
  ])("are ignored where they do not fit: %j", (stored) => expect(merged(DEFAULTS, stored)).toEqual(DEFAULTS));

  it("are the defaults without storage", () => {
    save("look", DEFAULTS);
    expect(load("look", DEFAULTS)).toBe(DEFAULTS);
  });
});
