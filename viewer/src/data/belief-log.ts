/**
 * The log of what each agent has sensed and received, from which its belief map is derived.
 *
 * Kept compact (runs of cells and the bytes of map messages), because a belief is derived only for
 * the agent that is followed. A message counts as known once it is in an observation; agents that
 * are observed between their turns may use it later.
 */

import type { Runs } from "./cdr.ts";
import { CellSet } from "./cell-set.ts";
import { Growable } from "./growable.ts";
import type { MapMessageReader } from "./map-message.ts";

/**
 * Columns of the row of each observation fragment: its tick, and where its runs and messages end.
 */
const [TICK, RUNS_END, MESSAGES_END, COLUMNS] = [0, 1, 2, 3];

export class BeliefLog {
  readonly #fragments = new Growable(new Uint32Array(0));
  readonly #starts = new Growable(new Uint32Array(0));
  readonly #lengths = new Growable(new Uint16Array(0));
  /** End of each message in `#bytes`. */
  readonly #messageEnds = new Growable(new Float64Array(0));
  readonly #bytes = new Growable(new Uint8Array(0));
  readonly #agent: number;

  constructor(agent: number) {
    this.#agent = agent;
  }

  add(tick: number, runs: readonly Runs[], mapMessages: readonly Uint8Array[]): void {
    for (const { start, length } of runs) {
      this.#starts.append(start);
      this.#lengths.append(length);
    }
    for (const message of mapMessages) {
      this.#bytes.append(message);
      this.#messageEnds.push(this.#bytes.count);
    }
    this.#fragments.append([tick, this.#starts.count, this.#messageEnds.count]);
  }

  get fragments(): number {
    return this.#fragments.count / COLUMNS;
  }

  /**
   * Calls `learn` for the cells of the fragments from `first` on, in order; a cell may come several
   * times.
   */
  replay(first: number, reader: MapMessageReader, learn: (tick: number, cell: number) => void): void {
    const fragments = this.#fragments.array;
    let run = first === 0 ? 0 : fragments[(first - 1) * COLUMNS + RUNS_END]!;
    let message = first === 0 ? 0 : fragments[(first - 1) * COLUMNS + MESSAGES_END]!;
    for (let fragment = first; fragment < this.fragments; fragment++) {
      const tick = fragments[fragment * COLUMNS + TICK]!;
      for (const end = fragments[fragment * COLUMNS + RUNS_END]!; run < end; run++) {
        const start = this.#starts.array[run]!;
        for (let cell = start + this.#lengths.array[run]!; cell-- > start;) {
          learn(tick, cell);
        }
      }
      for (const end = fragments[fragment * COLUMNS + MESSAGES_END]!; message < end; message++) {
        const from = message === 0 ? 0 : this.#messageEnds.array[message - 1]!;
        const bytes = this.#bytes.array.subarray(from, this.#messageEnds.array[message]!);
        const cells = reader.cells(bytes, this.#agent);
        cells?.forEach((cell) => learn(tick, cell));
      }
    }
  }
}

/** Derives the belief of one agent incrementally. */
export class BeliefTracker {
  readonly request: number;
  readonly #log: BeliefLog;
  readonly #reader: MapMessageReader;
  readonly #known: CellSet;
  #fragments = 0;

  constructor(request: number, log: BeliefLog, reader: MapMessageReader, cells: number) {
    this.request = request;
    this.#log = log;
    this.#reader = reader;
    this.#known = new CellSet(cells);
  }

  /** Tick and cell of everything learned since the last call. */
  takeNew(): Uint32Array {
    const added = new Growable(new Uint32Array(0));
    this.#replay((tick, cell) => {
      added.push(tick);
      added.push(cell);
    });
    return added.takeAll();
  }

  #replay(learn: (tick: number, cell: number) => void): void {
    const known = this.#known;
    this.#log.replay(this.#fragments, this.#reader, (tick, cell) => {
      if (!known.has(cell)) {
        known.add(cell);
        learn(tick, cell);
      }
    });
    this.#fragments = this.#log.fragments;
  }
}
