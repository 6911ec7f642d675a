/**
 * A run as the page knows it: the part of a recording or of a live run that has been read so far.
 *
 * All state is a function of sim time, so any time can be shown again with the same image. Cells
 * are numbered (z * sizeY + y) * sizeX + x; positions are metres in the `map` frame, right-handed
 * with z up (REP 103); angles are radians; times are seconds of sim time, or ticks of 0.02 s where
 * a name says so.
 *
 * This file declares the interface of the scene and the panels; it neither reads nor draws.
 */

import type { CellSet } from "./cell-set.ts";
import type { CellTimes } from "./cell-times.ts";

/** Tick of an event that has not happened. */
export const NEVER = 0xffffffff;

/** Duration of a tick, seconds. */
export const TICK_S = 0.02;

export type Vec3 = [number, number, number];

/** The true map. */
export interface Terrain {
  /** Cells along x, y, z. */
  readonly size: Vec3;
  /** Cell edge, metres. */
  readonly cellM: number;
  /** The cells that are wall; the others are free. */
  readonly walls: CellSet;
  /** Number of free cells. */
  readonly freeCells: number;
}

/** A change of the map at the start of a tick: the cells of a box become wall or free. */
export interface MapChange {
  readonly tick: number;
  readonly isWall: boolean;
  /** The lowest and the highest cell of the box, which both belong to it. */
  readonly low: Vec3;
  readonly high: Vec3;
}

/** The shape of a moving obstacle; a box lies along the axes. */
export type ObstacleShape =
  { readonly kind: "sphere"; readonly radiusM: number } | { readonly kind: "box"; readonly sizeM: Vec3 };

/** The constants of a run. */
export interface Setup {
  readonly agents: number;
  /** Controller of each agent, by id. */
  readonly controllers: readonly string[];
  /** Radius of each agent's body, metres, by id. */
  readonly radiusM: readonly number[];
  /** Decimal; null if the recorded scenario does not have it. */
  readonly seed: string | null;
  /** Time limit of the run. */
  readonly durationS: number;
  /**
   * Rays of a scan (0: the shell pattern) and their range, metres; Infinity: up to the next wall.
   */
  readonly lidar: { readonly rays: number; readonly rangeM: number; readonly fovRad: number };
  readonly communicationRangeM: number;
  /** Moving obstacles, by number; null: the recorded scenario has no shape that is known here. */
  readonly obstacles: readonly (ObstacleShape | null)[];
  /** The scenario, TOML. */
  readonly scenarioToml: string;
}

/** Progress, published every 10 s and at the end; shares are of the free cells, 0 to 1. */
export interface Progress {
  readonly timeS: number;
  readonly explored: number;
  readonly covered: number;
  readonly exploredBy: readonly number[];
  readonly coveredBy: readonly number[];
  readonly believedBy: readonly number[];
  readonly distanceM: readonly number[];
  readonly pairsInContact: number;
  readonly messageBytes: number;
}

/** The result of a run. */
export interface Result extends Progress {
  readonly tick: number;
  readonly reason: string;
  readonly counters: ReadonlyMap<string, number>;
  /** Hexadecimal. */
  readonly digest: string;
}

/** The state of an agent at a time. */
export interface AgentState {
  readonly id: number;
  readonly position: Vec3;
  readonly yawRad: number;
  readonly speedMS: number;
  /** The task that the body executes. */
  readonly task: "idle" | "stop" | "move" | "turn" | "path" | "velocity";
  /** Waypoints ahead, the last one being the target; empty unless the agent follows a path. */
  readonly path: readonly Vec3[];
  /** Agents in radio contact at the last observation. */
  readonly contacts: readonly number[];
  /** Status text of the controller. */
  readonly info: string;
  readonly collision: "none" | "wall" | "floor" | "ceiling";
  /** Agent messages since the start. */
  readonly sent: { readonly messages: number; readonly bytes: number };
  readonly received: { readonly messages: number; readonly bytes: number };
  /** Time of the last observation. */
  readonly observedS: number;
}

/**
 * Poses of an agent at ascending times. The arrays have spare capacity behind `count` elements, and
 * are replaced by longer ones while a run grows.
 */
export interface Track {
  readonly count: number;
  readonly timeS: Float64Array;
  /** x, y, z of each pose, concatenated. */
  readonly positions: Float32Array;
  readonly yawRad: Float32Array;
}

/**
 * The belief map of one agent, from its own scans and from received messages: tick in which it
 * learned of each cell, free or wall.
 */
export interface Belief {
  readonly agent: number;
  readonly knownTick: CellTimes;
  /** Incremented with every change of `knownTick`. */
  readonly revision: number;
}

/** Points that a scan has hit. */
export interface Hits {
  readonly timeS: number;
  /** x, y, z of each hit, concatenated. */
  readonly positions: Float32Array;
  /** Whether the page has ray-cast them in the true map, because the run has no recorded points. */
  readonly isCast: boolean;
}

/** What became known since the previous update. */
export interface RunUpdate {
  /** States before this time are as they were. */
  readonly fromS: number;
  /** Cells whose `firstSeenTick` or `coveredTick` was set, in no order. */
  readonly cells: Uint32Array;
  /** Whether the result has arrived. */
  readonly hasEnded: boolean;
}

export interface Run {
  /** Unique among the runs of the page. */
  readonly id: string;
  /** Name of the file or of the server. */
  readonly title: string;
  readonly setup: Setup;
  /** The map at the start. */
  readonly terrain: Terrain;
  /** The map at `timeS`; the same object while it is the same map. */
  terrainAt(timeS: number): Terrain;
  /** Everything up to this time is known. */
  readonly endS: number;
  /** Whether reading has ended. */
  readonly isComplete: boolean;
  /**
   * What could not be read, for people; null if there is no problem. A change comes with an update.
   */
  readonly problem: string | null;
  /** Tick in which the team learned of each cell, free or wall, or NEVER. */
  readonly firstSeenTick: CellTimes;
  /** Tick in which a body first entered each cell, or NEVER. */
  readonly coveredTick: CellTimes;
  /** Number of free cells that had been seen, or covered, at `timeS`. */
  seenAt(timeS: number): number;
  coveredAt(timeS: number): number;
  readonly progress: readonly Progress[];
  readonly result: Result | null;
  agentAt(id: number, timeS: number): AgentState;
  track(id: number): Track;
  /** The centre of a moving obstacle; null: the recording has none. */
  obstacleAt(number: number, timeS: number): Vec3 | null;
  /**
   * Begins to follow an agent's belief; `null` ends it. Resolves when the belief is known up to
   * `endS`; it is kept up to date afterwards.
   */
  follow(id: number | null): Promise<Belief | null>;
  /** The hits of an agent's last scan before `timeS`. */
  hitsAt(id: number, timeS: number): Promise<Hits | null>;
  /** Lets the rest of a recording be read, of which only the start was read so far. */
  readOn(): void;
  /** Adds a listener; the returned function removes it. */
  onUpdate(listener: (update: RunUpdate) => void): () => void;
  /** Releases the reader; no query is allowed afterwards. */
  close(): void;
}

/** Input that cannot be read; the message says what, where, and what was expected. */
export class UnreadableError extends Error {
  override readonly name = "UnreadableError";
}
