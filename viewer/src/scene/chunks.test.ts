import { describe, expect, it } from "vitest";
import { NEVER } from "../data/run.ts";
import { CellTimes } from "../data/cell-times.ts";
import { ChunkStaleness, Grid, type Size } from "./chunks.ts";
import { DIRECTIONS } from "./mesher.ts";
import { randomNumbers } from "./testing.ts";

const SIZE: Size = [13, 9, 7];
const EDGE = 4;
const CELLS = SIZE[0] * SIZE[1] * SIZE[2];

function place(cell: number): [number, number, number] {
  return [cell % SIZE[0], Math.floor(cell / SIZE[0]) % SIZE[1], Math.floor(cell / (SIZE[0] * SIZE[1]))];
}

function chunkOf(grid: Grid, [x, y, z]: readonly number[]): number {
  const [countX, countY] = grid.counts;
  return (Math.floor(z! / EDGE) * countY + Math.floor(y! / EDGE)) * countX + Math.floor(x! / EDGE);
}

describe("a grid of chunks", () => {
  const grid = new Grid(SIZE, EDGE);

  it("finds the chunks that a cell touches", () => {
    for (let cell = 0; cell < CELLS; cell++) {
      const at = place(cell);
      const expected = new Set([chunkOf(grid, at)]);
      for (const direction of DIRECTIONS) {
        const beside = at.map((value, axis) => value + direction[axis]!);
        if (beside.every((value, axis) => value >= 0 && value < SIZE[axis]!))
          expected.add(chunkOf(grid, beside));
      }
      const touched: number[] = [];
      grid.forTouched(cell, (chunk) => touched.push(chunk));
      expect(touched.sort()).toEqual([...expected].sort());
    }
  });

  it("fills a chunk and its border", () => {
    const next = randomNumbers(3);
    const isIn = Array.from({ length: CELLS }, () => next() < 0.3);
    const row = EDGE + 2;
    const padded = new Uint8Array(row ** 3).fill(9);
    for (let chunk = 0; chunk < grid.chunks; chunk++) {
      const origin = grid.origin(chunk);
      let isAny = false;
      const expected = Array.from({ length: row ** 3 }, (_, index) => {
        const inner = [index % row, Math.floor(index / row) % row, Math.floor(index / row ** 2)].map(
          (value) => value - 1,
        );
        const at = inner.map((value, axis) => value + origin[axis]!);
        if (!at.every((value, axis) => value >= 0 && value < SIZE[axis]!)) return 0;
        const value = isIn[(at[2]! * SIZE[1] + at[1]!) * SIZE[0] + at[0]!] ? 1 : 0;
        if (value === 1 && inner.every((part) => part >= 0 && part < EDGE)) isAny = true;
        return value;
      });
      expect(grid.fill(chunk, padded, (cell) => isIn[cell]!)).toBe(isAny);
      expect([...padded]).toEqual(expected);
    }
  });
});

describe("chunk staleness", () => {
  /** The set cells of a chunk and its border at a tick. */
  function look(grid: Grid, chunk: number, times: Uint32Array, tick: number): string {
    const seen: number[] = [];
    for (let cell = 0; cell < times.length; cell++) {
      if (times[cell]! <= tick) grid.forTouched(cell, (touched) => touched === chunk && seen.push(cell));
    }
    return seen.join();
  }

  it.each([1, 2, 3])("a chunk is stale exactly if it looks different (seed %i)", (seed) => {
    const next = randomNumbers(seed);
    const grid = new Grid(SIZE, EDGE);
    const cellTimes = new CellTimes(CELLS);
    const times = cellTimes.flat!;
    const drawCells = (count: number): number[] => {
      const cells = Array.from({ length: count }, () => Math.floor(next() * CELLS)).filter(
        (cell) => times[cell] === NEVER,
      );
      for (const cell of cells) times[cell] = Math.floor(next() * 45);
      return cells;
    };
    drawCells(12);
    const clocks = new ChunkStaleness(grid, cellTimes, () => true);
    const drawn: (string | undefined)[] = Array.from({ length: grid.chunks });
    const drawnFor: number[] = [];
    let kept = 0;
    for (let step = 0; step < 60; step++) {
      const tick = Math.floor(next() * 45);
      for (let chunk = 0; chunk < grid.chunks; chunk++) {
        const now = look(grid, chunk, times, tick);
        expect(clocks.isStale(chunk, tick)).toBe(drawn[chunk] !== now);
        if (drawn[chunk] === now) kept++;
        else if (next() < 0.3) continue;
        clocks.markBuilt(chunk, tick);
        drawn[chunk] = now;
        drawnFor[chunk] = tick;
      }
      const cells = drawCells(3);
      clocks.markChanged(cells);
      // A chunk that was built before a cell became known that it should show counts as not built.
      for (const cell of cells) {
        grid.forTouched(cell, (chunk) => {
          if (times[cell]! <= drawnFor[chunk]!) drawn[chunk] = undefined;
        });
      }
    }
    expect(kept).toBeGreaterThan(100);
  });

  it("ignores cells that do not count", () => {
    const grid = new Grid(SIZE, EDGE);
    const cellTimes = new CellTimes(CELLS);
    const times = cellTimes.flat!;
    const clocks = new ChunkStaleness(grid, cellTimes, (cell) => cell !== 5);
    clocks.markBuilt(1, 100);
    times[5] = 50;
    clocks.markChanged([5]);
    expect(clocks.isStale(1, 100)).toBe(false);
    expect(clocks.isStale(1, 10)).toBe(false);
  });
});
