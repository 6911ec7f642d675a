/**
 * What each agent has been told and has seen for itself, as it stands in its observations, and what it knows from that.
 *
 * Kept small: runs of cells and the bytes of map parcels, because what an agent knows is worked out only for the one that is followed.
 * A parcel is taken to be known as soon as it is in an observation; agents that are asked out of turn may make use of it later.
 */

import type { Runs } from "./cdr.ts";
import { Growable } from "./growable.ts";
import type { ParcelReader } from "./parcels.ts";
import { NEVER } from "./run.ts";

/** Columns of a row for each part of an observation: its tick, and where its runs and parcels end. */
const [TICK, RUNS_END, PARCELS_END, COLUMNS] = [0, 1, 2, 3];

export class Lore {
  readonly #parts = new Growable(new Uint32Array(0));
  readonly #starts = new Growable(new Uint32Array(0));
  readonly #lengths = new Growable(new Uint16Array(0));
  /** Where each parcel ends among the bytes. */
  readonly #parcelEnds = new Growable(new Float64Array(0));
  readonly #bytes = new Growable(new Uint8Array(0));

  add(tick: number, runs: readonly Runs[], parcels: readonly Uint8Array[]): void {
    for (const { start, length } of runs) {
      this.#starts.append(start);
      this.#lengths.append(length);
    }
    for (const parcel of parcels) {
      this.#bytes.append(parcel);
      this.#parcelEnds.push(this.#bytes.count);
    }
    this.#parts.append([tick, this.#starts.count, this.#parcelEnds.count]);
  }

  get parts(): number {
    return this.#parts.count / COLUMNS;
  }

  /** Tells of the cells of the parts from `first` on, in order; cells may come several times. */
  tell(first: number, reader: ParcelReader, learn: (tick: number, cell: number) => void): void {
    const parts = this.#parts.array;
    let run = first === 0 ? 0 : parts[(first - 1) * COLUMNS + RUNS_END]!;
    let parcel = first === 0 ? 0 : parts[(first - 1) * COLUMNS + PARCELS_END]!;
    for (let part = first; part < this.parts; part++) {
      const tick = parts[part * COLUMNS + TICK]!;
      for (const end = parts[part * COLUMNS + RUNS_END]!; run < end; run++) {
        const start = this.#starts.array[run]!;
        for (let cell = start + this.#lengths.array[run]!; cell-- > start;) {
          learn(tick, cell);
        }
      }
      for (const end = parts[part * COLUMNS + PARCELS_END]!; parcel < end; parcel++) {
        const from = parcel === 0 ? 0 : this.#parcelEnds.array[parcel - 1]!;
        const cells = reader.cells(this.#bytes.array.subarray(from, this.#parcelEnds.array[parcel]!));
        cells?.forEach((cell) => learn(tick, cell));
      }
    }
  }
}

/** Follows what one agent knows. */
export class Follower {
  readonly request: number;
  readonly #lore: Lore;
  readonly #reader: ParcelReader;
  readonly #isKnown: Uint8Array;
  #parts = 0;

  constructor(request: number, lore: Lore, reader: ParcelReader, cells: number) {
    this.request = request;
    this.#lore = lore;
    this.#reader = reader;
    this.#isKnown = new Uint8Array(cells);
  }

  /** Tick in which the agent learned of each cell, of all so far. */
  all(): Uint32Array {
    const knownTick = new Uint32Array(this.#isKnown.length).fill(NEVER);
    this.#tell((tick, cell) => {
      knownTick[cell] = tick;
    });
    return knownTick;
  }

  /** Tick and cell of all that it has learned since it was asked last. */
  news(): Uint32Array {
    const news = new Growable(new Uint32Array(0));
    this.#tell((tick, cell) => {
      news.push(tick);
      news.push(cell);
    });
    return news.takeAll();
  }

  #tell(learn: (tick: number, cell: number) => void): void {
    const isKnown = this.#isKnown;
    this.#lore.tell(this.#parts, this.#reader, (tick, cell) => {
      if (isKnown[cell] === 0) {
        isKnown[cell] = 1;
        learn(tick, cell);
      }
    });
    this.#parts = this.#lore.parts;
  }
}
