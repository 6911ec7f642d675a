import { describe, expect, it } from "vitest";
import { pack } from "./faces.ts";
import { CORNERS, Mesher, NUMBERS_PER_CORNER } from "./mesher.ts";
import { randomNumbers } from "./testing.ts";

/** The largest chunk and the longest rectangle in use. */
const EDGE = 32;
const LONGEST = 6;

describe("packed corners", () => {
  it("have all that the mesher says, and the lengths of the rectangle", () => {
    const next = randomNumbers(9);
    const padded = Uint8Array.from({ length: (EDGE + 2) ** 3 }, () => (next() < 0.9 ? 1 : 0));
    // A whole layer, so that rectangles of the greatest length end at the edge of the chunk.
    padded.fill(1, (EDGE + 2) ** 2 * EDGE, (EDGE + 2) ** 2 * (EDGE + 1));
    padded.fill(0, (EDGE + 2) ** 2 * (EDGE + 1));
    const origin = [64, 0, 992] as const;
    const { corners } = new Mesher(LONGEST).surface({ edge: EDGE, origin: [...origin], padded }, false);
    const words = new Uint32Array(corners.length / NUMBERS_PER_CORNER);
    pack(corners, origin, words);
    const seen = { place: 0, length: 0 };
    for (let at = 0; at < words.length; at++) {
      const word = words[at]!;
      const bits = (from: number, count: number) => (word >>> from) & (2 ** count - 1);
      const local = [bits(0, 6), bits(6, 6), bits(12, 6)];
      const facing = bits(18, 3);
      const expected = [...corners.subarray(at * 4, at * 4 + 4)];
      const quad = corners.subarray((at - (at % CORNERS)) * 4, (at - (at % CORNERS)) * 4 + 16);
      const lengths = [0, 1, 2]
        .filter((axis) => axis !== facing >> 1)
        .map((axis) => Math.abs(quad[axis]! - quad[8 + axis]!));
      const found = [...local.map((part, axis) => part + origin[axis]!), facing, bits(21, 3), bits(24, 3)];
      if (found.join() !== [...expected, ...lengths].join()) expect(found).toEqual([...expected, ...lengths]);
      seen.place = Math.max(seen.place, ...local);
      seen.length = Math.max(seen.length, ...lengths);
    }
    expect(seen).toEqual({ place: EDGE, length: LONGEST });
  });
});
