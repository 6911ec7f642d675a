/**
 * The history of one agent: its poses, its observations and its commands.
 *
 * All queries are binary searches in what has been read, so an answer does not depend on earlier
 * queries. Rows are those of `protocol.ts`.
 */

import { Growable, rowsUpTo } from "./growable.ts";
import { firstWall } from "./lidar.ts";
import { TaskKind } from "./messages.ts";
import { COMMAND, OBSERVATION, type ScanPose } from "./protocol.ts";
import { distance, PoseLog, type Pose } from "./pose-log.ts";
import { TICK_S, type AgentState, type Terrain, type Track, type Vec3 } from "./run.ts";
import { Path } from "./path.ts";

const TASKS = ["idle", "stop", "move", "turn", "path", "velocity"] as const;
const COLLISIONS = ["none", "wall", "floor", "ceiling"] as const;

/**
 * The tick that contains a time. Times are often a rounding error below the start of their tick.
 */
export function tickAt(timeS: number): number {
  return Math.floor(timeS / TICK_S + 1e-6);
}

export class AgentLog {
  readonly #id: number;
  readonly #terrain: Terrain;
  readonly #poses = new PoseLog();
  readonly #observations = new Growable(new Float64Array(0));
  readonly #contacts = new Growable(new Uint32Array(0));
  /** End of each observation's contacts in `#contacts`. */
  readonly #contactsEnd = new Growable(new Float64Array(0));
  readonly #commands = new Growable(new Float64Array(0));
  readonly #waypoints = new Growable(new Float64Array(0));
  /** End of each command's waypoints in `#waypoints`. */
  readonly #waypointsEnd = new Growable(new Float64Array(0));
  readonly #infos: string[] = [];
  /** Cache: the path of the command queried last, and the progress on it up to a pose. */
  #path: { readonly command: number; readonly path: Path; pose: number; progressM: number } | null = null;

  constructor(id: number, terrain: Terrain) {
    this.#id = id;
    this.#terrain = terrain;
  }

  get track(): Track {
    return this.#poses.track;
  }

  addPose(tick: number, x: number, y: number, z: number, yawRad: number): void {
    this.#poses.add(tick, x, y, z, yawRad);
  }

  addObservation(row: Float64Array, contacts: Uint32Array): void {
    this.#observations.append(row);
    this.#contacts.append(contacts);
    this.#contactsEnd.push(this.#contacts.count);
  }

  addCommand(row: Float64Array, waypoints: Float64Array): void {
    this.#commands.append(row);
    this.#waypoints.append(waypoints);
    this.#waypointsEnd.push(this.#waypoints.count);
  }

  addInfo(info: string): void {
    this.#infos.push(info);
  }

  /** Tick and pose of the last scan reported before a time; null if there was none. */
  scanAt(timeS: number): ScanPose | null {
    const observation = this.#observationAt(tickAt(timeS));
    const tick = observation < 0 ? NaN : this.#observation(observation, OBSERVATION.scanTick);
    if (Number.isNaN(tick)) {
      return null;
    }
    const { position, yawRad } = this.poseAt(tick * TICK_S);
    return { tick, position, yawRad };
  }

  stateAt(timeS: number): AgentState {
    const tick = tickAt(timeS);
    const pose = this.poseAt(timeS);
    const observation = this.#observationAt(tick);
    const command = rowsUpTo(this.#commands.array, this.#commandCount, COMMAND.columns, tick) - 1;
    const effective = this.#effective(observation, command);
    const kind = effective < 0 ? TaskKind.Keep : this.#command(effective, COMMAND.kind);
    const info = command < 0 ? -1 : this.#command(command, COMMAND.info);
    return {
      id: this.#id,
      position: pose.position,
      yawRad: pose.yawRad,
      speedMS: pose.speedMS,
      task: TASKS[kind] ?? "idle",
      path:
        kind === TaskKind.Path || kind === TaskKind.Move || kind === TaskKind.Velocity
          ? this.#remainingPath(effective, timeS, pose.position)
          : [],
      contacts: observation < 0 ? [] : this.#contactsOf(observation),
      info: this.#infos[info] ?? "",
      collision:
        (observation < 0 ? null : COLLISIONS[this.#observation(observation, OBSERVATION.collision)]) ??
        "none",
      sent: {
        messages: command < 0 ? 0 : this.#command(command, COMMAND.sentMessages),
        bytes: command < 0 ? 0 : this.#command(command, COMMAND.sentBytes),
      },
      received: {
        messages: observation < 0 ? 0 : this.#observation(observation, OBSERVATION.receivedMessages),
        bytes: observation < 0 ? 0 : this.#observation(observation, OBSERVATION.receivedBytes),
      },
      observedS: observation < 0 ? 0 : this.#observation(observation, OBSERVATION.tick) * TICK_S,
    };
  }

  poseAt(timeS: number): Pose {
    return this.#poses.at(timeS);
  }

  get #commandCount(): number {
    return this.#commands.count / COMMAND.columns;
  }

  #observation(row: number, column: number): number {
    return this.#observations.array[row * OBSERVATION.columns + column]!;
  }

  #command(row: number, column: number): number {
    return this.#commands.array[row * COMMAND.columns + column]!;
  }

  /** Row of the last observation up to a tick, or -1. */
  #observationAt(tick: number): number {
    return (
      rowsUpTo(
        this.#observations.array,
        this.#observations.count / OBSERVATION.columns,
        OBSERVATION.columns,
        tick,
      ) - 1
    );
  }

  /** Row of the command that the body executes, or -1. */
  #effective(observation: number, command: number): number {
    const effective = command < 0 ? -1 : this.#command(command, COMMAND.effective);
    if (effective >= 0 && observation >= 0 && this.#observation(observation, OBSERVATION.isIdle) === 1) {
      const isLater =
        this.#observation(observation, OBSERVATION.tick) > this.#command(effective, COMMAND.tick);
      return isLater ? -1 : effective;
    }
    return effective;
  }

  #contactsOf(observation: number): number[] {
    const start = observation === 0 ? 0 : this.#contactsEnd.array[observation - 1]!;
    return Array.from(this.#contacts.array.subarray(start, this.#contactsEnd.array[observation]!));
  }

  #remainingPath(command: number, timeS: number, position: Vec3): Vec3[] {
    const { timeS: times, count } = this.#poses.track;
    const startS = this.#command(command, COMMAND.tick) * TICK_S;
    const first = rowsUpTo(times, count, 1, startS);
    const until = rowsUpTo(times, count, 1, timeS);
    // Progress computed for an earlier time is continued; the result is that of a fresh start.
    if (this.#path?.command !== command || this.#path.pose > until) {
      const start = this.poseAt(startS);
      this.#path = { command, path: this.#pathOf(command, start), pose: first, progressM: 0 };
    }
    const memory = this.#path;
    for (; memory.pose < until; memory.pose++) {
      memory.progressM = this.#advanced(
        memory.path,
        memory.progressM,
        memory.pose,
        this.#poses.positionOf(memory.pose),
        startS,
      );
    }
    return memory.path.remaining(
      this.#advanced(memory.path, memory.progressM, memory.pose, position, startS),
    );
  }

  /** Progress at a position reached between the poses `pose - 1` and `pose`. */
  #advanced(path: Path, progressM: number, pose: number, position: Vec3, startS: number): number {
    const isFirst = pose === 0 || this.#poses.track.timeS[pose - 1]! < startS;
    const from = isFirst ? this.poseAt(startS).position : this.#poses.positionOf(pose - 1);
    return path.advanced(progressM, distance(from, position), position);
  }

  #pathOf(command: number, start: Pose): Path {
    // Those of a velocity are where it is to lead.
    if (this.#command(command, COMMAND.kind) !== TaskKind.Move) {
      const from = command === 0 ? 0 : this.#waypointsEnd.array[command - 1]!;
      return new Path(
        start.position,
        this.#waypoints.array.subarray(from, this.#waypointsEnd.array[command]!),
      );
    }
    const pitch = this.#command(command, COMMAND.pitchRad);
    const direction: Vec3 = [
      Math.cos(start.yawRad) * Math.cos(pitch),
      Math.sin(start.yawRad) * Math.cos(pitch),
      Math.sin(pitch),
    ];
    // A wall ends every motion, so the target of an unlimited one is at that wall.
    const wallM = firstWall(this.#terrain, start.position, direction, Infinity) ?? 0;
    const distanceM = Math.min(this.#command(command, COMMAND.distanceM), wallM);
    return new Path(
      start.position,
      direction.map((component, axis) => start.position[axis]! + component * distanceM),
    );
  }
}
