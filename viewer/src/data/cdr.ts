/**
 * Little-endian CDR reader for ROS 2 messages: plain alignment relative to the end of the
 * encapsulation header.
 *
 * Invariant: reading beyond the end throws a RangeError before memory is allocated, whatever
 * lengths the bytes claim. This reader is our own instead of `@foxglove/cdr` because runs of cells
 * are most of a recording: they are read into typed arrays without an intermediate array, and
 * without trusting their lengths.
 */

const HEADER_BYTES = 4;

/** Cells in run-length form: first cell number and number of cells of each run. */
export interface Runs {
  readonly start: Uint32Array;
  readonly length: Uint16Array;
}

const text = new TextDecoder();

export class CdrReader {
  readonly #bytes: Uint8Array;
  readonly #view: DataView;
  #at = HEADER_BYTES;

  constructor(bytes: Uint8Array) {
    if (bytes.length < HEADER_BYTES || bytes[0] !== 0 || bytes[1] !== 1) {
      throw new RangeError("not little-endian CDR");
    }
    this.#bytes = bytes;
    this.#view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  #take(size: number): number {
    const at = this.#at + ((HEADER_BYTES - this.#at) & (size - 1));
    this.#at = at + size;
    return at;
  }

  u8(): number {
    return this.#view.getUint8(this.#take(1));
  }

  u16(): number {
    return this.#view.getUint16(this.#take(2), true);
  }

  u32(): number {
    return this.#view.getUint32(this.#take(4), true);
  }

  i32(): number {
    return this.#view.getInt32(this.#take(4), true);
  }

  f64(): number {
    return this.#view.getFloat64(this.#take(8), true);
  }

  /** Unsigned 64-bit integer. Values beyond 2^53 are rounded; no value used here reaches that. */
  u64(): number {
    const at = this.#take(8);
    return this.#view.getUint32(at + 4, true) * 2 ** 32 + this.#view.getUint32(at, true);
  }

  /** Skips `count` values of `size` bytes. */
  skip(count: number, size: number): void {
    if (count > 0) {
      this.#take(size);
      this.#at += (count - 1) * size;
    }
  }

  /** Length of a sequence whose elements take at least `elementBytes` each. */
  count(elementBytes: number): number {
    const count = this.u32();
    if (count * elementBytes > this.#bytes.length - this.#at) {
      throw new RangeError(`${count} elements in ${this.#bytes.length - this.#at} bytes`);
    }
    return count;
  }

  /** A byte sequence, without a copy. */
  bytes(): Uint8Array {
    const count = this.count(1);
    const start = this.#at;
    this.#at += count;
    return this.#bytes.subarray(start, this.#at);
  }

  string(): string {
    const bytes = this.bytes();
    return text.decode(bytes.subarray(0, Math.max(0, bytes.length - 1)));
  }

  f64s(): number[] {
    const count = this.count(8);
    return Array.from({ length: count }, () => this.f64());
  }

  runs(): Runs {
    const starts = this.count(4);
    const start = new Uint32Array(starts);
    let at = starts > 0 ? this.#take(4) : 0;
    for (let run = 0; run < starts; run++, at += 4) {
      start[run] = this.#view.getUint32(at, true);
    }
    this.#at += Math.max(0, starts - 1) * 4;
    const lengths = this.count(2);
    if (lengths !== starts) {
      throw new RangeError(`${starts} runs with ${lengths} lengths`);
    }
    const length = new Uint16Array(lengths);
    at = lengths > 0 ? this.#take(2) : 0;
    for (let run = 0; run < lengths; run++, at += 2) {
      length[run] = this.#view.getUint16(at, true);
    }
    this.#at += Math.max(0, lengths - 1) * 2;
    return { start, length };
  }
}
