/**
 * The map at drawing resolution: its own cells or, if there are too many, blocks of cells.
 *
 * A block is free if at least half of its cells are; its time is the earliest of those of its free
 * cells.
 */

import type { Terrain } from "../data/run.ts";
import { CellTimes } from "../data/cell-times.ts";
import type { Size } from "./chunks.ts";

/** A map of blocks. */
export interface BlockModel {
  readonly size: Size;
  /** Block edge, metres. */
  readonly cellM: number;
  /** 1 is wall, 0 free; by block number. */
  readonly walls: Uint8Array;
  /** Block edge in cells; 1: the blocks are the cells of the map. */
  readonly step: number;
  readonly terrain: Terrain;
}

/** The finest model with at most `blocksMax` blocks in all and `edgeMax` along an axis. */
export function blockModelOf(terrain: Terrain, blocksMax: number, edgeMax: number): BlockModel {
  const { size, cellM, walls } = terrain;
  let step = 1;
  let blocks: Size = size;
  while (blocks[0] * blocks[1] * blocks[2] > blocksMax || Math.max(...blocks) > edgeMax) {
    step *= 2;
    blocks = [Math.ceil(size[0] / step), Math.ceil(size[1] / step), Math.ceil(size[2] / step)];
  }
  if (step === 1) return { size, cellM, walls: walls.toBytes(), step, terrain };
  return { size: blocks, cellM: cellM * step, walls: solidBlocks(terrain, blocks, step), step, terrain };
}

/** Counts layer by layer, because a large map has little memory to spare. */
function solidBlocks({ size, walls }: Terrain, blocks: Size, step: number): Uint8Array {
  const area = blocks[0] * blocks[1];
  const solid = new Uint8Array(area * blocks[2]);
  const free = new Uint32Array(area);
  let cell = 0;
  for (let z = 0; z < size[2]; z++) {
    for (let y = 0; y < size[1]; y++) {
      const row = Math.floor(y / step) * blocks[0];
      for (let x = 0; x < size[0]; x++, cell++) if (!walls.has(cell)) free[row + Math.floor(x / step)]!++;
    }
    if ((z + 1) % step !== 0 && z + 1 < size[2]) continue;
    const layer = Math.floor(z / step) * area;
    for (let block = 0; block < area; block++) solid[layer + block] = free[block]! * 2 >= step ** 3 ? 0 : 1;
    free.fill(0);
  }
  return solid;
}

/** The times of more blocks have memory only where there are some. */
const FLAT_BLOCKS_MAX = 2 ** 21;

/** Times of the blocks of a model, derived from those of the cells. */
export class BlockTimes {
  /** By block number. */
  readonly times: CellTimes;

  constructor(
    readonly model: BlockModel,
    readonly cellTimes: CellTimes,
  ) {
    this.times = model.step === 1 ? cellTimes : new CellTimes(model.walls.length, FLAT_BLOCKS_MAX);
    this.markAllChanged();
  }

  /** Updates the blocks of cells whose times have changed, and returns these blocks. */
  markChanged(cells: Uint32Array): Uint32Array {
    return this.model.step === 1 ? cells : cells.map((cell) => this.#note(cell));
  }

  /** Updates all blocks. */
  markAllChanged(): void {
    if (this.times === this.cellTimes) return;
    this.times.clear();
    this.cellTimes.forEach((cell) => this.#note(cell));
  }

  #note(cell: number): number {
    const { model } = this;
    const block = blockOf(cell, model.terrain.size, model.size, model.step);
    const time = this.cellTimes.get(cell);
    if (time < this.times.get(block) && !model.terrain.walls.has(cell)) this.times.set(block, time);
    return block;
  }
}

function blockOf(cell: number, size: Size, blocks: Size, step: number): number {
  const x = Math.floor((cell % size[0]) / step);
  const y = Math.floor((Math.floor(cell / size[0]) % size[1]) / step);
  const z = Math.floor(Math.floor(cell / (size[0] * size[1])) / step);
  return (z * blocks[1] + y) * blocks[0] + x;
}
