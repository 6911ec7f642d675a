import { expect, test } from "vitest";
import type { Vec3 } from "./run.ts";
import { Way } from "./way.ts";

/** Progress on a way through places, one after the other. */
function follow(way: Way, start: Vec3, places: readonly Vec3[]): number[] {
  let [progressM, before] = [0, start];
  return places.map((place) => {
    progressM = way.advanced(progressM, Math.hypot(...place.map((at, axis) => at - before[axis]!)), place);
    before = place;
    return progressM;
  });
}

test("way-points are left out once they were passed", () => {
  const way = new Way([0, 0, 0], [2, 0, 0, 2, 3, 0]);
  const progress = follow(
    way,
    [0, 0, 0],
    [
      [1, 0, 0],
      [1.9, 0.05, 0],
      [2, 0.5, 0],
      [2, 2, 0],
      [2, 3, 0],
    ],
  );
  expect(progress[0]).toBeCloseTo(1);
  expect(progress.map((m) => way.left(m).length)).toEqual([2, 2, 1, 1, 0]);
  expect(way.left(0)).toEqual([
    [2, 0, 0],
    [2, 3, 0],
  ]);
});

test("a way that comes back to itself is not cut short", () => {
  const way = new Way([0, 0, 0], [4, 0, 0, 4, 1, 0, 0, 1, 0, 0, 0, 0, 4, 0, 0]);
  expect(
    follow(
      way,
      [0, 0, 0],
      [
        [1, 0, 0],
        [2, 0, 0],
      ],
    ),
  ).toEqual([1, 2]);
  const back = follow(
    way,
    [0, 0, 0],
    [
      [2, 0, 0],
      [4, 0, 0],
      [4, 1, 0],
      [2, 1, 0],
      [0, 1, 0],
      [0, 0, 0],
      [1, 0, 0],
    ],
  );
  expect(back.map((m) => Math.round(m * 100) / 100)).toEqual([2, 4, 5, 7, 9, 10, 11]);
});

test("a body that stands still or goes astray does not go on", () => {
  const way = new Way([0, 0, 0], [9, 0, 0]);
  expect(
    follow(
      way,
      [0, 0, 0],
      [
        [3, 0, 0],
        [3, 0, 0],
        [2, 0, 0],
        [3, 4, 0],
      ],
    ),
  ).toEqual([3, 3, 3, 3]);
  expect(new Way([1, 1, 1], []).left(0)).toEqual([]);
  expect(new Way([1, 1, 1], [1, 1, 1]).left(0)).toEqual([]);
});
