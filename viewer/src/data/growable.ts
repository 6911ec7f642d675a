/**
 * Typed arrays that grow: values are only ever added behind the others.
 *
 * Invariant: what has been added never changes. The array behind it is replaced by one of twice the length when it is full.
 */

type Numbers = Float64Array | Float32Array | Uint32Array | Uint16Array | Uint8Array;

export class Growable<A extends Numbers> {
  #array: A;
  #count = 0;

  /** `empty` is an array of the kind wanted. */
  constructor(empty: A) {
    this.#array = empty;
  }

  /** The values, and room behind them. */
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

  /** All values so far in an array of their own, and begins anew. */
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

/** How many of the first `count` rows have a key of at most `limit`; keys stand at the start of each row, ascending. */
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
