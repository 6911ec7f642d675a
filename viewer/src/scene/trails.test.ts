import { describe, expect, it } from "vitest";
import { randomNumbers } from "./testing.ts";
import { TrackSimplifier } from "./trails.ts";

/** A track with legs at different speeds, and pauses. */
function track(seed: number): number[][] {
  const next = randomNumbers(seed);
  const points: number[][] = [];
  let place = [0, 0, 0];
  let timeS = 0;
  for (let leg = 0; leg < 12; leg++) {
    const speed = [next() - 0.5, next() - 0.5, next() - 0.5].map((part) => (leg % 4 === 3 ? 0 : part * 3));
    const steps = 5 + Math.floor(next() * 90);
    for (let step = 0; step < steps; step++) {
      points.push([timeS, ...place]);
      timeS += 0.2;
      place = place.map((value, axis) => value + speed[axis]! * 0.2);
    }
  }
  return points;
}

describe("track simplification", () => {
  it.each([1, 2, 3])("keeps few points, all omitted ones within the tolerance (seed %i)", (seed) => {
    const points = track(seed);
    const kept: (readonly number[])[] = [];
    const simplifier = new TrackSimplifier();
    for (const point of points) simplifier.push(point, (one) => kept.push(one));
    expect(kept[0]).toBe(points[0]);
    expect(kept.length).toBeLessThan(points.length / 8);
    for (const [index, to] of kept.slice(1).entries()) {
      const from = kept[index]!;
      for (const point of points.filter(([timeS]) => timeS! > from[0]! && timeS! < to[0]!)) {
        const share = (point[0]! - from[0]!) / (to[0]! - from[0]!);
        const off = [1, 2, 3].map((axis) => from[axis]! + (to[axis]! - from[axis]!) * share - point[axis]!);
        expect(Math.hypot(...off)).toBeLessThanOrEqual(0.1);
      }
    }
  });
});
