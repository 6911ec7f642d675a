/**
 * Packed M3DM: maps of up to 1024 cells along an axis, as runs of correct predictions.
 *
 * Each cell is predicted by a majority vote of its neighbours at x - 1, y - 1 and z - 1; outside is
 * wall. Wrong predictions are rare where all three agree, so agreeing and differing neighbourhoods
 * have separate run lengths, each an exponential Golomb code (`voxels/src/packed.rs`). Lengths and
 * checksum are checked before cells are allocated.
 */

import { crc32Final, crc32Init, crc32Update } from "@foxglove/crc";
import type { CellMap } from "./cell-map.ts";
import { CellSet } from "./cell-set.ts";
import { UnreadableError, type Vec3 } from "./run.ts";

/** Maximum number of cells along an axis. */
const AXIS_MAX = 1024;

const MARK = [0, 0x4d, 0x33, 0x44, 0x4d, 0x52, 0x4c, 0x45];
const HEADER_BYTES = 52;
const CHECKSUM_AT = 48;
const ORDER_MAX = 24;

/** Longer than any map. */
const ENDLESS = 2 ** 31 - 1;

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
        `expected version 1 with orders of up to ${ORDER_MAX}`,
    );
  }
  const size: Vec3 = [number(12), number(16), number(20)];
  const cellM = view.getFloat64(24, true);
  if (size.some((cells) => cells < 1 || cells > AXIS_MAX) || !(cellM > 0 && cellM < Infinity)) {
    throw new UnreadableError(
      `byte 12: a map of ${size.join(" x ")} cells of ${cellM} m, expected 1 to ${AXIS_MAX} along each axis`,
    );
  }
  const lengths = [number(40), number(44)] as const;
  if (bytes.length !== HEADER_BYTES + lengths[0] + lengths[1]) {
    throw new UnreadableError(
      `the packed map has ${bytes.length} bytes, expected ${HEADER_BYTES + lengths[0] + lengths[1]}`,
    );
  }
  if (checksumOf(bytes) !== number(CHECKSUM_AT)) {
    throw new UnreadableError("byte 48: the checksum of the map does not match: it is damaged");
  }
  const differingAt = HEADER_BYTES + lengths[0];
  const agreeing = new RunReader(bytes.subarray(HEADER_BYTES, differingAt), bytes[9]!, number(32));
  const differing = new RunReader(bytes.subarray(differingAt), bytes[10]!, number(36));
  const walls = decoded(size, agreeing, differing);
  if (!agreeing.isAtEnd || !differing.isAtEnd) {
    throw new UnreadableError("the runs of the packed map do not end with its last cell");
  }
  return { size, cellM, walls };
}

/** One flat loop, because a map may have a thousand million cells. */
function decoded(size: Vec3, agreeing: RunReader, differing: RunReader): CellSet {
  const [sizeX, sizeY, sizeZ] = size;
  const area = sizeX * sizeY;
  const walls = new CellSet(area * sizeZ);
  // The layer so far, and behind it what is left of the layer below.
  const layer = new Uint8Array(area).fill(1);
  let agreeingLeft = agreeing.next();
  let differingLeft = differing.next();
  let index = 0;
  for (let z = 0; z < sizeZ; z++) {
    let at = 0;
    for (let y = 0; y < sizeY; y++) {
      let last = 1;
      for (let x = 0; x < sizeX; x++, at++, index++) {
        const around = last + (y === 0 ? 1 : layer[at - sizeX]!) + layer[at]!;
        last = around >> 1;
        if (around === 0 || around === 3) {
          if (agreeingLeft-- === 0) {
            last ^= 1;
            agreeingLeft = agreeing.next();
          }
        } else if (differingLeft-- === 0) {
          last ^= 1;
          differingLeft = differing.next();
        }
        layer[at] = last;
        if (last === 1) walls.add(index);
      }
    }
  }
  return walls;
}

/** Run lengths of one kind of neighbourhood. */
class RunReader {
  readonly #bytes: Uint8Array;
  readonly #order: number;
  #runsLeft: number;
  #bit = 0;
  #hasEnded = false;

  constructor(bytes: Uint8Array, order: number, runs: number) {
    this.#bytes = bytes;
    this.#order = order;
    this.#runsLeft = runs;
  }

  /** Whether all codes have been read and the last run is used up. */
  get isAtEnd(): boolean {
    return this.#hasEnded && this.#bytes.length === (this.#bit + 7) >> 3;
  }

  /** Number of cells before the next wrong prediction; longer than any map if there is none. */
  next(): number {
    if (this.#runsLeft === 0) {
      this.#hasEnded = true;
      return ENDLESS;
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
    return value;
  }

  #takeBit(): number {
    const byte = this.#bytes[this.#bit >> 3];
    if (byte === undefined) {
      throw new UnreadableError("the codes of the packed map end within a run");
    }
    return (byte >> (7 - (this.#bit++ & 7))) & 1;
  }
}

/** CRC-32 (ISO 3309) of all bytes but those of the checksum. */
function checksumOf(bytes: Uint8Array): number {
  const head = crc32Update(crc32Init(), bytes.subarray(0, CHECKSUM_AT));
  return crc32Final(crc32Update(head, bytes.subarray(CHECKSUM_AT + 4)));
}
