import { expect, test } from "vitest";
import { TickCounts } from "./tick-counts.ts";
import { Growable, rowsUpTo } from "./growable.ts";

test("elements stay, and are taken once", () => {
  const values = new Growable(new Uint32Array(0));
  values.push(7);
  values.append(Uint32Array.from({ length: 100 }, (_, at) => at));
  expect(values.count).toBe(101);
  expect(Array.from(values.array.subarray(0, 3))).toEqual([7, 0, 1]);
  expect(values.takeAll()).toHaveLength(101);
  expect(values.takeAll()).toHaveLength(0);
});

test("rows are counted up to a key", () => {
  const rows = [1, 0, 3, 0, 3, 0, 9, 0];
  expect([0, 1, 2, 3, 8, 9].map((limit) => rowsUpTo(rows, 4, 2, limit))).toEqual([0, 1, 1, 3, 3, 4]);
});

test("cells are counted by tick, in any order", () => {
  const ticks = [5, 9, 5, 2, 30, 9, 1, 30, 12];
  const counts = new TickCounts();
  ticks.forEach((tick, added) => {
    counts.add(tick, 1);
    for (let until = 0; until < 32; until++) {
      expect(counts.upTo(until)).toBe(ticks.slice(0, added + 1).filter((other) => other <= until).length);
    }
  });
  counts.add(9, -1);
  counts.add(3, 1);
  expect([2, 3, 8, 9, 99].map((tick) => counts.upTo(tick))).toEqual([2, 3, 5, 6, 9]);
});
