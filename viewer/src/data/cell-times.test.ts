import { expect, test } from "vitest";
import { CellSet } from "./cell-set.ts";
import { CellTimes, FLAT_CELLS_MAX } from "./cell-times.ts";
import { NEVER } from "./run.ts";

const LARGE = FLAT_CELLS_MAX + 1000;

test("times of a large map are those that were set", () => {
  const times = new CellTimes(LARGE);
  expect(times.flat).toBeNull();
  // More pages than a pool has, in no order, and both ends.
  const expected = new Map<number, number>();
  for (let i = 0; i < 6000; i++) expected.set((i * 7_919_993) % LARGE, i % 500);
  expected.set(0, 3).set(LARGE - 1, 4);
  for (const [cell, tick] of expected) times.set(cell, tick);
  expect([...expected].filter(([cell, tick]) => times.get(cell) !== tick)).toEqual([]);
  times.set(0, 2);
  expect([times.get(0), times.get(1), times.get(64)]).toEqual([
    2,
    expected.get(1) ?? NEVER,
    expected.get(64) ?? NEVER,
  ]);
  const visited: [number, number][] = [];
  times.forEach((cell, tick) => visited.push([cell, tick]));
  expected.set(0, 2);
  expect(visited).toEqual([...expected].sort(([a], [b]) => a - b));
});

test("a small map has one array", () => {
  const times = new CellTimes(100);
  times.set(99, 5);
  expect(times.flat![99]).toBe(5);
  expect(times.get(98)).toBe(NEVER);
});

test("a set of cells has those that were added", () => {
  const set = CellSet.of([0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1]);
  expect([0, 1, 8, 9, 10].map((cell) => set.has(cell))).toEqual([false, true, false, true, true]);
  expect([set.length, set.count]).toEqual([11, 3]);
  expect([...set.toBytes()]).toEqual([0, 1, 0, 0, 0, 0, 0, 0, 0, 1, 1]);
  expect(new CellSet(11, set.bytes)).toEqual(set);
});
