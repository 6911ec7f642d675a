import { describe, expect, it } from "vitest";
import { CORNERS, DIRECTIONS, FACING_ORDER, Mesher, NUMBERS_PER_CORNER, type Surface } from "./mesher.ts";
import { randomNumbers } from "./testing.ts";

const EDGE = 9;
const ROW = EDGE + 2;

function randomBlock(seed: number, share: number): Uint8Array {
  const next = randomNumbers(seed);
  return Uint8Array.from({ length: ROW ** 3 }, () => (next() < share ? 1 : 0));
}

/** Each unit face of a surface as text: its cell, relative to the origin, and its direction. */
function unitFaces(surface: Surface, origin: readonly number[], inward: boolean): string[] {
  const faces: string[] = [];
  const { corners } = surface;
  for (let at = 0; at < corners.length; at += CORNERS * NUMBERS_PER_CORNER) {
    const places = [0, 1, 2, 3].map((corner) => [...corners.subarray(at + corner * 4, at + corner * 4 + 3)]);
    const facing = corners[at + 3]!;
    const low = [0, 1, 2].map((axis) => Math.min(...places.map((place) => place[axis]!)));
    const high = [0, 1, 2].map((axis) => Math.max(...places.map((place) => place[axis]!)));
    const axis = facing >> 1;
    expect(low[axis]).toBe(high[axis]);
    const [u, v] = [0, 1, 2].filter((other) => other !== axis) as [number, number];
    const outward = inward ? facing ^ 1 : facing;
    for (let j = low[v]!; j < high[v]!; j++) {
      for (let i = low[u]!; i < high[u]!; i++) {
        const cell = [0, 0, 0];
        cell[axis] = low[axis]! - (outward & 1 ? 0 : 1);
        cell[u] = i;
        cell[v] = j;
        faces.push([...cell.map((value, k) => value - origin[k]!), facing].join());
      }
    }
  }
  return faces;
}

function naiveFaces(padded: Uint8Array, inward: boolean): string[] {
  const faces: string[] = [];
  const at = (x: number, y: number, z: number): number => padded[((z + 1) * ROW + y + 1) * ROW + x + 1]!;
  for (let z = 0; z < EDGE; z++) {
    for (let y = 0; y < EDGE; y++) {
      for (let x = 0; x < EDGE; x++) {
        for (const [direction, [dx, dy, dz]] of DIRECTIONS.entries()) {
          if (at(x, y, z) === 1 && at(x + dx, y + dy, z + dz) === 0)
            faces.push([x, y, z, inward ? direction ^ 1 : direction].join());
        }
      }
    }
  }
  return faces;
}

describe("the surface of a set of cells", () => {
  const origin = [16, 32, 7] as const;

  it.each([
    [1, 0.5, 32, false],
    [2, 0.1, 32, true],
    [3, 0.9, 4, false],
    [4, 0.97, 4, true],
    [5, 1, 3, false],
    [6, 0, 32, false],
  ])("has every face once (seed %i, share %f, longest %i, inward %s)", (seed, share, longest, inward) => {
    const padded = randomBlock(seed, share);
    const surface = new Mesher(longest).surface({ edge: EDGE, origin, padded }, inward);
    expect(unitFaces(surface, origin, inward).sort()).toEqual(naiveFaces(padded, inward).sort());
  });

  it("merges a flat wall into one rectangle, or pieces of limited length", () => {
    const padded = new Uint8Array(ROW ** 3);
    for (let z = 0; z < 3; z++) padded.fill(1, z * ROW * ROW, (z + 1) * ROW * ROW);
    const block = { edge: EDGE, origin, padded };
    expect(new Mesher(32).surface(block, false).corners.length).toBe(CORNERS * NUMBERS_PER_CORNER);
    expect(new Mesher(3).surface(block, false).corners.length).toBe(9 * CORNERS * NUMBERS_PER_CORNER);
  });

  it("winds counterclockwise seen from the front", () => {
    const padded = randomBlock(7, 0.4);
    for (const inward of [false, true]) {
      const { corners } = new Mesher(32).surface({ edge: EDGE, origin, padded }, inward);
      for (let at = 0; at < corners.length; at += CORNERS * NUMBERS_PER_CORNER) {
        const [a, b, c] = [0, 1, 2].map((corner) => [
          ...corners.subarray(at + corner * 4, at + corner * 4 + 3),
        ]) as [number[], number[], number[]];
        const first = b.map((value, axis) => value - a[axis]!);
        const second = c.map((value, axis) => value - b[axis]!);
        const cross = [0, 1, 2].map(
          (k) => first[(k + 1) % 3]! * second[(k + 2) % 3]! - first[(k + 2) % 3]! * second[(k + 1) % 3]!,
        );
        const normal = DIRECTIONS[corners[at + 3]!]!;
        expect(cross.map((value) => Math.sign(value) + 0)).toEqual([...normal]);
      }
    }
  });

  it("counts its rectangles by direction", () => {
    const { corners, ends } = new Mesher(32).surface(
      { edge: EDGE, origin, padded: randomBlock(8, 0.5) },
      false,
    );
    const facings = Array.from({ length: corners.length / 16 }, (_, quad) => corners[quad * 16 + 3]!);
    const expected = FACING_ORDER.map((facing) => facings.lastIndexOf(facing) + 1);
    expect(ends).toEqual(expected);
    expect(facings).toEqual([...facings].sort((a, b) => FACING_ORDER.indexOf(a) - FACING_ORDER.indexOf(b)));
  });
});
