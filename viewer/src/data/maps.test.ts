import { describe, expect, test } from "vitest";
import { readMap } from "./maps.ts";
import { UnreadableError } from "./run.ts";

const bytesOf = (hex: string) => Uint8Array.from(hex.match(/../g) ?? [], (byte) => parseInt(byte, 16));

/** The room of `docs/maps.md`, and the same as `maes map convert` writes it. */
const ROOM_TEXT = `#####
#####
#####
#####

#####
#...#
#...#
#####

#####
#####
#####
#####
`;
const ROOM_PLAIN = "0a0c240ffff9ff9ff9ffff";
const ROOM_PACKED =
  "004d33444d524c4501050000050000000400000003000000000000000000f03f010000000300000001000000010000005f725fdae8d0";

/**
 * A cave of `maes map generate --size 11x9x8 --kind noise --fill 0.45 --smoothing 1 --seed 3
 * --cell-m 0.5`, in both formats.
 */
const CAVE_PACKED =
  "004d33444d524c45010402000b0000000900000008000000000000000000e03f0c000000140000000a0000000b00000040fd78491226ced1d3279024c3bbbb67214c2484c567c52188";
const CAVE_PLAIN =
  "162048ffffffffffffffffffffffffffffffffffffffffffffbc5e2ffffffffffe7f3f1e6ffffffffffc7f3d9eeffffffffffc7f3ddeeffffffffff0783c1c6ffffffffff0783c1e1fffffffe7f0f03c1c1fffffffffffffffffffffffffffffffffffffffff";

test("all three formats of a room are equal", () => {
  const text = readMap("map.txt", new TextEncoder().encode(ROOM_TEXT));
  expect(text.size).toEqual([5, 4, 3]);
  const free = Array.from({ length: 60 }, (_, cell) => cell).filter((cell) => !text.walls.has(cell));
  expect(free).toEqual([26, 27, 28, 31, 32, 33]);
  expect(readMap("map.m3dm", bytesOf(ROOM_PLAIN))).toEqual(text);
  expect(readMap("map.m3dm", bytesOf(ROOM_PACKED))).toEqual({ ...text, cellM: 1 });
});

test("rows of text go from the highest y downwards", () => {
  const { walls } = readMap("map.txt", new TextEncoder().encode("#.\r\n..\r\n\r\n..\r\n.#\r\n"));
  expect(Array.from(walls.toBytes())).toEqual([0, 0, 1, 0, 0, 1, 0, 0]);
});

test("both formats of a cave are equal", () => {
  const packed = readMap("map.m3dm", bytesOf(CAVE_PACKED));
  expect(packed.size).toEqual([11, 9, 8]);
  expect(packed.cellM).toBe(0.5);
  expect(packed.walls.length - packed.walls.count).toBe(98);
  expect(readMap("map.m3dm", bytesOf(CAVE_PLAIN)).walls).toEqual(packed.walls);
});

test("a plain map goes with x slowest and y fastest", () => {
  // 2 x 3 x 1 cells, walls at (0, 0), (0, 2) and (1, 1), with two bits of padding.
  const { size, walls } = readMap(
    "map.m3dm",
    Uint8Array.of(0b0000_0100, 0b0000_0100, 0b0001_1010, 0b0010_1010),
  );
  expect(size).toEqual([2, 3, 1]);
  expect(Array.from(walls.toBytes())).toEqual([1, 0, 0, 1, 1, 0]);
  // 2 x 2 x 2 cells: y = 1 is the second bit, z = 1 the third and x = 1 the fifth.
  const cube = (bits: number) =>
    readMap("map.m3dm", Uint8Array.of(0b0000_0100, 0b0000_1000, 0b0001_0000, bits)).walls;
  expect([0b0100_0000, 0b0010_0000, 0b0000_1000].map((bits) => cube(bits).toBytes().indexOf(1))).toEqual([
    2, 4, 1,
  ]);
});

test("a solid cube of the documented header", () => {
  const bytes = new Uint8Array(15_628).fill(0xff);
  bytes.set([0x64, 0xc9, 0x90]);
  const { size, walls } = readMap("map.m3dm", bytes);
  expect(size).toEqual([50, 50, 50]);
  expect(walls.count).toBe(125_000);
});

describe("malformed maps are rejected", () => {
  test.each([
    ["a packed map cut off", ROOM_PACKED.slice(0, -2), "the packed map has 53 bytes, expected 54"],
    ["half a header", ROOM_PACKED.slice(0, 60), "ends within its header of 52 bytes"],
    ["another version", ROOM_PACKED.replace("4c4501", "4c4502"), "version 2 of the packed map"],
    ["a changed byte", ROOM_PACKED.replace(/d0$/, "d1"), "the checksum of the map does not match"],
    ["two bytes", "0a0c", "ends within its header of 3 bytes"],
    ["a byte too many", `${ROOM_PLAIN}00`, "has 11 bytes, not 12"],
    ["padding that is set", ROOM_PLAIN.replace("240f", "248f"), "the padding of the map is not all 0"],
  ])("%s", (_, hex, message) => {
    expect(() => readMap("map.m3dm", bytesOf(hex))).toThrow(message);
  });

  test("rows of different lengths", () => {
    const drawn = new TextEncoder().encode("###\n##\n");
    expect(() => readMap("map.txt", drawn)).toThrow("layer 1, row 2 of the text map: expected 2 rows of 3");
    expect(() => readMap("map.txt", new Uint8Array(0))).toThrow("no cells");
  });

  test("any changed byte", () => {
    for (const hex of [CAVE_PACKED, CAVE_PLAIN]) {
      const bytes = bytesOf(hex);
      for (let at = 0; at < bytes.length; at++) {
        const damaged = bytes.map((byte, index) => (index === at ? byte ^ 0x11 : byte));
        try {
          // A plain map has no checksum: a changed bit is another map.
          expect(readMap("map.m3dm", damaged).walls).not.toEqual(readMap("map.m3dm", bytes).walls);
        } catch (error) {
          expect(error).toBeInstanceOf(UnreadableError);
        }
      }
    }
  });
});
