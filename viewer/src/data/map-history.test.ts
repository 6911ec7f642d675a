import { expect, test } from "vitest";
import { CellSet } from "./cell-set.ts";
import { MapHistory } from "./map-history.ts";
import type { MapChange, Vec3 } from "./run.ts";

const SIZE: Vec3 = [4, 3, 2];

/** A map without walls. */
function history(): MapHistory {
  return new MapHistory({ size: SIZE, cellM: 1, walls: new CellSet(24), freeCells: 24 });
}

function change(tick: number, isWall: boolean, low: Vec3, high: Vec3): MapChange {
  return { tick, isWall, low, high };
}

function walls(maps: MapHistory, tick: number): number[] {
  const { walls } = maps.at(tick);
  return Array.from({ length: walls.length }, (_, cell) => cell).filter((cell) => walls.has(cell));
}

test("each time has the changes up to it", () => {
  const maps = history();
  maps.add([change(5, true, [1, 1, 0], [2, 2, 0]), change(9, false, [2, 0, 0], [2, 2, 1])]);
  maps.add([change(9, true, [3, 2, 1], [3, 2, 1])]);
  const shut = [5, 6, 9, 10];
  expect([0, 4, 5, 8].map((tick) => walls(maps, tick))).toEqual([[], [], shut, shut]);
  expect(walls(maps, 9)).toEqual([5, 9, 23]);
  expect(maps.at(100).freeCells).toBe(21);
});

test("the same map is the same object, in any order of times", () => {
  const maps = history();
  maps.add(Array.from({ length: 12 }, (_, at) => change(at + 1, at % 2 === 0, [0, 0, 0], [at % 4, 0, 0])));
  const byTick = Array.from({ length: 13 }, (_, tick) => walls(maps, tick));
  for (const tick of [12, 3, 7, 0, 11, 3, 1, 12]) expect(walls(maps, tick)).toEqual(byTick[tick]);
  expect(maps.at(0)).toBe(maps.start);
  expect(maps.at(7)).toBe(maps.at(7));
});
