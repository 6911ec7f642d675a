import { expect, test } from "vitest";
import type { Vec3 } from "./run.ts";
import { Path } from "./path.ts";

/** Progress on a path at successive positions. */
function follow(path: Path, start: Vec3, positions: readonly Vec3[]): number[] {
  let [progressM, before] = [0, start];
  return positions.map((position) => {
    progressM = path.advanced(
      progressM,
      Math.hypot(...position.map((at, axis) => at - before[axis]!)),
      position,
    );
    before = position;
    return progressM;
  });
}

test("passed waypoints are omitted", () => {
  const path = new Path([0, 0, 0], [2, 0, 0, 2, 3, 0]);
  const progress = follow(
    path,
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
  expect(progress.map((m) => path.remaining(m).length)).toEqual([2, 2, 1, 1, 0]);
  expect(path.remaining(0)).toEqual([
    [2, 0, 0],
    [2, 3, 0],
  ]);
});

test("a self-intersecting path is not cut short", () => {
  const path = new Path([0, 0, 0], [4, 0, 0, 4, 1, 0, 0, 1, 0, 0, 0, 0, 4, 0, 0]);
  expect(
    follow(
      path,
      [0, 0, 0],
      [
        [1, 0, 0],
        [2, 0, 0],
      ],
    ),
  ).toEqual([1, 2]);
  const back = follow(
    path,
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

test("a body that rests or strays makes no progress", () => {
  const path = new Path([0, 0, 0], [9, 0, 0]);
  expect(
    follow(
      path,
      [0, 0, 0],
      [
        [3, 0, 0],
        [3, 0, 0],
        [2, 0, 0],
        [3, 4, 0],
      ],
    ),
  ).toEqual([3, 3, 3, 3]);
  expect(new Path([1, 1, 1], []).remaining(0)).toEqual([]);
  expect(new Path([1, 1, 1], [1, 1, 1]).remaining(0)).toEqual([]);
});
