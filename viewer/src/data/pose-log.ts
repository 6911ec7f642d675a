/**
 * The poses of one body or one moving obstacle, and those between them.
 *
 * A query is a binary search in what has been read, so an answer does not depend on earlier queries.
 */

import { Growable, rowsUpTo } from "./growable.ts";
import { TICK_S, type Track, type Vec3 } from "./run.ts";

export interface Pose {
  readonly position: Vec3;
  readonly yawRad: number;
  readonly speedMS: number;
}

class GrowingTrack implements Track {
  readonly times = new Growable(new Float64Array(0));
  readonly xyz = new Growable(new Float32Array(0));
  readonly yaws = new Growable(new Float32Array(0));

  get count(): number {
    return this.times.count;
  }
  get timeS(): Float64Array {
    return this.times.array;
  }
  get positions(): Float32Array {
    return this.xyz.array;
  }
  get yawRad(): Float32Array {
    return this.yaws.array;
  }
}

export class PoseLog {
  readonly #track = new GrowingTrack();

  get track(): Track {
    return this.#track;
  }

  add(tick: number, x: number, y: number, z: number, yawRad: number): void {
    this.#track.times.push(tick * TICK_S);
    this.#track.xyz.append([x, y, z]);
    this.#track.yaws.push(yawRad);
  }

  /**
   * Interpolates linearly between the known poses, the heading along the shorter arc; clamps at
   * both ends.
   */
  at(timeS: number): Pose {
    const { count, timeS: times, yawRad: yaws } = this.#track;
    if (count === 0) {
      return { position: [0, 0, 0], yawRad: 0, speedMS: 0 };
    }
    const after = rowsUpTo(times, count, 1, timeS);
    if (after === 0 || count === 1) {
      return { position: this.positionOf(0), yawRad: yaws[0]!, speedMS: 0 };
    }
    const b = Math.min(after, count - 1);
    const a = b - 1;
    const spanS = times[b]! - times[a]!;
    const share = spanS > 0 ? Math.min(1, (timeS - times[a]!) / spanS) : 1;
    const [from, to] = [this.positionOf(a), this.positionOf(b)];
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

  /** The position of a pose by its number in the track. */
  positionOf(pose: number): Vec3 {
    const { positions } = this.#track;
    return [positions[3 * pose]!, positions[3 * pose + 1]!, positions[3 * pose + 2]!];
  }
}

export function distance(a: Vec3, b: Vec3): number {
  return Math.hypot(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
}
