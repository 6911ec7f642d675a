/**
 * What is known of one agent: where it was, what it was told and what it answered.
 *
 * Everything is found by binary search in what has been read; nothing depends on what was asked before. Rows are those of
 * `protocol.ts`.
 */

import { Growable, rowsUpTo } from "./growable.ts";
import { firstWall } from "./lidar.ts";
import { TaskKind } from "./messages.ts";
import { ANSWERED, ASKED, type ScanPose } from "./protocol.ts";
import { TICK_S, type AgentState, type Terrain, type Track, type Vec3 } from "./run.ts";
import { Way } from "./way.ts";

const TASKS = ["idle", "stop", "move", "turn", "path", "velocity"] as const;
const COLLISIONS = ["none", "wall", "floor", "ceiling"] as const;

/** The tick that has begun at a time; times are often a rounding error before their tick. */
export function tickAt(timeS: number): number {
  return Math.floor(timeS / TICK_S + 1e-6);
}

class GrowingTrack implements Track {
  readonly times = new Growable(new Float64Array(0));
  readonly places = new Growable(new Float32Array(0));
  readonly yaws = new Growable(new Float32Array(0));

  get count(): number {
    return this.times.count;
  }
  get timeS(): Float64Array {
    return this.times.array;
  }
  get positions(): Float32Array {
    return this.places.array;
  }
  get yawRad(): Float32Array {
    return this.yaws.array;
  }
}

interface Pose {
  readonly position: Vec3;
  readonly yawRad: number;
  readonly speedMS: number;
}

export class AgentLog {
  readonly #id: number;
  readonly #terrain: Terrain;
  readonly #track = new GrowingTrack();
  readonly #asked = new Growable(new Float64Array(0));
  readonly #contacts = new Growable(new Uint32Array(0));
  /** Where the contacts of each observation end. */
  readonly #contactsEnd = new Growable(new Float64Array(0));
  readonly #answered = new Growable(new Float64Array(0));
  readonly #points = new Growable(new Float64Array(0));
  /** Where the way-points of each command end. */
  readonly #pointsEnd = new Growable(new Float64Array(0));
  readonly #infos: string[] = [];
  /** The way of the command that was looked at last, and how far the body had come on it up to a pose. */
  #way: { readonly command: number; readonly way: Way; pose: number; progressM: number } | null = null;

  constructor(id: number, terrain: Terrain) {
    this.#id = id;
    this.#terrain = terrain;
  }

  get track(): Track {
    return this.#track;
  }

  addPose(tick: number, x: number, y: number, z: number, yawRad: number): void {
    this.#track.times.push(tick * TICK_S);
    this.#track.places.append([x, y, z]);
    this.#track.yaws.push(yawRad);
  }

  addAsked(row: Float64Array, contacts: Uint32Array): void {
    this.#asked.append(row);
    this.#contacts.append(contacts);
    this.#contactsEnd.push(this.#contacts.count);
  }

  addAnswered(row: Float64Array, points: Float64Array): void {
    this.#answered.append(row);
    this.#points.append(points);
    this.#pointsEnd.push(this.#points.count);
  }

  addInfo(info: string): void {
    this.#infos.push(info);
  }

  /** Of when the last scan before a time was that it has told of, and from where; null if there was none. */
  scanAt(timeS: number): ScanPose | null {
    const asked = this.#askedAt(tickAt(timeS));
    const tick = asked < 0 ? NaN : this.#ask(asked, ASKED.scanTick);
    if (Number.isNaN(tick)) {
      return null;
    }
    const { position, yawRad } = this.poseAt(tick * TICK_S);
    return { tick, position, yawRad };
  }

  stateAt(timeS: number): AgentState {
    const tick = tickAt(timeS);
    const pose = this.poseAt(timeS);
    const asked = this.#askedAt(tick);
    const answered = rowsUpTo(this.#answered.array, this.#answers, ANSWERED.columns, tick) - 1;
    const effective = this.#effective(asked, answered);
    const kind = effective < 0 ? TaskKind.Keep : this.#answer(effective, ANSWERED.kind);
    const info = answered < 0 ? -1 : this.#answer(answered, ANSWERED.info);
    return {
      id: this.#id,
      position: pose.position,
      yawRad: pose.yawRad,
      speedMS: pose.speedMS,
      task: TASKS[kind] ?? "idle",
      path:
        kind === TaskKind.Path || kind === TaskKind.Move
          ? this.#wayLeft(effective, timeS, pose.position)
          : [],
      contacts: asked < 0 ? [] : this.#contactsOf(asked),
      info: this.#infos[info] ?? "",
      collision: (asked < 0 ? null : COLLISIONS[this.#ask(asked, ASKED.collision)]) ?? "none",
      sent: {
        messages: answered < 0 ? 0 : this.#answer(answered, ANSWERED.sentMessages),
        bytes: answered < 0 ? 0 : this.#answer(answered, ANSWERED.sentBytes),
      },
      received: {
        messages: asked < 0 ? 0 : this.#ask(asked, ASKED.receivedMessages),
        bytes: asked < 0 ? 0 : this.#ask(asked, ASKED.receivedBytes),
      },
      askedS: asked < 0 ? 0 : this.#ask(asked, ASKED.tick) * TICK_S,
    };
  }

  /** Straight between the poses that are known, the heading the shorter way round; before and after them as at their ends. */
  poseAt(timeS: number): Pose {
    const { count, timeS: times, positions, yawRad: yaws } = this.#track;
    if (count === 0) {
      return { position: [0, 0, 0], yawRad: 0, speedMS: 0 };
    }
    const place = (pose: number): Vec3 => [
      positions[3 * pose]!,
      positions[3 * pose + 1]!,
      positions[3 * pose + 2]!,
    ];
    const after = rowsUpTo(times, count, 1, timeS);
    if (after === 0 || count === 1) {
      return { position: place(0), yawRad: yaws[0]!, speedMS: 0 };
    }
    const b = Math.min(after, count - 1);
    const a = b - 1;
    const spanS = times[b]! - times[a]!;
    const share = spanS > 0 ? Math.min(1, (timeS - times[a]!) / spanS) : 1;
    const [from, to] = [place(a), place(b)];
    const turn = yaws[b]! - yaws[a]!;
    const yaw = yaws[a]! + share * (turn - 2 * Math.PI * Math.round(turn / (2 * Math.PI)));
    return {
      position: [
        from[0] + share * (to[0] - from[0]),
        from[1] + share * (to[1] - from[1]),
        from[2] + share * (to[2] - from[2]),
      ],
      yawRad: yaw - 2 * Math.PI * Math.round(yaw / (2 * Math.PI)),
      speedMS: spanS > 0 ? distance(from, to) / spanS : 0,
    };
  }

  get #answers(): number {
    return this.#answered.count / ANSWERED.columns;
  }

  #ask(row: number, column: number): number {
    return this.#asked.array[row * ASKED.columns + column]!;
  }

  #answer(row: number, column: number): number {
    return this.#answered.array[row * ANSWERED.columns + column]!;
  }

  /** The last observation up to a tick, or -1. */
  #askedAt(tick: number): number {
    return rowsUpTo(this.#asked.array, this.#asked.count / ASKED.columns, ASKED.columns, tick) - 1;
  }

  /** The command that the body carries out, or -1. */
  #effective(asked: number, answered: number): number {
    const effective = answered < 0 ? -1 : this.#answer(answered, ANSWERED.effective);
    if (effective >= 0 && asked >= 0 && this.#ask(asked, ASKED.isIdle) === 1) {
      const isLater = this.#ask(asked, ASKED.tick) > this.#answer(effective, ANSWERED.tick);
      return isLater ? -1 : effective;
    }
    return effective;
  }

  #contactsOf(asked: number): number[] {
    const start = asked === 0 ? 0 : this.#contactsEnd.array[asked - 1]!;
    return Array.from(this.#contacts.array.subarray(start, this.#contactsEnd.array[asked]!));
  }

  #wayLeft(command: number, timeS: number, position: Vec3): Vec3[] {
    const { timeS: times, count } = this.#track;
    const startS = this.#answer(command, ANSWERED.tick) * TICK_S;
    const first = rowsUpTo(times, count, 1, startS);
    const until = rowsUpTo(times, count, 1, timeS);
    // What was worked out for an earlier time is gone on from, with the same outcome as from the start.
    if (this.#way?.command !== command || this.#way.pose > until) {
      const start = this.poseAt(startS);
      this.#way = { command, way: this.#wayOf(command, start), pose: first, progressM: 0 };
    }
    const memory = this.#way;
    for (; memory.pose < until; memory.pose++) {
      memory.progressM = this.#advanced(
        memory.way,
        memory.progressM,
        memory.pose,
        this.#place(memory.pose),
        startS,
      );
    }
    return memory.way.left(this.#advanced(memory.way, memory.progressM, memory.pose, position, startS));
  }

  #place(pose: number): Vec3 {
    const { positions } = this.#track;
    return [positions[3 * pose]!, positions[3 * pose + 1]!, positions[3 * pose + 2]!];
  }

  /** Progress at a place that was reached behind the pose before `pose`. */
  #advanced(way: Way, progressM: number, pose: number, place: Vec3, startS: number): number {
    const isFirst = pose === 0 || this.#track.timeS[pose - 1]! < startS;
    const from = isFirst ? this.poseAt(startS).position : this.#place(pose - 1);
    return way.advanced(progressM, distance(from, place), place);
  }

  #wayOf(command: number, start: Pose): Way {
    if (this.#answer(command, ANSWERED.kind) === TaskKind.Path) {
      const from = command === 0 ? 0 : this.#pointsEnd.array[command - 1]!;
      return new Way(start.position, this.#points.array.subarray(from, this.#pointsEnd.array[command]!));
    }
    const pitch = this.#answer(command, ANSWERED.pitchRad);
    const direction: Vec3 = [
      Math.cos(start.yawRad) * Math.cos(pitch),
      Math.sin(start.yawRad) * Math.cos(pitch),
      Math.sin(pitch),
    ];
    // A wall ends every motion, so that the target of an endless one is there.
    const wallM = firstWall(this.#terrain, start.position, direction, Infinity) ?? 0;
    const distanceM = Math.min(this.#answer(command, ANSWERED.distanceM), wallM);
    return new Way(
      start.position,
      direction.map((component, axis) => start.position[axis]! + component * distanceM),
    );
  }
}

function distance(a: Vec3, b: Vec3): number {
  return Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
}
