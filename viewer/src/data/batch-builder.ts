/**
 * Converts the messages of a run into the batches that the page receives.
 *
 * Invariant: consecutive batches hold everything exactly once, in the order in which it was read.
 * Cell numbers lie in the map and agents are members of the run; a message that violates this
 * throws a RangeError.
 */

import type { Runs } from "./cdr.ts";
import { Growable } from "./growable.ts";
import * as messages from "./messages.ts";
import { COMMAND, type Batch } from "./protocol.ts";
import type { MapChange, Progress, Result, Setup, Terrain, Vec3 } from "./run.ts";

/**
 * Maximum number of interpolation steps between two poses; longer gaps are divided evenly into this
 * many.
 */
const STEPS_MAX = 10_000;

/** State of an agent across messages. */
class Agent {
  pose: { tick: number; position: Vec3; yawRad: number } | null = null;
  cell = -1;
  /** Row of the observation whose fragments are arriving. */
  observation: number[] | null = null;
  contacts: number[] = [];
  stampTick = 0;
  isIdle = true;
  receivedMessages = 0;
  receivedBytes = 0;
  sentMessages = 0;
  sentBytes = 0;
  commands = 0;
  effective = -1;
  infos = 0;
}

export class BatchBuilder {
  readonly #terrain: Terrain;
  readonly #agents: Agent[];
  /** Tick of the last pose of each moving obstacle, or -1. */
  readonly #obstacleTicks: number[];
  readonly #durationTicks: number;
  readonly #areObservedPosesTrue: boolean;
  #endTick = 0;
  #isComplete = false;
  #problem: string | null = null;
  #hasChanges = true;
  #seen = new Growable(new Uint32Array(0));
  #covered = new Growable(new Uint32Array(0));
  #poses = new Growable(new Float64Array(0));
  #obstacles = new Growable(new Float64Array(0));
  #observations = new Growable(new Float64Array(0));
  #contacts = new Growable(new Uint32Array(0));
  #commands = new Growable(new Float64Array(0));
  #waypoints = new Growable(new Float64Array(0));
  #infos: [number, string][] = [];
  #mapChanges: MapChange[] = [];
  #progress: Progress[] = [];
  #lastProgress: Progress | undefined;
  #result: Result | null = null;

  constructor(
    terrain: Terrain,
    { agents, obstacles }: Pick<Setup, "agents" | "obstacles">,
    durationTicks: number,
    areObservedPosesTrue: boolean,
  ) {
    this.#terrain = terrain;
    this.#agents = Array.from({ length: agents }, () => new Agent());
    this.#obstacleTicks = obstacles.map(() => -1);
    this.#durationTicks = durationTicks;
    this.#areObservedPosesTrue = areObservedPosesTrue;
  }

  /** Marks everything before this tick as known, because a message of this tick was read. */
  reach(tick: number): void {
    const before = Math.max(0, tick - 1);
    if (before > this.#endTick) {
      this.#endTick = before;
      this.#hasChanges = true;
    }
  }

  finish(tick: number, problem: string | null): void {
    if (this.#isComplete) {
      return;
    }
    this.#agents.forEach((_, agent) => this.#closeObservation(agent));
    this.#endTick = Math.max(this.#endTick, tick);
    this.#isComplete = true;
    this.#problem = problem;
    this.#hasChanges = true;
  }

  observation(agent: number, observed: messages.Observation): void {
    this.#checkTick(observed.tick);
    const state = this.#agents[agent]!;
    if (observed.part === 0) {
      this.#closeObservation(agent);
      const scanTick = observed.scanTick;
      state.stampTick = Number.isNaN(scanTick) ? observed.tick : scanTick;
      state.isIdle = observed.isIdle;
      state.contacts = observed.contacts.filter((other) => other < messages.FIRST_RELAY);
      state.observation = [observed.tick, agent, observed.isIdle ? 1 : 0, observed.collision, scanTick];
      if (this.#areObservedPosesTrue) {
        this.#pose(agent, observed.tick, observed.position, observed.yawRad);
      }
    }
    for (const message of observed.received) {
      state.receivedMessages++;
      state.receivedBytes += message.data.length;
    }
    this.#see(state.stampTick, observed.seenFree);
    this.#see(state.stampTick, observed.seenWall);
    if (observed.part + 1 >= observed.parts) {
      this.#closeObservation(agent);
    }
  }

  command(agent: number, command: messages.Command): void {
    this.#checkTick(command.tick);
    const state = this.#agents[agent]!;
    if (command.kind !== messages.TaskKind.Keep) {
      state.effective = state.commands;
    } else if (state.isIdle) {
      state.effective = -1;
    }
    state.commands++;
    if (command.info !== "") {
      state.infos++;
      this.#infos.push([agent, command.info]);
    }
    for (const message of command.sent) {
      state.sentMessages++;
      state.sentBytes += message.data.length;
    }
    const row = new Array<number>(COMMAND.columns).fill(0);
    row[COMMAND.tick] = command.tick;
    row[COMMAND.agent] = agent;
    row[COMMAND.kind] = command.kind;
    row[COMMAND.pitchRad] = command.pitchRad;
    row[COMMAND.distanceM] = command.distanceM;
    row[COMMAND.waypoints] = command.path.length / 3;
    row[COMMAND.effective] = state.effective;
    row[COMMAND.info] = state.infos - 1;
    row[COMMAND.sentMessages] = state.sentMessages;
    row[COMMAND.sentBytes] = state.sentBytes;
    this.#commands.append(row);
    this.#waypoints.append(command.path);
    this.#hasChanges = true;
  }

  poses(tick: number, poses: readonly messages.Pose[]): void {
    this.#checkTick(tick);
    for (const { agent, position, yawRad } of poses) {
      if (agent < this.#agents.length) {
        this.#pose(agent, tick, position, yawRad);
      }
    }
  }

  obstacles(tick: number, poses: readonly messages.ObstaclePose[]): void {
    this.#checkTick(tick);
    for (const { obstacle, position } of poses) {
      const last = this.#obstacleTicks[obstacle];
      if (last === undefined || last >= tick) continue;
      this.#obstacleTicks[obstacle] = tick;
      this.#obstacles.append([obstacle, tick, ...position]);
      this.#hasChanges = true;
    }
  }

  /** A body that was placed elsewhere did not travel there, so the path is not interpolated. */
  intervention(change: messages.Intervention): void {
    this.#checkTick(change.tick);
    const state = this.#agents[change.agent];
    if (!state || !change.isPlaced) {
      return;
    }
    if (state.pose && state.pose.tick < change.tick) {
      this.#pose(change.agent, change.tick, state.pose.position, state.pose.yawRad);
    }
    state.pose = null;
    this.#pose(change.agent, change.tick, change.position, change.yawRad);
  }

  mapChange(change: MapChange): void {
    this.#checkTick(change.tick);
    const { low, high } = change;
    if (!high.every((last, axis) => low[axis]! <= last && last < this.#terrain.size[axis]!)) {
      throw new RangeError(`cells ${low.join(" ")} to ${high.join(" ")} are no box in the map`);
    }
    this.#mapChanges.push(change);
    this.#hasChanges = true;
  }

  progress(progress: Progress): void {
    this.#progress.push(progress);
    this.#lastProgress = progress;
    this.#hasChanges = true;
  }

  result(bytes: Uint8Array): void {
    this.#result = messages.result(bytes, this.#lastProgress);
    this.#hasChanges = true;
  }

  takeBatch(learned: Batch["learned"]): Batch | null {
    if (!this.#hasChanges && !learned?.cells.length) {
      return null;
    }
    const batch: Batch = {
      endTick: this.#endTick,
      isComplete: this.#isComplete,
      problem: this.#problem,
      seen: this.#seen.takeAll(),
      covered: this.#covered.takeAll(),
      poses: this.#poses.takeAll(),
      obstacles: this.#obstacles.takeAll(),
      observations: this.#observations.takeAll(),
      contacts: this.#contacts.takeAll(),
      commands: this.#commands.takeAll(),
      waypoints: this.#waypoints.takeAll(),
      infos: this.#infos,
      mapChanges: this.#mapChanges,
      progress: this.#progress,
      result: this.#result,
      learned,
    };
    this.#infos = [];
    this.#mapChanges = [];
    this.#progress = [];
    this.#hasChanges = false;
    return batch;
  }

  #checkTick(tick: number): void {
    if (tick > this.#durationTicks) {
      throw new RangeError(`the run has ${this.#durationTicks} ticks`);
    }
  }

  #closeObservation(agent: number): void {
    const state = this.#agents[agent]!;
    if (state.observation) {
      const row = [...state.observation, state.receivedMessages, state.receivedBytes, state.contacts.length];
      this.#observations.append(row);
      this.#contacts.append(state.contacts);
      state.observation = null;
      this.#hasChanges = true;
    }
  }

  #see(tick: number, runs: Runs): void {
    const cells = this.#terrain.walls.length;
    for (let run = 0; run < runs.start.length; run++) {
      const start = runs.start[run]!;
      const length = runs.length[run]!;
      if (start + length > cells) {
        throw new RangeError(`cells ${start} to ${start + length - 1} of a map of ${cells}`);
      }
      this.#seen.push(tick);
      this.#seen.push(start);
      this.#seen.push(length);
    }
    this.#hasChanges ||= runs.start.length > 0;
  }

  #pose(agent: number, tick: number, position: Vec3, yawRad: number): void {
    const state = this.#agents[agent]!;
    const last = state.pose;
    if (last && last.tick >= tick) {
      return;
    }
    this.#poses.append([agent, tick, ...position, yawRad]);
    this.#hasChanges = true;
    state.pose = { tick, position, yawRad };
    if (!last) {
      this.#enter(state, tick, position);
    } else if (last.position.some((at, axis) => at !== position[axis])) {
      const from = last.position;
      const ticks = tick - last.tick;
      const step = Math.max(1, Math.floor(ticks / STEPS_MAX));
      for (let between = last.tick + step; between <= tick; between += step) {
        const share = (between - last.tick) / ticks;
        const [x, y, z] = position;
        this.#enter(state, between, [
          from[0] + share * (x - from[0]),
          from[1] + share * (y - from[1]),
          from[2] + share * (z - from[2]),
        ]);
      }
    }
  }

  /** Records the cell of a position unless the body was already in it. */
  #enter(state: Agent, tick: number, position: Vec3): void {
    const { size, cellM } = this.#terrain;
    const [x, y, z] = [
      Math.floor(position[0] / cellM),
      Math.floor(position[1] / cellM),
      Math.floor(position[2] / cellM),
    ];
    if (!(x >= 0 && x < size[0] && y >= 0 && y < size[1] && z >= 0 && z < size[2])) {
      return;
    }
    const cell = (z * size[1] + y) * size[0] + x;
    if (cell !== state.cell) {
      state.cell = cell;
      this.#covered.push(tick);
      this.#covered.push(cell);
    }
  }
}
