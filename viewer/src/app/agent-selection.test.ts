import { describe, expect, it } from "vitest";
import { AgentNumberInput, nextSelection } from "./agent-selection.ts";

describe("agents", () => {
  it("cycle through the cave between the last and the first", () => {
    const seen: (number | null)[] = [];
    for (let place: number | null = null, turn = 0; turn < 4; turn++)
      seen.push((place = nextSelection(place, 1, 3)));
    expect(seen).toEqual([0, 1, 2, null]);
    expect(nextSelection(null, -1, 3)).toBe(2);
    expect(nextSelection(0, -1, 3)).toBeNull();
  });

  it("are selected by a digit, or two in quick succession", () => {
    const digits = new AgentNumberInput();
    expect(digits.typed(1, 0, 20)).toBe(1);
    expect(digits.typed(2, 500, 20)).toBe(12);
    expect(digits.typed(3, 600, 20)).toBe(3);
    expect(digits.typed(1, 5000, 20)).toBe(1);
    expect(digits.typed(2, 5700, 20)).toBe(2);
    expect(digits.typed(5, 5800, 20)).toBe(5);
    expect(digits.typed(0, 9000, 20)).toBe(0);
    expect(digits.typed(4, 9100, 20)).toBe(4);
  });

  it("that do not exist are not selected", () => {
    const digits = new AgentNumberInput();
    expect(digits.typed(7, 0, 5)).toBeNull();
    expect(digits.typed(2, 100, 5)).toBe(2);
  });
});
