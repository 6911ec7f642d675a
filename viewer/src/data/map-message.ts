/**
 * Decoder of map messages: what agents share of their maps.
 *
 * The format is version 4 of `agent/src/sharing/map_message.rs`. Of its four forms only
 * updates have cells: the receivers, a position in the journal of the sender, then blocks of
 * 4 x 4 x 4 cells as a bit stream, least significant bit of each byte first. Cell numbers in a
 * block interleave the bits of the coordinates: x0, y0, z0, x1, y1, z1 from the lowest. A malformed
 * message is ignored as a whole, as agents do. Recordings of earlier builds have versions 2 and 3,
 * updates alone, without the form and the position.
 */

import type { Vec3 } from "./run.ts";

const VERSION = 4;
/** The version whose receivers were listed one by one, and the one with runs of them. */
const VERSION_OF_LISTS = 2;
const VERSION_OF_RUNS = 3;
const UPDATE = 1;
const FORMS = 4;
const SIDE = 4;
const BLOCK_CELLS = SIDE ** 3;
const NUMBER_BYTES_MAX = 5;
const GAP_BITS_MAX = 24;

/** Decodes map messages for one map size and team size. */
export class MapMessageReader {
  readonly #size: Vec3;
  readonly #blocks: Vec3;
  readonly #agents: number;
  /** Coordinates in a block by cell number, and offset of the cell from the block's lowest one. */
  readonly #coordinates: readonly Vec3[];
  readonly #offsets: readonly number[];
  /** Cells of the message that is being decoded. */
  #cells = new Uint32Array(1024);
  #count = 0;
  #isForReceiver = false;

  constructor(size: Vec3, agents: number) {
    this.#size = size;
    this.#blocks = [Math.ceil(size[0] / SIDE), Math.ceil(size[1] / SIDE), Math.ceil(size[2] / SIDE)];
    this.#agents = agents;
    this.#coordinates = Array.from({ length: BLOCK_CELLS }, (_, number): Vec3 => {
      const bit = (at: number) => (number >> at) & 1;
      return [bit(0) + 2 * bit(3), bit(1) + 2 * bit(4), bit(2) + 2 * bit(5)];
    });
    this.#offsets = this.#coordinates.map(([x, y, z]) => (z * size[1] + y) * size[0] + x);
  }

  /**
   * Cells that a message contains, free or wall, for one of its receivers; valid until the next
   * call. An agent ignores updates for others, as broadcasts to dense neighbourhoods are. Null if
   * it is no map message of this run; the other forms are not looked at.
   */
  cells(bytes: Uint8Array, receiver: number): Uint32Array | null {
    this.#count = 0;
    this.#isForReceiver = false;
    const version = bytes[0];
    const numbers = { bytes, at: 1 };
    if (version === VERSION) {
      const form = bytes[numbers.at++];
      if (form === undefined || form >= FORMS) {
        return null;
      }
      if (form !== UPDATE) {
        return this.#cells.subarray(0, 0);
      }
      if (!this.#areReceivers(numbers, receiver) || number(numbers) === null) {
        return null;
      }
    } else if (version === VERSION_OF_RUNS || version === VERSION_OF_LISTS) {
      if (!this.#areReceivers(numbers, receiver, version === VERSION_OF_RUNS)) {
        return null;
      }
    } else {
      return null;
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
    return bits.isAtEnd ? this.#cells.subarray(0, this.#isForReceiver ? this.#count : 0) : null;
  }

  /** Whether receivers follow, all of them agents of this run: runs of consecutive ids, or each one. */
  #areReceivers(numbers: Numbers, receiver: number, areRuns = true): boolean {
    let left = number(numbers);
    let next = 0;
    while (left !== null && left > 0) {
      const gap = number(numbers);
      const more = areRuns && left > 1 ? number(numbers) : 0;
      if (gap === null || more === null || more >= left || next + gap + more >= this.#agents) {
        return false;
      }
      this.#isForReceiver ||= next + gap <= receiver && receiver <= next + gap + more;
      left -= more + 1;
      // The next id is not in another run.
      next += gap + more + (areRuns ? 2 : 1);
    }
    return left === 0;
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

  /** Number of free cells in a list; null if it is malformed. */
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

  /** Number of free cells in octants; null if they are malformed. */
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
      for (let bit = 0; bit < 8; bit++) {
        if ((known >> bit) & 1) {
          cells++;
          if (!this.#add(8 * octant + bit, lowest, start)) {
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

  /** Adds a cell; false if it lies outside the map. */
  #add(cell: number, lowest: Vec3, start: number): boolean {
    const coordinates = this.#coordinates[cell]!;
    if (coordinates.some((at, axis) => lowest[axis]! + at >= this.#size[axis]!)) {
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

/** Bytes, and where to read on. */
interface Numbers {
  readonly bytes: Uint8Array;
  at: number;
}

/** The next unsigned LEB128 integer; null if there is none of at most 32 bits. */
function number(from: Numbers): number | null {
  let value = 0;
  for (let index = 0; index < NUMBER_BYTES_MAX; index++) {
    const byte = from.bytes[from.at++];
    if (byte === undefined) {
      return null;
    }
    value += (byte & 0x7f) * 2 ** (7 * index);
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

/** Bit stream, least significant bit of each byte first; zeros follow its end. */
class BitReader {
  readonly #bytes: Uint8Array;
  #bit: number;

  constructor(bytes: Uint8Array, start: number) {
    this.#bytes = bytes;
    this.#bit = 8 * start;
  }

  /** The next `bits` bits, at most 24. */
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

  /**
   * An exponential Golomb code: a unary length, then as many bits; null if the length exceeds any
   * map.
   */
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

  /** Whether only the zero padding of the last byte is left. */
  get isAtEnd(): boolean {
    const left = 8 * this.#bytes.length - this.#bit;
    return left >= 0 && left < 8 && (left === 0 || this.word(left) === 0);
  }
}
