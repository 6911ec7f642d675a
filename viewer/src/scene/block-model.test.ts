import { describe, expect, it } from "vitest";
import { CellSet } from "../data/cell-set.ts";
import { CellTimes } from "../data/cell-times.ts";
import { NEVER, type Terrain } from "../data/run.ts";
import { BlockTimes, blockModelOf } from "./block-model.ts";

/** 5 x 3 x 2 cells: free in the column x = 0, and at (4, 2). */
function terrain(): Terrain {
  const walls = new Uint8Array(30).fill(1);
  for (const cell of [0, 5, 10, 15, 20, 25, 14, 29]) walls[cell] = 0;
  return { size: [5, 3, 2], cellM: 0.5, walls: CellSet.of(walls), freeCells: 8 };
}

describe("the block model", () => {
  it("is the map itself if that is small enough", () => {
    const map = terrain();
    const model = blockModelOf(map, 30, 5);
    expect(model.step).toBe(1);
    expect(model.walls).toEqual(map.walls.toBytes());
    const times = new CellTimes(30);
    const blocks = new BlockTimes(model, times);
    const cells = Uint32Array.of(3, 4);
    expect(blocks.times).toBe(times);
    expect(blocks.markChanged(cells)).toBe(cells);
  });

  it("has blocks that are free if half of their cells are", () => {
    const model = blockModelOf(terrain(), 29, 5);
    expect(model.size).toEqual([3, 2, 1]);
    expect(model.cellM).toBe(1);
    expect([...model.walls]).toEqual([0, 1, 1, 1, 1, 1]);
  });

  it("has the earliest times of the free cells of each block", () => {
    const times = new CellTimes(30);
    times.set(0, 9);
    times.set(5, 4);
    times.set(1, 2);
    const blocks = new BlockTimes(blockModelOf(terrain(), 30, 4), times);
    expect([...blocks.times.flat!]).toEqual([4, NEVER, NEVER, NEVER, NEVER, NEVER]);
    times.set(29, 7);
    expect([...blocks.markChanged(Uint32Array.of(29, 6))]).toEqual([5, 0]);
    expect([...blocks.times.flat!]).toEqual([4, NEVER, NEVER, NEVER, NEVER, 7]);
    times.flat!.fill(NEVER);
    blocks.markAllChanged();
    expect(new Set(blocks.times.flat)).toEqual(new Set([NEVER]));
  });
});
