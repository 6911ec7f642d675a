/**
 * Number of cells whose tick is at most a given one.
 *
 * A cell may get an earlier tick later on, because an observation reports scans with a delay.
 */

import { rowsUpTo } from "./growable.ts";

export class TickCounts {
  /** The distinct ticks, ascending, and the number of cells of each. */
  readonly #ticks: number[] = [];
  readonly #counts: number[] = [];
  /** Prefix sums of `#counts`; valid before `#summed`. */
  readonly #sums: number[] = [];
  #summed = 0;

  /** Adds a cell of this tick, or removes one. */
  add(tick: number, change: 1 | -1): void {
    const last = this.#ticks.length - 1;
    // Usually it is the last one.
    let at = last;
    if (last < 0 || this.#ticks[last]! !== tick) {
      const upTo = rowsUpTo(this.#ticks, this.#ticks.length, 1, tick);
      at = upTo - 1;
      if (at < 0 || this.#ticks[at]! !== tick) {
        at = upTo;
        this.#ticks.splice(at, 0, tick);
        this.#counts.splice(at, 0, 0);
      }
    }
    this.#counts[at]! += change;
    this.#summed = Math.min(this.#summed, at);
  }

  upTo(tick: number): number {
    for (; this.#summed < this.#ticks.length; this.#summed++) {
      this.#sums[this.#summed] = (this.#sums[this.#summed - 1] ?? 0) + this.#counts[this.#summed]!;
    }
    const count = rowsUpTo(this.#ticks, this.#ticks.length, 1, tick);
    return count === 0 ? 0 : this.#sums[count - 1]!;
  }
}
