/**
 * Packed M3DM: maps of up to 1024 cells along an axis, as runs of right predictions.
 *
 * Each cell is predicted from those at x - 1, y - 1 and z - 1: it is what two of the three are, outside being wall. Where all three
 * agree wrong predictions are rare, so agreeing and differing cells have runs of their own; each run is an exponential Golomb code
 * (`docs/maps.md`). Memory for cells is taken after the lengths and the sum have been compared.
 */

import { AXIS_MAX, type CellMap } from "./maps.ts";
import { UnreadableError, type Vec3 } from "./run.ts";

const MARK = [0, 0x4d, 0x33, 0x44, 0x4d, 0x52, 0x4c, 0x45];
const HEADER_BYTES = 52;
const SUM_AT = 48;
const ORDER_MAX = 24;

export function isPacked(bytes: Uint8Array): boolean {
  return bytes.length > 0 && MARK.every((byte, at) => at >= bytes.length || bytes[at] === byte);
}

export function packedMap(bytes: Uint8Array): CellMap {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const number = (at: number) => view.getUint32(at, true);
  if (bytes.length < HEADER_BYTES) {
    throw new UnreadableError(
      `byte ${bytes.length}: the map ends within its header of ${HEADER_BYTES} bytes`,
    );
  }
  if (bytes[8] !== 1 || bytes[9]! > ORDER_MAX || bytes[10]! > ORDER_MAX) {
    throw new UnreadableError(
      `byte 8: version ${bytes[8]} of the packed map with codes of order ${bytes[9]} and ${bytes[10]}, ` +
        `expected is version 1 with orders of up to ${ORDER_MAX}`,
    );
  }
  const size: Vec3 = [number(12), number(16), number(20)];
  const cellM = view.getFloat64(24, true);
  if (size.some((cells) => cells < 1 || cells > AXIS_MAX) || !(cellM > 0 && cellM < Infinity)) {
    throw new UnreadableError(
      `byte 12: a map of ${size.join(" x ")} cells of ${cellM} m, expected are 1 to ${AXIS_MAX} along each axis`,
    );
  }
  const lengths = [number(40), number(44)] as const;
  if (bytes.length !== HEADER_BYTES + lengths[0] + lengths[1]) {
    throw new UnreadableError(
      `the packed map has ${bytes.length} bytes, expected are ${HEADER_BYTES + lengths[0] + lengths[1]}`,
    );
  }
  if (sumOf(bytes) !== number(SUM_AT)) {
    throw new UnreadableError("byte 48: the sum is not that of the map: it is damaged");
  }
  const differing = HEADER_BYTES + lengths[0];
  const kinds = [
    new RunReader(bytes.subarray(HEADER_BYTES, differing), bytes[9]!, number(32)),
    new RunReader(bytes.subarray(differing), bytes[10]!, number(36)),
  ] as const;
  const walls = new Uint8Array(size[0] * size[1] * size[2]);
  const [row, layer] = [size[0], size[0] * size[1]];
  let index = 0;
  for (let z = 0; z < size[2]; z++) {
    for (let y = 0; y < size[1]; y++) {
      for (let x = 0; x < size[0]; x++, index++) {
        const before =
          (x === 0 ? 1 : walls[index - 1]!) +
          (y === 0 ? 1 : walls[index - row]!) +
          (z === 0 ? 1 : walls[index - layer]!);
        const isWrong = kinds[before % 3 === 0 ? 0 : 1].step();
        walls[index] = (before >= 2 ? 1 : 0) ^ isWrong;
      }
    }
  }
  if (!kinds[0].isAtEnd || !kinds[1].isAtEnd) {
    throw new UnreadableError("the runs of the packed map do not end with its last cell");
  }
  return { size, cellM, walls };
}

/** The runs of one kind of cells. */
class RunReader {
  readonly #bytes: Uint8Array;
  readonly #order: number;
  #runsLeft: number;
  #bit = 0;
  /** Cells before the next wrong prediction; endless behind the last run. */
  #cellsLeft = 0;

  constructor(bytes: Uint8Array, order: number, runs: number) {
    this.#bytes = bytes;
    this.#order = order;
    this.#runsLeft = runs;
    this.#next();
  }

  /** Goes on by a cell: 1 if its prediction is wrong, else 0. */
  step(): 0 | 1 {
    if (this.#cellsLeft > 0) {
      this.#cellsLeft--;
      return 0;
    }
    this.#next();
    return 1;
  }

  get isAtEnd(): boolean {
    return (
      this.#runsLeft === 0 && this.#cellsLeft === Infinity && this.#bytes.length === (this.#bit + 7) >> 3
    );
  }

  #next(): void {
    if (this.#runsLeft === 0) {
      this.#cellsLeft = Infinity;
      return;
    }
    this.#runsLeft--;
    let zeros = 0;
    while (this.#takeBit() === 0) {
      zeros++;
      if (zeros > 32) {
        throw new UnreadableError("a run of the packed map is longer than any map");
      }
    }
    let value = 1;
    for (let left = zeros; left > 0; left--) {
      value = 2 * value + this.#takeBit();
    }
    value--;
    for (let left = this.#order; left > 0; left--) {
      value = 2 * value + this.#takeBit();
    }
    this.#cellsLeft = value;
  }

  #takeBit(): number {
    const byte = this.#bytes[this.#bit >> 3];
    if (byte === undefined) {
      throw new UnreadableError("the codes of the packed map end within a run");
    }
    return (byte >> (7 - (this.#bit++ & 7))) & 1;
  }
}

/** CRC-32 as in ISO 3309 of all bytes but those of the sum. */
function sumOf(bytes: Uint8Array): number {
  let sum = 0xffffffff;
  for (let at = 0; at < bytes.length; at++) {
    if (at === SUM_AT) {
      at += 3;
      continue;
    }
    sum = (sum >>> 8) ^ CRC_TABLE[(sum ^ bytes[at]!) & 0xff]!;
  }
  return ~sum >>> 0;
}

const CRC_TABLE = Uint32Array.from({ length: 256 }, (_, byte) => {
  let value = byte;
  for (let bit = 0; bit < 8; bit++) {
    value = value & 1 ? (value >>> 1) ^ 0xedb88320 : value >>> 1;
  }
  return value;
});
