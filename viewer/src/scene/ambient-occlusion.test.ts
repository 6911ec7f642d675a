import { describe, expect, it } from "vitest";
import type { Size } from "./chunks.ts";
import { computeOcclusion } from "./ambient-occlusion.ts";

const SIZE: Size = [20, 20, 20];

/** Solid rock with a free room from 4 to 15 along each axis. */
function room(): Uint8Array {
  const walls = new Uint8Array(20 ** 3).fill(1);
  for (let z = 4; z < 16; z++)
    for (let y = 4; y < 16; y++) walls.fill(0, (z * 20 + y) * 20 + 4, (z * 20 + y) * 20 + 16);
  return walls;
}

describe.each([8000, 1000])("ambient occlusion on a grid of at most %i blocks", (blocks) => {
  const occlusion = computeOcclusion(room(), SIZE, { blocksMax: blocks, edgeMax: 64 });
  const at = (x: number, y: number, z: number): { out: number[]; open: number } => {
    const { counts, step, data } = occlusion;
    const [i, j, k] = [x, y, z].map((cells) => Math.round(cells / step)) as [number, number, number];
    const from = ((k * counts[1] + j) * counts[0] + i) * 4;
    const each = data.subarray(from, from + 4);
    return { out: [0, 1, 2].map((axis) => (each[axis]! - 127.5) / 127.5), open: each[3]! / 255 };
  };

  it("respects the limit of blocks", () => {
    const [x, y, z] = occlusion.counts;
    expect((x - 1) * (y - 1) * (z - 1)).toBeLessThanOrEqual(blocks);
  });

  it("points away from the rock", () => {
    expect(at(4, 10, 10).out[0]).toBeGreaterThan(0.9);
    expect(at(10, 16, 10).out[1]).toBeLessThan(-0.9);
    const corner = at(4, 4, 4).out;
    for (const part of corner) expect(part).toBeCloseTo(1 / Math.sqrt(3), 1);
  });

  it("is most open in the middle of the room, least in its corners", () => {
    const [middle, wall, corner, rock] = [at(10, 10, 10), at(4, 10, 10), at(4, 4, 4), at(0, 0, 0)].map(
      (light) => light.open,
    );
    expect(middle).toBeGreaterThan(wall!);
    expect(wall).toBeGreaterThan(corner!);
    expect(corner).toBeGreaterThan(rock!);
  });
});

it("has a grid that fits a texture", () => {
  const { counts, step } = computeOcclusion(room(), SIZE, { blocksMax: 8000, edgeMax: 20 });
  expect(step).toBe(2);
  expect(counts).toEqual([11, 11, 11]);
});
