import { expect, test } from "vitest";
import { scaleLengthM } from "./legend.ts";

test("the scale has round lengths", () => {
  const lengths = [0.3, 1, 1.9, 2, 4.9, 7, 10, 12, 49, 50, 999].map(scaleLengthM);
  expect(lengths).toEqual([0.2, 1, 1, 2, 2, 5, 10, 10, 20, 50, 500]);
  for (const wrong of [0, -1, NaN, Infinity]) expect(scaleLengthM(wrong)).toBe(1);
});
