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
  times.clear();
  expect([...expected].filter(([cell]) => times.get(cell) !== NEVER)).toEqual([]);
});

test.each([1000, 0])("parts of the times can be copied (one array up to %i cells)", (flatMax) => {
  const times = new CellTimes(1000, flatMax);
  expect(times.flat === null).toBe(flatMax === 0);
  for (const cell of [0, 99, 100, 163, 164, 299, 300, 999]) times.set(cell, cell + 1);
  const part = (from: number, cells: number): [number, number][] => {
    const target = new Uint32Array(cells).fill(5);
    const isAny = times.copyTo(target, from);
    expect(isAny || target.every((tick) => tick === NEVER)).toBe(true);
    return [...target]
      .map((tick, at): [number, number] => [from + at, tick])
      .filter(([, tick]) => tick !== NEVER);
  };
  expect(part(100, 200)).toEqual([100, 163, 164, 299].map((cell) => [cell, cell + 1]));
  expect(part(980, 20)).toEqual([[999, 1000]]);
  expect(times.copyTo(new Uint32Array(100), 400)).toBe(flatMax !== 0);
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
