/**
 * The page's copy of a run, which grows while its recording is read.
 *
 * Queries are binary searches in what has been read; they may come in any order and always have the
 * same answer. Nothing is decoded here: what needs the recording again (beliefs, points of scans)
 * is requested from the reader.
 */

import { AgentLog, tickAt } from "./agent-log.ts";
import { PoseLog } from "./pose-log.ts";
import { CellTimes } from "./cell-times.ts";
import { MapHistory } from "./map-history.ts";
import { TickCounts } from "./tick-counts.ts";
import { Growable } from "./growable.ts";
import {
  COMMAND,
  OBSERVATION,
  OBSTACLE,
  POSE,
  type Batch,
  type ScanHits,
  type Reply,
  type Request,
} from "./protocol.ts";
import {
  NEVER,
  TICK_S,
  type AgentState,
  type Belief,
  type Hits,
  type RunUpdate,
  type Progress,
  type Result,
  type Run,
  type Setup,
  type Terrain,
  type Track,
  type Vec3,
} from "./run.ts";

/** Connection to the reader of the recording. */
export interface ReaderClient {
  send(request: Request): void;
  close(): void;
}

interface GrowingBelief extends Belief {
  revision: number;
}

export class RunModel implements Run {
  readonly id: string;
  readonly title: string;
  readonly setup: Setup;
  readonly terrain: Terrain;
  readonly #maps: MapHistory;
  readonly firstSeenTick: CellTimes;
  readonly coveredTick: CellTimes;
  readonly progress: Progress[] = [];
  result: Result | null = null;
  endS = 0;
  isComplete = false;
  problem: string | null = null;
  readonly #reader: ReaderClient;
  readonly #agents: AgentLog[];
  readonly #obstacles: readonly PoseLog[];
  readonly #seen = new TickCounts();
  readonly #covered = new TickCounts();
  readonly #listeners = new Set<(update: RunUpdate) => void>();
  readonly #hits = new Map<number, (hits: ScanHits | null) => void>();
  #requests = 0;
  #isClosed = false;
  #hasReadOn = false;
  #belief: GrowingBelief | null = null;
  /** The last request to follow an agent, pending or answered. */
  #following: {
    readonly request: number;
    readonly agent: number;
    readonly promise: Promise<Belief | null>;
    readonly resolve: (belief: Belief | null) => void;
  } | null = null;

  constructor(id: string, title: string, setup: Setup, terrain: Terrain, reader: ReaderClient) {
    this.id = id;
    this.title = title;
    this.setup = setup;
    this.terrain = terrain;
    this.#maps = new MapHistory(terrain);
    this.#reader = reader;
    const cells = terrain.walls.length;
    this.firstSeenTick = new CellTimes(cells);
    this.coveredTick = new CellTimes(cells);
    this.#agents = Array.from({ length: setup.agents }, (_, agent) => new AgentLog(agent, terrain));
    this.#obstacles = setup.obstacles.map(() => new PoseLog());
  }

  terrainAt(timeS: number): Terrain {
    return this.#maps.at(tickAt(timeS));
  }

  seenAt(timeS: number): number {
    return this.#seen.upTo(tickAt(timeS));
  }

  coveredAt(timeS: number): number {
    return this.#covered.upTo(tickAt(timeS));
  }

  agentAt(id: number, timeS: number): AgentState {
    return this.#agent(id).stateAt(timeS);
  }

  track(id: number): Track {
    return this.#agent(id).track;
  }

  obstacleAt(number: number, timeS: number): Vec3 | null {
    const poses = this.#obstacles[number];
    if (!poses) {
      throw new RangeError(`there is no obstacle ${number}, expected 0 to ${this.#obstacles.length - 1}`);
    }
    return poses.track.count === 0 ? null : poses.at(timeS).position;
  }

  #agent(id: number): AgentLog {
    const agent = this.#agents[id];
    if (!agent) {
      throw new RangeError(`there is no agent ${id}, expected 0 to ${this.#agents.length - 1}`);
    }
    return agent;
  }

  follow(id: number | null): Promise<Belief | null> {
    if (id !== null && this.#following?.agent === id) {
      return this.#following.promise;
    }
    if (id !== null) {
      this.#agent(id);
    }
    this.#following?.resolve(null);
    this.#following = null;
    this.#belief = null;
    const request = ++this.#requests;
    let resolve: (belief: Belief | null) => void = () => {};
    const promise = new Promise<Belief | null>((settle) => {
      resolve = settle;
    });
    if (id === null || this.#isClosed) {
      resolve(null);
    } else {
      this.#following = { request, agent: id, promise, resolve };
    }
    this.#reader.send({ kind: "follow", request, agent: id });
    return promise;
  }

  async hitsAt(id: number, timeS: number): Promise<Hits | null> {
    const agent = this.#agent(id);
    if (this.#isClosed) {
      return null;
    }
    const request = ++this.#requests;
    const found = await new Promise<ScanHits | null>((resolve) => {
      this.#hits.set(request, resolve);
      this.#reader.send({
        kind: "hits",
        request,
        agent: id,
        untilTick: tickAt(timeS),
        scan: agent.scanAt(timeS),
      });
    });
    if (!found?.isInBodyFrame) {
      return found && { timeS: found.timeS, positions: found.points, isCast: true };
    }
    const { position, yawRad } = agent.poseAt(found.timeS);
    const [cos, sin] = [Math.cos(yawRad), Math.sin(yawRad)];
    const positions = new Float32Array(found.points.length);
    for (let at = 0; at < positions.length; at += 3) {
      const [x, y, z] = [found.points[at]!, found.points[at + 1]!, found.points[at + 2]!];
      positions[at] = position[0] + cos * x - sin * y;
      positions[at + 1] = position[1] + sin * x + cos * y;
      positions[at + 2] = position[2] + z;
    }
    return { timeS: found.timeS, positions, isCast: false };
  }

  readOn(): void {
    if (this.#hasReadOn || this.#isClosed) return;
    this.#hasReadOn = true;
    this.#reader.send({ kind: "readOn" });
  }

  onUpdate(listener: (update: RunUpdate) => void): () => void {
    this.#listeners.add(listener);
    return () => this.#listeners.delete(listener);
  }

  close(): void {
    this.#listeners.clear();
    this.#endReading();
  }

  /** Ends reading after a failure; what has been read so far stays. */
  fail(problem: string): void {
    this.problem = problem;
    this.isComplete = true;
    this.#endReading();
    this.#notify({ fromS: this.endS, cells: new Uint32Array(0), hasEnded: false });
  }

  #notify(update: RunUpdate): void {
    this.#listeners.forEach((listener) => listener(update));
  }

  #endReading(): void {
    this.#isClosed = true;
    this.#reader.close();
    this.#following?.resolve(null);
    this.#following = null;
    this.#hits.forEach((resolve) => resolve(null));
    this.#hits.clear();
  }

  /** Applies a reply of the reader. */
  take(reply: Reply): void {
    switch (reply.kind) {
      case "batch":
        this.#takeBatch(reply.batch);
        break;
      case "belief":
        if (this.#following?.request === reply.request && reply.learned) {
          const knownTick = new CellTimes(this.terrain.walls.length);
          learn(knownTick, reply.learned);
          this.#belief = { agent: this.#following.agent, knownTick, revision: 0 };
          this.#following.resolve(this.#belief);
        }
        break;
      case "hits":
        this.#hits.get(reply.request)?.(reply.hits);
        this.#hits.delete(reply.request);
        break;
      case "opened":
      case "unreadable":
        break;
    }
  }

  #takeBatch(batch: Batch): void {
    const cells = new Growable(new Uint32Array(0));
    const cellsFromTick = Math.min(
      this.#takeSeen(batch.seen, cells),
      this.#takeCovered(batch.covered, cells),
    );
    const fromS = Math.min(
      this.endS,
      cellsFromTick * TICK_S,
      this.#takeAgents(batch),
      this.#takeObstacles(batch.obstacles),
    );
    if (this.#belief && batch.learned?.request === this.#following?.request) {
      const learned = batch.learned!.cells;
      learn(this.#belief.knownTick, learned);
      this.#belief.revision += learned.length > 0 ? 1 : 0;
    }
    this.#maps.add(batch.mapChanges);
    this.progress.push(...batch.progress);
    const hasEnded = this.result === null && batch.result !== null;
    this.result = batch.result;
    this.endS = batch.endTick * TICK_S;
    this.isComplete = batch.isComplete;
    this.problem = batch.problem;
    this.#notify({ fromS, cells: cells.takeAll(), hasEnded });
  }

  /** Returns the earliest tick of a cell that has changed. */
  #takeSeen(seen: Uint32Array, changed: Growable<Uint32Array>): number {
    const { walls } = this.terrain;
    let fromTick = Infinity;
    for (let at = 0; at < seen.length; at += 3) {
      const tick = seen[at]!;
      const start = seen[at + 1]!;
      const end = start + seen[at + 2]!;
      for (let cell = start; cell < end; cell++) {
        const before = this.firstSeenTick.get(cell);
        if (tick < before) {
          fromTick = Math.min(fromTick, tick);
          this.firstSeenTick.set(cell, tick);
          changed.push(cell);
          if (!walls.has(cell)) {
            move(this.#seen, before, tick);
          }
        }
      }
    }
    return fromTick;
  }

  #takeCovered(covered: Uint32Array, changed: Growable<Uint32Array>): number {
    let fromTick = Infinity;
    for (let at = 0; at < covered.length; at += 2) {
      const tick = covered[at]!;
      const cell = covered[at + 1]!;
      const before = this.coveredTick.get(cell);
      if (tick < before) {
        fromTick = Math.min(fromTick, tick);
        this.coveredTick.set(cell, tick);
        changed.push(cell);
        if (!this.terrain.walls.has(cell)) {
          move(this.#covered, before, tick);
        }
      }
    }
    return fromTick;
  }

  /** Returns the time before which the states of the agents are as they were. */
  #takeAgents(batch: Batch): number {
    const { poses, observations, contacts, commands, waypoints } = batch;
    let fromS = Infinity;
    for (let at = 0; at < poses.length; at += POSE.columns) {
      const [agent, tick, x, y, z, yawRad] = poses.subarray(at, at + POSE.columns);
      const log = this.#agents[agent!]!;
      fromS = Math.min(fromS, changedFromS(log.track));
      log.addPose(tick!, x!, y!, z!, yawRad!);
    }
    let used = 0;
    for (let at = 0; at < observations.length; at += OBSERVATION.columns) {
      const row = observations.subarray(at, at + OBSERVATION.columns);
      const end = used + row[OBSERVATION.contacts]!;
      fromS = Math.min(fromS, row[OBSERVATION.tick]! * TICK_S);
      this.#agents[row[OBSERVATION.agent]!]!.addObservation(row, contacts.subarray(used, end));
      used = end;
    }
    used = 0;
    for (let at = 0; at < commands.length; at += COMMAND.columns) {
      const row = commands.subarray(at, at + COMMAND.columns);
      const end = used + 3 * row[COMMAND.waypoints]!;
      fromS = Math.min(fromS, row[COMMAND.tick]! * TICK_S);
      this.#agents[row[COMMAND.agent]!]!.addCommand(row, waypoints.subarray(used, end));
      used = end;
    }
    for (const [agent, info] of batch.infos) {
      this.#agents[agent]!.addInfo(info);
    }
    return fromS;
  }

  /** Returns the time before which the obstacles are where they were. */
  #takeObstacles(rows: Float64Array): number {
    let fromS = Infinity;
    for (let at = 0; at < rows.length; at += OBSTACLE.columns) {
      const [obstacle, tick, x, y, z] = rows.subarray(at, at + OBSTACLE.columns);
      const log = this.#obstacles[obstacle!]!;
      fromS = Math.min(fromS, changedFromS(log.track));
      log.add(tick!, x!, y!, z!, 0);
    }
    return fromS;
  }
}

/** The time from which a further pose changes a track: poses after the last one are interpolated. */
function changedFromS({ count, timeS }: Track): number {
  return count === 0 ? 0 : timeS[count - 1]!;
}

/** Sets the ticks of cells; `learned` has the tick and the cell of each. */
function learn(times: CellTimes, learned: Uint32Array): void {
  for (let at = 0; at < learned.length; at += 2) times.set(learned[at + 1]!, learned[at]!);
}

/** Moves a cell from one tick to another. */
function move(counts: TickCounts, before: number, tick: number): void {
  if (before !== NEVER) {
    counts.add(before, -1);
  }
  counts.add(tick, 1);
}
