/** A set of cells of a map, one bit for each: a map may have a thousand million cells. */

export class CellSet {
  /** Eight cells per byte, the lowest in the least significant bit. */
  readonly bytes: Uint8Array<ArrayBuffer>;

  /** `length` is the number of cells of the map; `bytes` are those of another set. */
  constructor(
    readonly length: number,
    bytes: Uint8Array<ArrayBuffer> = new Uint8Array(Math.ceil(length / 8)),
  ) {
    this.bytes = bytes;
  }

  /** The cells for which there is a number other than 0. */
  static of(cells: ArrayLike<number>): CellSet {
    const set = new CellSet(cells.length);
    for (let cell = 0; cell < cells.length; cell++) if (cells[cell] !== 0) set.add(cell);
    return set;
  }

  has(cell: number): boolean {
    return ((this.bytes[cell >>> 3]! >>> (cell & 7)) & 1) === 1;
  }

  add(cell: number): void {
    this.bytes[cell >>> 3]! |= 1 << (cell & 7);
  }

  delete(cell: number): void {
    this.bytes[cell >>> 3]! &= ~(1 << (cell & 7));
  }

  /** Number of cells in the set. */
  get count(): number {
    let count = 0;
    for (const byte of this.bytes) count += ONES[byte]!;
    return count;
  }

  /** One byte per cell, 1 for those of the set. */
  toBytes(): Uint8Array {
    const { bytes } = this;
    const all = new Uint8Array(this.length);
    for (let cell = 0; cell < all.length; cell++) all[cell] = (bytes[cell >>> 3]! >>> (cell & 7)) & 1;
    return all;
  }
}

const ONES = Uint8Array.from({ length: 256 }, (_, byte) => byte.toString(2).replaceAll("0", "").length);
