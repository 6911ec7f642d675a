/**
 * What the page and its reading worker say to each other.
 *
 * The worker reads and decodes; the page keeps what comes of it. All that has been read goes over in batches of plain typed arrays,
 * which are handed over without a copy.
 */

import type { Progress, Result, Setup, Terrain, Vec3 } from "./run.ts";

/** Where a scan was cast from. */
export interface ScanPose {
  readonly tick: number;
  readonly position: Vec3;
  readonly yawRad: number;
}

export type Request =
  | { readonly kind: "file"; readonly file: File }
  | { readonly kind: "url"; readonly url: string; readonly title: string }
  | { readonly kind: "live"; readonly title: string }
  | { readonly kind: "push"; readonly bytes: Uint8Array }
  | { readonly kind: "end" }
  | { readonly kind: "follow"; readonly request: number; readonly agent: number | null }
  | {
      readonly kind: "hits";
      readonly request: number;
      readonly agent: number;
      readonly untilTick: number;
      readonly scan: ScanPose | null;
    };

export type Reply =
  | { readonly kind: "opened"; readonly setup: Setup; readonly terrain: Terrain }
  | { readonly kind: "batch"; readonly batch: Batch }
  | { readonly kind: "unreadable"; readonly message: string }
  | { readonly kind: "belief"; readonly request: number; readonly knownTick: Uint32Array | null }
  | { readonly kind: "hits"; readonly request: number; readonly hits: ScanHits | null };

/** Points of a scan, in the frame of the body or of the map. */
export interface ScanHits {
  readonly timeS: number;
  readonly points: Float32Array;
  readonly isInBodyFrame: boolean;
}

/** Columns of a row of `Batch.poses`. */
export const POSE = { agent: 0, tick: 1, x: 2, y: 3, z: 4, yawRad: 5, columns: 6 } as const;

/** Columns of a row of `Batch.observations`: an observation. What was received is counted from the start on. */
export const OBSERVATION = {
  tick: 0,
  agent: 1,
  isIdle: 2,
  collision: 3,
  scanTick: 4,
  receivedMessages: 5,
  receivedBytes: 6,
  contacts: 7,
  columns: 8,
} as const;

/**
 * Columns of a row of `Batch.commands`: a command. `effective` is the number of the agent's command that holds from then on, or -1 if
 * its body has nothing to do; `info` is the number of the agent's text that holds, or -1.
 */
export const COMMAND = {
  tick: 0,
  agent: 1,
  kind: 2,
  pitchRad: 3,
  distanceM: 4,
  waypoints: 5,
  effective: 6,
  info: 7,
  sentMessages: 8,
  sentBytes: 9,
  columns: 10,
} as const;

/** What has been read since the last batch. */
export interface Batch {
  /** Everything up to here has been read. */
  readonly endTick: number;
  readonly isComplete: boolean;
  readonly problem: string | null;
  /** Tick, first cell and number of cells of each run that an agent has seen. */
  readonly seen: Uint32Array;
  /** Tick and cell, one after the other, whenever a body has come into another cell. */
  readonly covered: Uint32Array;
  readonly poses: Float64Array;
  readonly observations: Float64Array;
  /** Contacts of the observations, one after the other. */
  readonly contacts: Uint32Array;
  readonly commands: Float64Array;
  /** x, y, z of the way-points of the commands, one after the other. */
  readonly waypoints: Float64Array;
  /** Texts of the commands that have one: the agent, and what it says. */
  readonly infos: readonly (readonly [agent: number, info: string])[];
  readonly progress: readonly Progress[];
  readonly result: Result | null;
  /** Tick and cell, one after the other, that the agent followed has learned of; of the request by which it is followed. */
  readonly learned: { readonly request: number; readonly cells: Uint32Array } | null;
}

/** The arrays of a batch that may be handed over. */
export function transferablesOf(batch: Batch): ArrayBufferLike[] {
  const arrays = [
    batch.seen,
    batch.covered,
    batch.poses,
    batch.observations,
    batch.contacts,
    batch.commands,
    batch.waypoints,
  ];
  return [...arrays, ...(batch.learned ? [batch.learned.cells] : [])].map((array) => array.buffer);
}
