/**
 * The map as it is drawn: its own cells, or, if there are too many of them, blocks of cells.
 *
 * A block is free if at least half of its cells are; its time is the earliest of those of its free cells.
 */

import { NEVER, type Terrain } from "../data/run.ts";
import type { Size } from "./chunks.ts";

/** Terrain of blocks. */
export interface Model {
  readonly size: Size;
  /** Edge of a block, metres. */
  readonly cellM: number;
  /** 1 is wall, 0 free; by number of the block. */
  readonly walls: Uint8Array;
  /** Cells along the edge of a block; 1: the arrays are the map's own. */
  readonly step: number;
  readonly terrain: Terrain;
}

/** The model of a map with at most so many blocks in all, and along an axis. */
export function modelOf(terrain: Terrain, blocksMax: number, edgeMax: number): Model {
  const { size, cellM, walls } = terrain;
  let step = 1;
  let blocks: Size = size;
  while (blocks[0] * blocks[1] * blocks[2] > blocksMax || Math.max(...blocks) > edgeMax) {
    step *= 2;
    blocks = [Math.ceil(size[0] / step), Math.ceil(size[1] / step), Math.ceil(size[2] / step)];
  }
  if (step === 1) return { size, cellM, walls, step, terrain };
  const free = new Uint16Array(blocks[0] * blocks[1] * blocks[2]);
  for (let cell = 0; cell < walls.length; cell++) {
    if (walls[cell] === 0) free[blockOf(cell, size, blocks, step)]!++;
  }
  const solid = Uint8Array.from(free, (count) => (count * 2 >= step ** 3 ? 0 : 1));
  return { size: blocks, cellM: cellM * step, walls: solid, step, terrain };
}

/** Times of a model's blocks, kept up to those of the cells. */
export class BlockTimes {
  /** By number of the block. */
  readonly times: Uint32Array;

  constructor(
    readonly model: Model,
    readonly cellTimes: Uint32Array,
  ) {
    this.times = model.step === 1 ? cellTimes : new Uint32Array(model.walls.length);
    this.learnAll();
  }

  /** The times of these cells have become known. Returns the blocks they lie in. */
  learn(cells: Uint32Array): Uint32Array {
    return this.model.step === 1 ? cells : cells.map((cell) => this.#note(cell));
  }

  /** Any time may have changed. */
  learnAll(): void {
    if (this.model.step === 1) return;
    this.times.fill(NEVER);
    for (let cell = 0; cell < this.cellTimes.length; cell++) this.#note(cell);
  }

  #note(cell: number): number {
    const { model } = this;
    const block = blockOf(cell, model.terrain.size, model.size, model.step);
    const time = this.cellTimes[cell]!;
    if (time < this.times[block]! && model.terrain.walls[cell] === 0) this.times[block] = time;
    return block;
  }
}

function blockOf(cell: number, size: Size, blocks: Size, step: number): number {
  const x = Math.floor((cell % size[0]) / step);
  const y = Math.floor((Math.floor(cell / size[0]) % size[1]) / step);
  const z = Math.floor(Math.floor(cell / (size[0] * size[1])) / step);
  return (z * blocks[1] + y) * blocks[0] + x;
}
