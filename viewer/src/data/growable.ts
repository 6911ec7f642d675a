/**
 * Append-only typed arrays.
 *
 * Invariant: elements never change. A full array is replaced by one of twice its length.
 */

type Numbers = Float64Array | Float32Array | Uint32Array | Uint16Array | Uint8Array;

export class Growable<A extends Numbers> {
  #array: A;
  #count = 0;

  /** `empty` determines the element type. */
  constructor(empty: A) {
    this.#array = empty;
  }

  /** The elements, followed by spare capacity. */
  get array(): A {
    return this.#array;
  }

  get count(): number {
    return this.#count;
  }

  push(value: number): void {
    this.#grow(1);
    this.#array[this.#count++] = value;
  }

  append(values: ArrayLike<number>): void {
    this.#grow(values.length);
    this.#array.set(values, this.#count);
    this.#count += values.length;
  }

  /** Returns a copy of all elements and clears the array. */
  takeAll(): A {
    const values = this.#array.slice(0, this.#count) as A;
    this.#count = 0;
    return values;
  }

  #grow(more: number): void {
    const needed = this.#count + more;
    if (needed > this.#array.length) {
      const Kind = this.#array.constructor as new (length: number) => A;
      const longer = new Kind(Math.max(needed, 2 * this.#array.length, 16));
      longer.set(this.#array.subarray(0, this.#count));
      this.#array = longer;
    }
  }
}

/**
 * Number of the first `count` rows whose key is at most `limit`. The key is the first column; keys
 * ascend.
 */
export function rowsUpTo(rows: ArrayLike<number>, count: number, stride: number, limit: number): number {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (rows[middle * stride]! <= limit) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low;
}
