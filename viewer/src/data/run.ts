/**
 * A run as the page knows it: what a recording, or a run under way, has told so far.
 *
 * Everything hangs on sim time, so that any moment can be looked at again and gives the same picture. Cells are numbered
 * (z * sizeY + y) * sizeX + x; positions are metres in the frame `map`, right-handed with z up; angles are radians; times are
 * seconds of sim time, or ticks of 0.02 s where a name says so.
 *
 * This file declares what the scene and the panels may ask. It reads nothing and draws nothing.
 */

/** What a tick is called that has not come: see `firstSeenTick`. */
export const NEVER = 0xffffffff;

/** Seconds of a tick. */
export const TICK_S = 0.02;

export type Vec3 = [number, number, number];

/** The true map. */
export interface Terrain {
  /** Cells along x, y, z. */
  readonly size: Vec3;
  /** Edge of a cell, metres. */
  readonly cellM: number;
  /** 1 is wall, 0 free; by number of the cell. */
  readonly walls: Uint8Array;
  /** How many cells are free. */
  readonly freeCells: number;
}

/** What is set before a run begins. */
export interface Setup {
  readonly agents: number;
  /** What each agent runs, by id. */
  readonly controllers: readonly string[];
  /** Radius of each agent's body, metres. */
  readonly radiusM: readonly number[];
  /** Decimal; null if the recorded scenario does not have it. */
  readonly seed: string | null;
  /** The run ends here at the latest. */
  readonly durationS: number;
  /** Rays of a scan (0: another pattern), and how far they go; Infinity: to the next wall. */
  readonly lidar: { readonly rays: number; readonly rangeM: number; readonly fovRad: number };
  readonly communicationRangeM: number;
  /** The scenario as it was written, TOML. */
  readonly scenarioToml: string;
}

/** What the server says every 10 s, and at the end; shares of the free cells, 0 to 1. */
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

/** How a run has ended. */
export interface Result extends Progress {
  readonly tick: number;
  readonly reason: string;
  readonly counters: ReadonlyMap<string, number>;
  /** Hexadecimal. */
  readonly digest: string;
}

/** An agent at a moment. */
export interface AgentState {
  readonly id: number;
  readonly position: Vec3;
  readonly yawRad: number;
  readonly speedMS: number;
  /** What its body does. */
  readonly task: "idle" | "stop" | "move" | "turn" | "path" | "velocity";
  /** Path-points that are left, the last one being the target; empty unless it moves along a way. */
  readonly path: readonly Vec3[];
  /** Agents it heard when it was asked last. */
  readonly contacts: readonly number[];
  /** The controller's own text. */
  readonly info: string;
  readonly collision: "none" | "wall" | "floor" | "ceiling";
  /** Parcels so far. */
  readonly sent: { readonly messages: number; readonly bytes: number };
  readonly received: { readonly messages: number; readonly bytes: number };
  /** When it was asked last. */
  readonly observedS: number;
}

/** Where an agent was, at ascending times. The arrays may be longer than what is known: see `count`. They may be replaced by longer ones as a run goes on. */
export interface Track {
  readonly count: number;
  readonly timeS: Float64Array;
  /** x, y, z of each time, one after the other. */
  readonly positions: Float32Array;
  readonly yawRad: Float32Array;
}

/** What one agent knows, from its own scans and from what it was told: tick in which it learned of each cell, free or wall. */
export interface Belief {
  readonly agent: number;
  readonly knownTick: Uint32Array;
  /** Grows whenever `knownTick` has changed. */
  readonly revision: number;
}

/** Points that a scan has hit. */
export interface Hits {
  readonly timeS: number;
  /** x, y, z of each hit, one after the other. */
  readonly positions: Float32Array;
  /** Whether they are what the run showed, or were cast by the page in the true map because the run tells nothing of scans. */
  readonly isCast: boolean;
}

/** What has become known since the last notice. */
export interface RunUpdate {
  /** Cells whose `firstSeenTick` or `coveredTick` was set, in no order. */
  readonly cells: Uint32Array;
  /** Whether the result has come. */
  readonly hasEnded: boolean;
}

export interface Run {
  /** Differs from that of every other run. */
  readonly id: string;
  /** The name of the file, or of the server. */
  readonly title: string;
  readonly setup: Setup;
  readonly terrain: Terrain;
  /** Everything up to here is known. */
  readonly endS: number;
  /** Whether nothing more will come. */
  readonly isComplete: boolean;
  /** What could not be read, and from where on, in words for people; null as long as all could. A change comes with news. */
  readonly problem: string | null;
  /** Tick in which the team learned of each cell, free or wall, or NEVER. */
  readonly firstSeenTick: Uint32Array;
  /** Tick in which a body first was in each cell, or NEVER. */
  readonly coveredTick: Uint32Array;
  /** How many free cells had been seen at `timeS`, and how many had been visited, of the cells above. */
  seenAt(timeS: number): number;
  coveredAt(timeS: number): number;
  readonly progress: readonly Progress[];
  readonly result: Result | null;
  agentAt(id: number, timeS: number): AgentState;
  track(id: number): Track;
  /** Begins to follow what an agent knows; `null` ends it. Resolves when all is known up to `endS`; it is kept up to date. */
  follow(id: number | null): Promise<Belief | null>;
  /** The hits of an agent's last scan before `timeS`. */
  hitsAt(id: number, timeS: number): Promise<Hits | null>;
  /** Tells of news until the function it returns is called. */
  onUpdate(listener: (news: RunUpdate) => void): () => void;
  /** Nobody will ask any more. */
  close(): void;
}

/** Something that cannot be read, in words for people: what, where, and what is expected. */
export class UnreadableError extends Error {
  override readonly name = "UnreadableError";
}
