/**
 * Partition of the map into cubic chunks, and which of them are stale.
 *
 * What a chunk looks like at a tick depends on which of its cells, and of the cells just beyond its
 * faces, have a time up to that tick. So it is stale exactly if one of these times lies between the
 * tick it was built for and the requested one, or if a time up to the former became known since.
 */

import type { CellTimes } from "../data/cell-times.ts";
import { NEVER } from "../data/run.ts";

export type Size = readonly [number, number, number];

/** The partition; chunks are numbered like cells, x fastest. */
export class Grid {
  readonly counts: Size;
  readonly chunks: number;

  constructor(
    readonly size: Size,
    readonly edge: number,
  ) {
    this.counts = [Math.ceil(size[0] / edge), Math.ceil(size[1] / edge), Math.ceil(size[2] / edge)];
    this.chunks = this.counts[0] * this.counts[1] * this.counts[2];
  }

  /** The lowest cell of a chunk. */
  origin(chunk: number): [number, number, number] {
    const [countX, countY] = this.counts;
    const x = chunk % countX;
    const y = Math.floor(chunk / countX) % countY;
    const z = Math.floor(chunk / (countX * countY));
    return [x * this.edge, y * this.edge, z * this.edge];
  }

  /**
   * Calls back for the chunk of a cell, and for each chunk that has the cell in its border (a
   * neighbour across a face).
   */
  forTouched(cell: number, callback: (chunk: number) => void): void {
    const { size, edge, counts } = this;
    const x = cell % size[0];
    const y = Math.floor(cell / size[0]) % size[1];
    const z = Math.floor(cell / (size[0] * size[1]));
    const [chunkX, chunkY, chunkZ] = [Math.floor(x / edge), Math.floor(y / edge), Math.floor(z / edge)];
    const [strideY, strideZ] = [counts[0], counts[0] * counts[1]];
    const chunk = chunkX + chunkY * strideY + chunkZ * strideZ;
    callback(chunk);
    const [inX, inY, inZ] = [x - chunkX * edge, y - chunkY * edge, z - chunkZ * edge];
    if (inX === 0 && chunkX > 0) callback(chunk - 1);
    if (inX === edge - 1 && chunkX + 1 < counts[0]) callback(chunk + 1);
    if (inY === 0 && chunkY > 0) callback(chunk - strideY);
    if (inY === edge - 1 && chunkY + 1 < counts[1]) callback(chunk + strideY);
    if (inZ === 0 && chunkZ > 0) callback(chunk - strideZ);
    if (inZ === edge - 1 && chunkZ + 1 < counts[2]) callback(chunk + strideZ);
  }

  /**
   * Fills `padded` (see `Block`) for a chunk: 1 for cells in the set, 0 for others and outside the
   * map. Returns whether any cell of the chunk itself is in the set.
   */
  fill(chunk: number, padded: Uint8Array, contains: (cell: number) => boolean): boolean {
    const { size, edge } = this;
    const [originX, originY, originZ] = this.origin(chunk);
    const row = edge + 2;
    padded.fill(0, 0, row * row * row);
    const [fromX, toX] = [Math.max(originX - 1, 0), Math.min(originX + edge + 1, size[0])];
    const [fromY, toY] = [Math.max(originY - 1, 0), Math.min(originY + edge + 1, size[1])];
    const [fromZ, toZ] = [Math.max(originZ - 1, 0), Math.min(originZ + edge + 1, size[2])];
    let isAny = false;
    for (let z = fromZ; z < toZ; z++) {
      const isInZ = z >= originZ && z < originZ + edge;
      for (let y = fromY; y < toY; y++) {
        const isInY = isInZ && y >= originY && y < originY + edge;
        const cells = (z * size[1] + y) * size[0];
        const at = ((z - originZ + 1) * row + (y - originY + 1)) * row + 1 - originX;
        for (let x = fromX; x < toX; x++) {
          if (!contains(cells + x)) continue;
          padded[at + x] = 1;
          isAny ||= isInY && x >= originX && x < originX + edge;
        }
      }
    }
    return isAny;
  }
}

/** The distinct times of the cells of a chunk, ascending, and the tick it was built for. */
interface Clock {
  ticks: Uint32Array;
  count: number;
  /** -1: never built, or invalidated by a time that became known since. */
  builtFor: number;
}

/** Tracks which chunks must be rebuilt. Only cells accepted by `counts` matter. */
export class ChunkStaleness {
  readonly #clocks: Clock[];

  constructor(
    readonly grid: Grid,
    readonly times: CellTimes,
    readonly counts: (cell: number) => boolean,
  ) {
    const sets = Array.from({ length: grid.chunks }, () => new Set<number>());
    times.forEach((cell, tick) => {
      if (counts(cell)) grid.forTouched(cell, (chunk) => sets[chunk]!.add(tick));
    });
    this.#clocks = sets.map((set) => {
      const ticks = Uint32Array.from(set).sort();
      return { ticks, count: ticks.length, builtFor: -1 };
    });
  }

  /** The times of these cells have become known, or earlier than before. */
  markChanged(cells: Iterable<number>): void {
    for (const cell of cells) {
      const tick = this.times.get(cell);
      if (tick === NEVER || !this.counts(cell)) continue;
      this.grid.forTouched(cell, (chunk) => {
        const clock = this.#clocks[chunk]!;
        insert(clock, tick);
        if (tick <= clock.builtFor) clock.builtFor = -1;
      });
    }
  }

  /** Whether a chunk looks different at `tick` than it was built. */
  isStale(chunk: number, tick: number): boolean {
    const clock = this.#clocks[chunk]!;
    if (clock.builtFor < 0) return true;
    return countUpTo(clock, clock.builtFor) !== countUpTo(clock, tick);
  }

  /** Records that a chunk was built for `tick`. */
  markBuilt(chunk: number, tick: number): void {
    this.#clocks[chunk]!.builtFor = tick;
  }
}

/** Number of times up to `tick`. */
function countUpTo(clock: Clock, tick: number): number {
  let [low, high] = [0, clock.count];
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (clock.ticks[middle]! <= tick) low = middle + 1;
    else high = middle;
  }
  return low;
}

function insert(clock: Clock, tick: number): void {
  const at = countUpTo(clock, tick);
  if (at > 0 && clock.ticks[at - 1] === tick) return;
  if (clock.count === clock.ticks.length) {
    const larger = new Uint32Array(Math.max(16, clock.count * 2));
    larger.set(clock.ticks);
    clock.ticks = larger;
  }
  clock.ticks.copyWithin(at + 1, at, clock.count);
  clock.ticks[at] = tick;
  clock.count++;
}
