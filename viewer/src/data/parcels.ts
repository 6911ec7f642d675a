/**
 * Map parcels: what agents tell each other of the map.
 *
 * The bytes are those that `agent_node/src/sharing/map_message.rs` describes, version 2: who is told, then news of blocks of 4 x 4 x 4
 * cells as bits, the lowest bit of each byte first. Numbers of cells in a block are made of the bits of their places: x0, y0, z0, x1,
 * y1, z1 from the lowest. A parcel of which anything is wrong tells nothing, as agents have it.
 */

import type { Vec3 } from "./run.ts";

const VERSION = 2;
const SIDE = 4;
const BLOCK_CELLS = SIDE ** 3;
const NUMBER_BYTES_MAX = 5;
const GAP_BITS_MAX = 24;

/** Reads map parcels for a map of one size and a team. */
export class ParcelReader {
  readonly #size: Vec3;
  readonly #blocks: Vec3;
  readonly #agents: number;
  /** By number in a block: its place, and how far it lies behind the lowest cell. */
  readonly #places: readonly Vec3[];
  readonly #offsets: readonly number[];
  /** Cells of the parcel that is being read. */
  #cells = new Uint32Array(1024);
  #count = 0;

  constructor(size: Vec3, agents: number) {
    this.#size = size;
    this.#blocks = [Math.ceil(size[0] / SIDE), Math.ceil(size[1] / SIDE), Math.ceil(size[2] / SIDE)];
    this.#agents = agents;
    this.#places = Array.from({ length: BLOCK_CELLS }, (_, number): Vec3 => {
      const bit = (at: number) => (number >> at) & 1;
      return [bit(0) + 2 * bit(3), bit(1) + 2 * bit(4), bit(2) + 2 * bit(5)];
    });
    this.#offsets = this.#places.map(([x, y, z]) => (z * size[1] + y) * size[0] + x);
  }

  /** Cells that a parcel tells of, free or wall; valid until the next call. Null if it is no map parcel of this run. */
  cells(bytes: Uint8Array): Uint32Array | null {
    this.#count = 0;
    const numbers = { bytes, at: 1 };
    if (bytes[0] !== VERSION) {
      return null;
    }
    const receivers = number(numbers);
    if (receivers === null || receivers > this.#agents) {
      return null;
    }
    let next = 0;
    for (let left = receivers; left > 0; left--) {
      const gap = number(numbers);
      if (gap === null || next + gap >= this.#agents) {
        return null;
      }
      next += gap + 1;
    }
    const blocks = number(numbers);
    if (blocks === null) {
      return null;
    }
    const bits = new BitReader(bytes, numbers.at);
    const [across, along, up] = this.#blocks;
    let block = -1;
    for (let left = blocks; left > 0; left--) {
      const gap = bits.gap();
      if (gap === null || bits.hasOverrun) {
        return null;
      }
      block += gap + 1;
      if (block >= across * along * up || !this.#block(bits, block) || bits.hasOverrun) {
        return null;
      }
    }
    return bits.isAtEnd ? this.#cells.subarray(0, this.#count) : null;
  }

  #block(bits: BitReader, block: number): boolean {
    const [across, along] = this.#blocks;
    const row = Math.floor(block / across);
    const lowest: Vec3 = [(block % across) * SIDE, (row % along) * SIDE, Math.floor(row / along) * SIDE];
    const start = (lowest[2] * this.#size[1] + lowest[1]) * this.#size[0] + lowest[0];
    const isBareList = bits.word(1) === 0;
    const hasCovered = !isBareList && bits.word(1) === 1;
    const isList = isBareList || (hasCovered && bits.word(1) === 0);
    const first = this.#count;
    const free = isList ? this.#list(bits, lowest, start) : this.#octants(bits, lowest, start);
    if (free === null || this.#count === first) {
      return false;
    }
    if (hasCovered) {
      let covered = 0;
      for (let left = free; left > 0; left--) {
        covered += bits.word(1);
      }
      return covered > 0;
    }
    return true;
  }

  /** How many of the cells of a list are free; null if it is malformed. */
  #list(bits: BitReader, lowest: Vec3, start: number): number | null {
    const more = bits.gap();
    if (more === null || more >= BLOCK_CELLS) {
      return null;
    }
    let next = 0;
    for (let left = more + 1; left > 0; left--) {
      const cell = bits.word(6);
      if (cell < next || !this.#add(cell, lowest, start)) {
        return null;
      }
      next = cell + 1;
    }
    let walls = 0;
    for (let left = more + 1; left > 0; left--) {
      walls += bits.word(1);
    }
    return more + 1 - walls;
  }

  /** The same of octants. */
  #octants(bits: BitReader, lowest: Vec3, start: number): number | null {
    let free = 0;
    for (let octant = 0; octant < 8; octant++) {
      if (bits.word(1) === 0) {
        continue;
      }
      const isWhole = bits.word(1) === 1;
      const known = isWhole ? 0xff : bits.word(8);
      if (!isWhole && (known === 0 || known === 0xff)) {
        return null;
      }
      let cells = 0;
      for (let place = 0; place < 8; place++) {
        if ((known >> place) & 1) {
          cells++;
          if (!this.#add(8 * octant + place, lowest, start)) {
            return null;
          }
        }
      }
      let walls = 0;
      if (bits.word(1) === 1) {
        walls = bits.word(1) === 0 ? cells : ones(bits.word(cells));
        if (walls === 0) {
          return null;
        }
      }
      free += cells - walls;
    }
    return free;
  }

  /** Adds a cell, if the map has it. */
  #add(cell: number, lowest: Vec3, start: number): boolean {
    const place = this.#places[cell]!;
    if (place.some((at, axis) => lowest[axis]! + at >= this.#size[axis]!)) {
      return false;
    }
    if (this.#count === this.#cells.length) {
      const longer = new Uint32Array(2 * this.#count);
      longer.set(this.#cells);
      this.#cells = longer;
    }
    this.#cells[this.#count++] = start + this.#offsets[cell]!;
    return true;
  }
}

/** The next unsigned LEB128; null if there is none of at most 32 bits. */
function number(from: { readonly bytes: Uint8Array; at: number }): number | null {
  let value = 0;
  for (let place = 0; place < NUMBER_BYTES_MAX; place++) {
    const byte = from.bytes[from.at++];
    if (byte === undefined) {
      return null;
    }
    value += (byte & 0x7f) * 2 ** (7 * place);
    if (byte < 0x80) {
      return value < 2 ** 32 ? value : null;
    }
  }
  return null;
}

function ones(word: number): number {
  let count = 0;
  for (let left = word; left !== 0; left &= left - 1) {
    count++;
  }
  return count;
}

/** Bits, the lowest of each byte first; behind the end all are 0. */
class BitReader {
  readonly #bytes: Uint8Array;
  #bit: number;

  constructor(bytes: Uint8Array, start: number) {
    this.#bytes = bytes;
    this.#bit = 8 * start;
  }

  /** A word of at most 24 bits. */
  word(bits: number): number {
    const byte = this.#bit >>> 3;
    const bytes = this.#bytes;
    const ahead =
      (bytes[byte] ?? 0) |
      ((bytes[byte + 1] ?? 0) << 8) |
      ((bytes[byte + 2] ?? 0) << 16) |
      ((bytes[byte + 3] ?? 0) << 24);
    const word = (ahead >>> (this.#bit & 7)) & ((1 << bits) - 1);
    this.#bit += bits;
    return word;
  }

  /** So many ones, a zero, and as many bits; null if they are more than a map has use for. */
  gap(): number | null {
    let bits = 0;
    while (this.word(1) === 1) {
      bits++;
      if (bits > GAP_BITS_MAX) {
        return null;
      }
    }
    return this.word(bits) + (1 << bits) - 1;
  }

  get hasOverrun(): boolean {
    return this.#bit > 8 * this.#bytes.length;
  }

  /** Whether nothing is left but the zeros that fill up the last byte. */
  get isAtEnd(): boolean {
    const left = 8 * this.#bytes.length - this.#bit;
    return left >= 0 && left < 8 && (left === 0 || this.word(left) === 0);
  }
}
