/**
 * Collects what the messages of a run tell, in the form in which it goes to the page.
 *
 * Invariant: batches one after the other hold everything once, in the order in which it was read. Cells lie in the map, and agents
 * take part; a message that says otherwise throws a RangeError.
 */

import type { Runs } from "./cdr.ts";
import { Growable } from "./growable.ts";
import * as messages from "./messages.ts";
import { ANSWERED, type Batch } from "./protocol.ts";
import type { Progress, Result, Terrain, Vec3 } from "./run.ts";

/** Ticks between two poses that are looked at one by one; of more than this, so many spread evenly. */
const STEPS_MAX = 10_000;

/** What is remembered of an agent from message to message. */
class Agent {
  pose: { tick: number; position: Vec3; yawRad: number } | null = null;
  cell = -1;
  /** The observation whose parts are coming in, as a row. */
  asked: number[] | null = null;
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

export class Recorder {
  readonly #terrain: Terrain;
  readonly #agents: Agent[];
  readonly #durationTicks: number;
  readonly #areObservedPosesTrue: boolean;
  #endTick = 0;
  #isComplete = false;
  #problem: string | null = null;
  #hasNews = true;
  #seen = new Growable(new Uint32Array(0));
  #entered = new Growable(new Uint32Array(0));
  #poses = new Growable(new Float64Array(0));
  #asked = new Growable(new Float64Array(0));
  #contacts = new Growable(new Uint32Array(0));
  #answered = new Growable(new Float64Array(0));
  #points = new Growable(new Float64Array(0));
  #infos: [number, string][] = [];
  #progress: Progress[] = [];
  #lastProgress: Progress | undefined;
  #result: Result | null = null;

  constructor(terrain: Terrain, agents: number, durationTicks: number, areObservedPosesTrue: boolean) {
    this.#terrain = terrain;
    this.#agents = Array.from({ length: agents }, () => new Agent());
    this.#durationTicks = durationTicks;
    this.#areObservedPosesTrue = areObservedPosesTrue;
  }

  /** A message of this tick was read: everything before it is known. */
  reach(tick: number): void {
    const before = Math.max(0, tick - 1);
    if (before > this.#endTick) {
      this.#endTick = before;
      this.#hasNews = true;
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
    this.#hasNews = true;
  }

  observation(agent: number, told: messages.Observation): void {
    this.#checkTick(told.tick);
    const state = this.#agents[agent]!;
    if (told.part === 0) {
      this.#closeObservation(agent);
      const scanTick = told.scanTick;
      state.stampTick = Number.isNaN(scanTick) ? told.tick : scanTick;
      state.isIdle = told.isIdle;
      state.contacts = told.contacts.filter((other) => other < messages.FIRST_RELAY);
      state.asked = [told.tick, agent, told.isIdle ? 1 : 0, told.collision, scanTick];
      if (this.#areObservedPosesTrue) {
        this.#pose(agent, told.tick, told.position, told.yawRad);
      }
    }
    for (const parcel of told.parcels) {
      state.receivedMessages++;
      state.receivedBytes += parcel.data.length;
    }
    this.#see(state.stampTick, told.seenFree);
    this.#see(state.stampTick, told.seenWall);
    if (told.part + 1 >= told.parts) {
      this.#closeObservation(agent);
    }
  }

  command(agent: number, answer: messages.Command): void {
    this.#checkTick(answer.tick);
    const state = this.#agents[agent]!;
    if (answer.kind !== messages.TaskKind.Keep) {
      state.effective = state.commands;
    } else if (state.isIdle) {
      state.effective = -1;
    }
    state.commands++;
    if (answer.info !== "") {
      state.infos++;
      this.#infos.push([agent, answer.info]);
    }
    for (const parcel of answer.parcels) {
      state.sentMessages++;
      state.sentBytes += parcel.data.length;
    }
    const row = new Array<number>(ANSWERED.columns).fill(0);
    row[ANSWERED.tick] = answer.tick;
    row[ANSWERED.agent] = agent;
    row[ANSWERED.kind] = answer.kind;
    row[ANSWERED.pitchRad] = answer.pitchRad;
    row[ANSWERED.distanceM] = answer.distanceM;
    row[ANSWERED.points] = answer.path.length / 3;
    row[ANSWERED.effective] = state.effective;
    row[ANSWERED.info] = state.infos - 1;
    row[ANSWERED.sentMessages] = state.sentMessages;
    row[ANSWERED.sentBytes] = state.sentBytes;
    this.#answered.append(row);
    this.#points.append(answer.path);
    this.#hasNews = true;
  }

  poses(tick: number, poses: readonly messages.Pose[]): void {
    this.#checkTick(tick);
    for (const { agent, position, yawRad } of poses) {
      if (agent < this.#agents.length) {
        this.#pose(agent, tick, position, yawRad);
      }
    }
  }

  /** A body that was put elsewhere has not gone there. */
  intervention(done: messages.Placement): void {
    this.#checkTick(done.tick);
    const state = this.#agents[done.agent];
    if (!state || !done.isPlaced) {
      return;
    }
    if (state.pose && state.pose.tick < done.tick) {
      this.#pose(done.agent, done.tick, state.pose.position, state.pose.yawRad);
    }
    state.pose = null;
    this.#pose(done.agent, done.tick, done.position, done.yawRad);
  }

  progress(told: Progress): void {
    this.#progress.push(told);
    this.#lastProgress = told;
    this.#hasNews = true;
  }

  result(bytes: Uint8Array): void {
    this.#result = messages.result(bytes, this.#lastProgress);
    this.#hasNews = true;
  }

  takeBatch(learnt: Batch["learnt"]): Batch | null {
    if (!this.#hasNews && !learnt?.cells.length) {
      return null;
    }
    const batch: Batch = {
      endTick: this.#endTick,
      isComplete: this.#isComplete,
      problem: this.#problem,
      seen: this.#seen.takeAll(),
      entered: this.#entered.takeAll(),
      poses: this.#poses.takeAll(),
      asked: this.#asked.takeAll(),
      contacts: this.#contacts.takeAll(),
      answered: this.#answered.takeAll(),
      points: this.#points.takeAll(),
      infos: this.#infos,
      progress: this.#progress,
      result: this.#result,
      learnt,
    };
    this.#infos = [];
    this.#progress = [];
    this.#hasNews = false;
    return batch;
  }

  #checkTick(tick: number): void {
    if (tick > this.#durationTicks) {
      throw new RangeError(`the run has ${this.#durationTicks} ticks`);
    }
  }

  #closeObservation(agent: number): void {
    const state = this.#agents[agent]!;
    if (state.asked) {
      const row = [...state.asked, state.receivedMessages, state.receivedBytes, state.contacts.length];
      this.#asked.append(row);
      this.#contacts.append(state.contacts);
      state.asked = null;
      this.#hasNews = true;
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
    this.#hasNews ||= runs.start.length > 0;
  }

  #pose(agent: number, tick: number, position: Vec3, yawRad: number): void {
    const state = this.#agents[agent]!;
    const last = state.pose;
    if (last && last.tick >= tick) {
      return;
    }
    this.#poses.append([agent, tick, ...position, yawRad]);
    this.#hasNews = true;
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

  /** Notes the cell of a place, if the body has not been in it just before. */
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
      this.#entered.push(tick);
      this.#entered.push(cell);
    }
  }
}
