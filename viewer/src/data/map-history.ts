/**
 * The map of a run at any time: that of the start, and its changes.
 *
 * A map is made when it is asked for, from the nearest one before it; few are kept, because one may
 * take many megabytes.
 */

import { CellSet } from "./cell-set.ts";
import type { MapChange, Terrain } from "./run.ts";

/** Maps that are kept beside that of the start. */
const KEPT_MAX = 4;

export class MapHistory {
  readonly #changes: MapChange[] = [];
  /** By number of changes, the map after them; the last one used comes last. */
  readonly #kept = new Map<number, Terrain>();

  constructor(readonly start: Terrain) {}

  /** Adds later changes, in order. */
  add(changes: readonly MapChange[]): void {
    this.#changes.push(...changes);
  }

  /** The map at a tick, whose changes come before everything else in it. */
  at(tick: number): Terrain {
    const after = this.#changes.findLastIndex((change) => change.tick <= tick) + 1;
    if (after === 0) return this.start;
    const terrain = this.#kept.get(after) ?? this.#make(after);
    this.#kept.delete(after);
    this.#kept.set(after, terrain);
    const [oldest] = this.#kept.keys();
    if (this.#kept.size > KEPT_MAX) this.#kept.delete(oldest!);
    return terrain;
  }

  #make(after: number): Terrain {
    const before = Math.max(0, ...[...this.#kept.keys()].filter((count) => count < after));
    const from = this.#kept.get(before) ?? this.start;
    const walls = new CellSet(from.walls.length, from.walls.bytes.slice());
    for (const change of this.#changes.slice(before, after)) apply(change, walls, from.size);
    return { ...from, walls, freeCells: walls.length - walls.count };
  }
}

function apply({ low, high, isWall }: MapChange, walls: CellSet, size: Terrain["size"]): void {
  for (let z = low[2]; z <= high[2]; z++) {
    for (let y = low[1]; y <= high[1]; y++) {
      const row = (z * size[1] + y) * size[0];
      for (let cell = row + low[0]; cell <= row + high[0]; cell++) {
        if (isWall) walls.add(cell);
        else walls.delete(cell);
      }
    }
  }
}
