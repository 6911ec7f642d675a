import { describe, expect, it } from "vitest";
import { nearestStep, PLAY_RATES, RUN_RATES, shifted } from "./rates.ts";

describe("rates", () => {
  it("the nearest step is found by ratio", () => {
    expect(RUN_RATES[nearestStep(RUN_RATES, 3)]).toBe(2);
    expect(RUN_RATES[nearestStep(RUN_RATES, 4)]).toBe(5);
    expect(RUN_RATES[nearestStep(RUN_RATES, 0)]).toBe(0);
    expect(RUN_RATES[nearestStep(RUN_RATES, 1e6)]).toBe(100);
  });

  it("steps are clamped", () => {
    expect(shifted(PLAY_RATES, 1, 1)).toBe(2);
    expect(shifted(PLAY_RATES, 0.1, -1)).toBe(0.1);
    expect(shifted(PLAY_RATES, 100, 5)).toBe(100);
  });
});
