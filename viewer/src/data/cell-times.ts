/**
 * A tick for each cell of a map, or NEVER.
 *
 * A large map is mostly unexplored, so its cells have memory only where one has a tick: in pages of
 * neighbours along x. The ticks of other maps are one array.
 */

import { NEVER } from "./run.ts";

/** Maps with more cells have pages. */
export const FLAT_CELLS_MAX = 2 ** 24;

/** Cells of a page, and pages of a pool; powers of two. */
const PAGE_BITS = 6;
const POOL_BITS = 12;
const PAGE_CELLS = 1 << PAGE_BITS;
const POOL_PAGES = 1 << POOL_BITS;

export class CellTimes {
  /** By cell number; null: the times are in pages. */
  readonly flat: Uint32Array | null;
  /** One more than the number of the page with these cells; 0: there is none. */
  readonly #pageOf: Uint32Array;
  readonly #pools: Uint32Array[] = [];
  #pages = 0;

  /** All times are NEVER. They are one array for up to `flatMax` cells. */
  constructor(
    readonly length: number,
    flatMax = FLAT_CELLS_MAX,
  ) {
    const isFlat = length <= flatMax;
    this.flat = isFlat ? new Uint32Array(length).fill(NEVER) : null;
    this.#pageOf = new Uint32Array(isFlat ? 0 : Math.ceil(length / PAGE_CELLS));
  }

  get(cell: number): number {
    if (this.flat !== null) return this.flat[cell]!;
    const page = this.#pageOf[cell >>> PAGE_BITS]!;
    return page === 0 ? NEVER : this.#pools[(page - 1) >>> POOL_BITS]![slotOf(page - 1, cell)]!;
  }

  set(cell: number, tick: number): void {
    if (this.flat !== null) {
      this.flat[cell] = tick;
      return;
    }
    let page = this.#pageOf[cell >>> PAGE_BITS]!;
    if (page === 0) {
      page = ++this.#pages;
      this.#pageOf[cell >>> PAGE_BITS] = page;
      if ((page - 1) % POOL_PAGES === 0) {
        this.#pools.push(new Uint32Array(POOL_PAGES * PAGE_CELLS).fill(NEVER));
      }
    }
    this.#pools[(page - 1) >>> POOL_BITS]![slotOf(page - 1, cell)] = tick;
  }

  /** Sets all times to NEVER. */
  clear(): void {
    this.flat?.fill(NEVER);
    this.#pageOf.fill(0);
    this.#pools.length = 0;
    this.#pages = 0;
  }

  /**
   * Copies the times from a cell on, as many as the target is long. Returns whether any of them may
   * be other than NEVER.
   */
  copyTo(target: Uint32Array, from: number): boolean {
    const end = from + target.length;
    if (this.flat !== null) {
      target.set(this.flat.subarray(from, end));
      return true;
    }
    let isAny = false;
    target.fill(NEVER);
    for (let page = from >>> PAGE_BITS; page * PAGE_CELLS < end; page++) {
      const number = this.#pageOf[page]!;
      if (number === 0) continue;
      isAny = true;
      const first = Math.max(page * PAGE_CELLS, from);
      const cells = Math.min((page + 1) * PAGE_CELLS, end) - first;
      const slot = slotOf(number - 1, first);
      target.set(this.#pools[(number - 1) >>> POOL_BITS]!.subarray(slot, slot + cells), first - from);
    }
    return isAny;
  }

  /** Calls back for each cell with a tick, in their order. */
  forEach(callback: (cell: number, tick: number) => void): void {
    const visit = (from: number, cells: number): void => {
      for (let cell = from; cell < Math.min(from + cells, this.length); cell++) {
        const tick = this.get(cell);
        if (tick !== NEVER) callback(cell, tick);
      }
    };
    if (this.flat !== null) visit(0, this.length);
    else this.#pageOf.forEach((page, at) => page !== 0 && visit(at * PAGE_CELLS, PAGE_CELLS));
  }
}

function slotOf(page: number, cell: number): number {
  return ((page & (POOL_PAGES - 1)) << PAGE_BITS) | (cell & (PAGE_CELLS - 1));
}
