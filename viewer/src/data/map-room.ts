/**
 * What `maes view` answers about the map that it shows: what a body reaches, where bodies start,
 * and the scenario with them. The rules are those of `maes map check`; the page has none of its own.
 */

import { CellSet } from "./cell-set.ts";
import type { Vec3 } from "./run.ts";

export interface RoomQuestion {
  /** Radius of the bodies, metres. */
  readonly radiusM: number;
  /** Where bodies should start, metres: in free cells. */
  readonly near: readonly Vec3[];
}

export interface RoomAnswer {
  /** Share of the free cells at whose places a body fits. */
  readonly fits: number;
  /** Share of the free cells that the bodies reach: from their starts, or in the largest part. */
  readonly reached: number;
  /** First cells and lengths of the runs of reached cells. */
  readonly runs: readonly [readonly number[], readonly number[]];
  /** Starts with room, metres. */
  readonly starts: readonly Vec3[];
  /** Why there are fewer starts than places. */
  readonly problem: string | null;
  /** The scenario with these starts, TOML; null without any. */
  readonly scenario: string | null;
}

/** Asks; rejects with the reason of the server. */
export type AskRoom = (question: RoomQuestion) => Promise<RoomAnswer>;

export function queryOf({ radiusM, near }: RoomQuestion): string {
  return [`radius_m=${radiusM}`, ...near.map((place) => `near=${place.join(",")}`)].join("&");
}

/** Questions to the server at an address. */
export function roomAt(address: string): AskRoom {
  return async (question) => {
    const response = await fetch(`${address}?${queryOf(question)}`);
    if (!response.ok) throw new Error(await response.text());
    return (await response.json()) as RoomAnswer;
  };
}

/** The cells of runs, of a map of `length` cells. */
export function cellsOf([firsts, lengths]: RoomAnswer["runs"], length: number): CellSet {
  const cells = new CellSet(length);
  firsts.forEach((first, run) => {
    for (let cell = first; cell < first + lengths[run]!; cell++) cells.add(cell);
  });
  return cells;
}
