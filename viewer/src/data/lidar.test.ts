import { CellSet } from "./cell-set.ts";
import { describe, expect, test } from "vitest";
import { cast, firstWall, lattice, shell } from "./lidar.ts";
import type { Terrain, Vec3 } from "./run.ts";

/** A room of 8 x 5 x 5 free cells of half a metre. */
function room(): Terrain {
  const size: Vec3 = [10, 7, 7];
  const walls = new Uint8Array(10 * 7 * 7).fill(1);
  for (let z = 1; z < 6; z++) {
    for (let y = 1; y < 6; y++) {
      walls.fill(0, (z * 7 + y) * 10 + 1, (z * 7 + y) * 10 + 9);
    }
  }
  return { size, cellM: 0.5, walls: CellSet.of(walls), freeCells: 200 };
}

const POSITION: Vec3 = [1.15, 1.7, 1.8];

function hitsOf(positions: Float32Array): Vec3[] {
  return Array.from({ length: positions.length / 3 }, (_, hit) => [
    positions[3 * hit]!,
    positions[3 * hit + 1]!,
    positions[3 * hit + 2]!,
  ]);
}

test("lattice directions are even unit vectors", () => {
  const { directions } = lattice(500, 1, 2 * Math.PI, 1);
  let sum = [0, 0, 0];
  for (let at = 0; at < directions.length; at += 3) {
    const ray = [...directions.subarray(at, at + 3)];
    expect(Math.hypot(...ray)).toBeCloseTo(1, 12);
    sum = sum.map((total, axis) => total + ray[axis]!);
  }
  expect(Math.hypot(...sum)).toBeLessThan(1);
  expect(directions[0]).toBeCloseTo(1 - 1 / 500, 12);
});

test("a shell has as many rays as in the simulator", () => {
  expect([5, 6].map((radius) => shell(radius, 7).directions.length / 3)).toEqual([222, 354]);
});

test("all rays of a scan inside a room hit its walls", () => {
  const hits = hitsOf(cast(lattice(300, Infinity, 2 * Math.PI, 0.5), room(), POSITION, 0));
  expect(hits).toHaveLength(300);
  for (const [x, y, z] of hits) {
    const apart = [x - 0.5, 4.5 - x, y - 0.5, 3 - y, z - 0.5, 3 - z];
    expect(Math.min(...apart.map(Math.abs))).toBeLessThan(1e-6);
    expect(Math.min(...apart)).toBeGreaterThan(-1e-6);
  }
});

describe("limits of a scan", () => {
  test("range", () => {
    const hits = hitsOf(cast(lattice(300, 1.4, 2 * Math.PI, 0.5), room(), POSITION, 0));
    const apart = hits.map((hit) => Math.hypot(...hit.map((at, axis) => at - POSITION[axis]!)));
    expect(hits.length).toBeGreaterThan(100);
    expect(hits.length).toBeLessThan(300);
    expect(Math.max(...apart)).toBeLessThan(1.4 + 1e-6);
  });

  test("field of view", () => {
    const yawRad = 2;
    const hits = hitsOf(cast(lattice(300, Infinity, Math.PI / 2, 0.5), room(), POSITION, yawRad));
    // A 90 degree cone covers (1 - cos 45 degrees) / 2 of the sphere.
    expect(hits.length).toBeGreaterThan(38);
    expect(hits.length).toBeLessThan(50);
    for (const [x, y, z] of hits) {
      const offset: Vec3 = [x - POSITION[0], y - POSITION[1], z - POSITION[2]];
      const ahead = (Math.cos(yawRad) * offset[0] + Math.sin(yawRad) * offset[1]) / Math.hypot(...offset);
      expect(ahead).toBeGreaterThan(Math.SQRT1_2 - 1e-6);
    }
  });

  test("shell", () => {
    const hits = hitsOf(cast(shell(3, 2 * Math.PI), room(), POSITION, 0));
    const apart = hits.map((hit) => Math.hypot(...hit.map((at, axis) => at - POSITION[axis]!)));
    expect(hits.length).toBeGreaterThan(0);
    expect(Math.max(...apart)).toBeLessThan(3 * 0.5 + 1e-6);
  });
});

test("the lower axis steps first where two boundaries are reached at once", () => {
  const terrain = { size: [2, 2, 2] as Vec3, cellM: 1 };
  const walls = CellSet.of([0, 0, 1, 0, 0, 0, 0, 0]);
  // From the centre of the lowest cell through its uppermost corner: first (1, 0, 0), then (1, 1,
  // 0).
  expect(firstWall({ ...terrain, walls }, [0.5, 0.5, 0.5], [1, 1, 1], Infinity)).toBeNull();
  walls.add(1);
  expect(firstWall({ ...terrain, walls }, [0.5, 0.5, 0.5], [1, 1, 1], Infinity)).toBe(0.5);
});

test("invalid positions and directions have no hit", () => {
  const terrain = room();
  expect(firstWall(terrain, [-1, 1, 1], [1, 0, 0], Infinity)).toBeNull();
  expect(firstWall(terrain, POSITION, [0, 0, 0], Infinity)).toBeNull();
  expect(firstWall(terrain, [NaN, 1, 1], [1, 0, 0], Infinity)).toBeNull();
  expect(firstWall(terrain, POSITION, [NaN, 0, 0], Infinity)).toBeNull();
});
