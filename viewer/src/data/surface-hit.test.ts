import { expect, test } from "vitest";
import { CellSet } from "./cell-set.ts";
import type { Terrain, Vec3 } from "./run.ts";
import { surfaceHit } from "./surface-hit.ts";

const ALL = { axis: "z", share: 1 } as const;

/** A room of 8 x 5 x 5 free cells of half a metre, with a wall across it at x = 5 up to z = 3. */
function room(): Terrain {
  const size: Vec3 = [10, 7, 7];
  const walls = new Uint8Array(10 * 7 * 7).fill(1);
  for (let z = 1; z < 6; z++) {
    for (let y = 1; y < 6; y++) {
      walls.fill(0, (z * 7 + y) * 10 + 1, (z * 7 + y) * 10 + 9);
      if (z < 4) walls[(z * 7 + y) * 10 + 5] = 1;
    }
  }
  return { size, cellM: 0.5, walls: CellSet.of(walls), freeCells: 185 };
}

test("walls towards the camera are seen through", () => {
  const hit = surfaceHit(room(), ALL, [-3, 1.75, 0.75], [1, 0, 0]);
  expect(hit).toEqual({ point: [2.5, 1.75, 0.75], free: [2.25, 1.75, 0.75] });
  const above = surfaceHit(room(), ALL, [-3, 1.75, 2.25], [2, 0, 0]);
  expect(above).toEqual({ point: [4.5, 1.75, 2.25], free: [4.25, 1.75, 2.25] });
});

test("a line from inside meets the wall ahead", () => {
  const hit = surfaceHit(room(), ALL, [4, 1.75, 0.75], [-1, 0, 0]);
  expect(hit).toEqual({ point: [3, 1.75, 0.75], free: [3.25, 1.75, 0.75] });
});

test("a slanted line ends on the floor", () => {
  const hit = surfaceHit(room(), ALL, [1.3, 1.1, 9], [0.1, 0.05, -1])!;
  expect(hit.point[2]).toBeCloseTo(0.5, 12);
  expect(hit.point[0]).toBeCloseTo(1.3 + 0.85, 12);
  expect(hit.free[2]).toBe(0.75);
});

test("what is cut away is not met", () => {
  // The ceiling is cut away: from below, nothing is above.
  expect(surfaceHit(room(), { axis: "z", share: 0.5 }, [1, 1.75, 1], [0, 0, 1])).toBeNull();
  // The half with the far wall is cut away.
  expect(surfaceHit(room(), { axis: "x", share: 0.5 }, [-3, 1.75, 2.25], [1, 0, 0])).toBeNull();
  const near = surfaceHit(room(), { axis: "x", share: 0.6 }, [9, 1.75, 2.25], [-1, 0, 0]);
  expect(near?.point).toEqual([0.5, 1.75, 2.25]);
});

test("a line beside the map or through rock alone meets nothing", () => {
  expect(surfaceHit(room(), ALL, [-3, 9, 1], [1, 0, 0])).toBeNull();
  expect(surfaceHit(room(), ALL, [-3, 0.25, 1], [1, 0, 0])).toBeNull();
  expect(surfaceHit(room(), ALL, [-3, 1.75, 1], [-1, 0, 0])).toBeNull();
});
