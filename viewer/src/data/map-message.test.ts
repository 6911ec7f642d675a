import { readFileSync } from "node:fs";
import { expect, test } from "vitest";
import { MapMessageReader } from "./map-message.ts";
import type { Vec3 } from "./run.ts";

/** Bytes followed by bits, least significant bit of each byte first. */
function mapMessage(head: readonly number[], bits: string): Uint8Array {
  const digits = bits.replaceAll(" ", "");
  const bytes = Array.from({ length: Math.ceil(digits.length / 8) }, (_, byte) =>
    parseInt(
      digits
        .slice(8 * byte, 8 * byte + 8)
        .padEnd(8, "0")
        .split("")
        .reverse()
        .join(""),
      2,
    ),
  );
  return Uint8Array.from([...head, ...bytes]);
}

/**
 * The update that the agents' encoder is tested with: cells 3 and 5 of block 1; three octants and
 * part of a fourth of block 2; two cells of block 5, some of them covered.
 */
const DOCUMENTED = Uint8Array.from(
  readFileSync("../agent/src/sharing/map_message/update.hex", "utf8")
    .trim()
    .split(" ")
    .map((byte) => parseInt(byte, 16)),
);

/** The receivers of `DOCUMENTED` are 1, 4, 5, 6 and 8. */
const RECEIVER = 5;

function cellsOf(bytes: Uint8Array, size: Vec3, agents: number, receiver = RECEIVER): number[] | null {
  const cells = new MapMessageReader(size, agents).cells(bytes, receiver);
  return cells && Array.from(cells).sort((a, b) => a - b);
}

test("the documented message", () => {
  const cells = cellsOf(DOCUMENTED, [8, 8, 8], 9)!;
  const at = (x: number, y: number, z: number) => (z * 8 + y) * 8 + x;
  const block = (lowest: Vec3, numbers: readonly number[]) =>
    numbers.map((number) => {
      const bit = (place: number) => (number >> place) & 1;
      return at(
        lowest[0] + bit(0) + 2 * bit(3),
        lowest[1] + bit(1) + 2 * bit(4),
        lowest[2] + bit(2) + 2 * bit(5),
      );
    });
  const whole = Array.from({ length: 21 }, (_, number) => number);
  const expected = [...block([4, 0, 0], [3, 5]), ...block([0, 4, 0], whole), ...block([4, 0, 4], [0, 1])];
  expect(cells).toEqual(expected.sort((a, b) => a - b));
});

test("messages for others have no cells", () => {
  const counts = Array.from({ length: 9 }, (_, agent) => cellsOf(DOCUMENTED, [8, 8, 8], 9, agent)!.length);
  expect(counts).toEqual([0, 25, 0, 0, 25, 25, 25, 0, 25]);
});

test("messages of earlier builds", () => {
  const cells = cellsOf(DOCUMENTED, [8, 8, 8], 9)!;
  const blocks = DOCUMENTED.subarray(10);
  const head = (...bytes: number[]) => Uint8Array.from([...bytes, ...blocks]);
  expect(cellsOf(head(3, 5, 1, 0, 1, 2, 0), [8, 8, 8], 9)).toEqual(cells);
  expect(cellsOf(head(2, 5, 1, 2, 0, 0, 1), [8, 8, 8], 9)).toEqual(cells);
  expect(cellsOf(head(2, 5, 1, 2, 0, 0, 1), [8, 8, 8], 8)).toBeNull();
});

test("messages of other runs are ignored", () => {
  expect(cellsOf(DOCUMENTED, [8, 8, 4], 9)).toBeNull();
  expect(cellsOf(DOCUMENTED, [8, 5, 8], 9)).toBeNull();
  expect(cellsOf(DOCUMENTED, [8, 8, 8], 8)).toBeNull();
});

test("malformed messages are ignored", () => {
  const refused: [string, Uint8Array][] = [
    ["no bytes", Uint8Array.of()],
    ["another version", Uint8Array.of(5, 1, 0, 0, 0)],
    ["another form", Uint8Array.of(4, 4, 0, 0, 0)],
    ["a missing block", Uint8Array.of(4, 1, 1, 0, 0, 1)],
    ["a byte too many", Uint8Array.of(4, 1, 0, 0, 0, 7)],
    ["a varint of six bytes", Uint8Array.of(4, 1, 0x80, 0x80, 0x80, 0x80, 0x80, 0)],
    ["a run of too many receivers", Uint8Array.of(4, 1, 2, 0, 2, 0, 0)],
    ["a receiver of another run", Uint8Array.of(4, 1, 1, 2, 0, 0)],
    ["an empty octant", mapMessage([4, 1, 1, 0, 0, 1], "0 10 0 0 0 0 0 0 0 0")],
    ["a whole octant in long form", mapMessage([4, 1, 1, 0, 0, 1], "0 10 10 11111111 0 0 0 0 0 0 0 0")],
    ["mixed walls without a wall", mapMessage([4, 1, 1, 0, 0, 1], "0 10 11 11 00000000 0 0 0 0 0 0 0")],
    ["a descending list", mapMessage([4, 1, 1, 0, 0, 1], "0 0 100 101000 110000 0 1")],
    ["covered cells without one", mapMessage([4, 1, 1, 0, 0, 1], "0 110 0 000000 0 0")],
    ["padding that is set", mapMessage([4, 1, 1, 0, 0, 1], "0 0 0 000000 0 1")],
  ];
  for (const [what, bytes] of refused) {
    expect(cellsOf(bytes, [8, 8, 8], 2), what).toBeNull();
  }
  expect(cellsOf(mapMessage([4, 1, 1, 0, 0, 1], "0 0 0 000000 0"), [8, 8, 8], 2, 0)).toEqual([0]);
  expect(cellsOf(Uint8Array.of(4, 1, 0, 0, 0), [8, 8, 8], 2)).toEqual([]);
  expect(cellsOf(Uint8Array.of(4, 0, 0, 0, 0), [8, 8, 8], 2), "a summary").toEqual([]);
});

test("truncated messages are ignored, and corrupted ones stay inside the map", () => {
  const size: Vec3 = [7, 8, 6];
  const reader = new MapMessageReader(size, 9);
  for (let length = 0; length < DOCUMENTED.length; length++) {
    expect(cellsOf(DOCUMENTED.subarray(0, length), [8, 8, 8], 9)).toBeNull();
  }
  for (let bit = 0; bit < 8 * DOCUMENTED.length; bit++) {
    const changed = DOCUMENTED.map((byte, at) => (at === bit >> 3 ? byte ^ (1 << (bit & 7)) : byte));
    const cells = reader.cells(changed, RECEIVER);
    expect(cells?.every((cell) => cell < size[0] * size[1] * size[2]) ?? true).toBe(true);
  }
});
