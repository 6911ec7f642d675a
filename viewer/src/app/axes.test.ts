import { describe, expect, it } from "vitest";
import type { Vec3 } from "../data/run.ts";
import { axisLabels } from "./axes.ts";

/** From above and in front: x to the right, y to the back, z upwards. */
const project = ([x, y, z]: Vec3): [number, number] => [10 * x + 3 * y, 500 - 10 * z - 4 * y];
const labels = axisLabels({ low: [1, 2, 0], high: [21, 12, 10] }, project);

describe("labels of a map", () => {
  it("are at whole steps within the box, in metres", () => {
    const ticks = labels.filter(({ tick }) => tick !== null).map(({ text }) => text);
    expect(ticks).toEqual([
      "2",
      "4",
      "6",
      "8",
      "10",
      "12",
      "14",
      "16",
      "18",
      "20",
      "2",
      "4",
      "6",
      "8",
      "10",
      "12",
      "0",
      "2",
      "4",
      "6",
      "8",
      "10",
    ]);
  });

  it("name the axes", () => {
    expect(labels.filter(({ tick }) => tick === null).map(({ text }) => text)).toEqual([
      "x, m",
      "y, m",
      "z, m",
    ]);
  });

  it("lie outside, below the floor and at the left", () => {
    const [first] = labels;
    expect(first!.tick!.from).toEqual(project([2, 2, 0]));
    expect(first!.at[1]).toBeGreaterThan(first!.tick!.from[1]);
    const z = labels.at(-1)!;
    expect(z.at[0]).toBeLessThan(project([1, 2, 5])[0]);
  });
});
