/**
 * Messages between the page and its reader worker.
 *
 * The worker reads and decodes; the page keeps the result. Data go over in batches of plain typed
 * arrays, which are transferred without a copy.
 */

import type { MapChange, Progress, Result, Setup, Terrain, Vec3 } from "./run.ts";

/** Tick and pose of a scan. */
export interface ScanPose {
  readonly tick: number;
  readonly position: Vec3;
  readonly yawRad: number;
}

export type Request =
  | { readonly kind: "file"; readonly file: File }
  | { readonly kind: "url"; readonly url: string; readonly title: string }
  | { readonly kind: "live"; readonly title: string }
  /** Reads the rest of a file or an address, of which only the start was read so far. */
  | { readonly kind: "readOn" }
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
  | { readonly kind: "opened"; readonly setup: Setup; readonly terrain: SentTerrain }
  | { readonly kind: "batch"; readonly batch: Batch }
  | { readonly kind: "unreadable"; readonly message: string }
  /** Tick and cell of what the agent has learned so far; null: there is no such agent. */
  | { readonly kind: "belief"; readonly request: number; readonly learned: Uint32Array | null }
  | { readonly kind: "hits"; readonly request: number; readonly hits: ScanHits | null };

/** The true map, with the bytes of its set of walls. */
export type SentTerrain = Omit<Terrain, "walls"> & { readonly walls: Uint8Array<ArrayBuffer> };

/** Points of a scan, in the body frame or the `map` frame. */
export interface ScanHits {
  readonly timeS: number;
  readonly points: Float32Array;
  readonly isInBodyFrame: boolean;
}

/** Columns of a row of `Batch.poses`. */
export const POSE = { agent: 0, tick: 1, x: 2, y: 3, z: 4, yawRad: 5, columns: 6 } as const;

/** Columns of a row of `Batch.obstacles`. */
export const OBSTACLE = { obstacle: 0, tick: 1, x: 2, y: 3, z: 4, columns: 5 } as const;

/**
 * Columns of a row of `Batch.observations`. Received messages and bytes are totals since the start.
 */
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
 * Columns of a row of `Batch.commands`. `effective` is the index of the agent's command that is
 * executed from then on, or -1 if the body is idle; `info` is the index of the agent's current
 * status text, or -1. Sent messages and bytes are totals since the start.
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

/** What has been read since the previous batch. */
export interface Batch {
  /** Everything up to this tick has been read. */
  readonly endTick: number;
  readonly isComplete: boolean;
  readonly problem: string | null;
  /** Tick, first cell and number of cells of each run that an agent has seen. */
  readonly seen: Uint32Array;
  /** Tick and cell of each entry of a body into another cell. */
  readonly covered: Uint32Array;
  readonly poses: Float64Array;
  /** Centres of moving obstacles. */
  readonly obstacles: Float64Array;
  readonly observations: Float64Array;
  /** Contacts of the observations, concatenated. */
  readonly contacts: Uint32Array;
  readonly commands: Float64Array;
  /** x, y, z of the waypoints of the commands, concatenated. */
  readonly waypoints: Float64Array;
  /** Status texts of the commands that have one: the agent and its text. */
  readonly infos: readonly (readonly [agent: number, info: string])[];
  readonly mapChanges: readonly MapChange[];
  readonly progress: readonly Progress[];
  readonly result: Result | null;
  /**
   * Tick and cell of what the followed agent has learned; `request` is the one that started
   * following it.
   */
  readonly learned: { readonly request: number; readonly cells: Uint32Array } | null;
}

/** The buffers of a batch, to be transferred. */
export function transferablesOf(batch: Batch): ArrayBufferLike[] {
  const arrays = [
    batch.seen,
    batch.covered,
    batch.poses,
    batch.obstacles,
    batch.observations,
    batch.contacts,
    batch.commands,
    batch.waypoints,
  ];
  return [...arrays, ...(batch.learned ? [batch.learned.cells] : [])].map((array) => array.buffer);
}
