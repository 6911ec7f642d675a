/**
 * Progress of a body along a path of straight legs.
 *
 * Invariant: progress never decreases, and depends only on the path and the sequence of positions.
 */

import type { Vec3 } from "./run.ts";

/**
 * Added to the distance between two poses, which cuts corners and so underestimates the progress.
 */
const SLACK_M = 0.5;

/** A waypoint counts as passed when less than this is left to it. */
const NEAR_M = 0.02;

export class Path {
  /** The start, then the waypoints: x, y, z. */
  readonly #points: Float64Array;
  /** Path length from the start to each of the points. */
  readonly #lengths: number[] = [0];

  constructor(start: Vec3, points: ArrayLike<number>) {
    this.#points = new Float64Array(points.length + 3);
    this.#points.set(start);
    this.#points.set(points, 3);
    for (let at = 3; at < this.#points.length; at += 3) {
      this.#lengths.push(this.#lengths[at / 3 - 1]! + this.#distance(at - 3, at));
    }
  }

  #distance(a: number, b: number): number {
    const p = this.#points;
    return Math.hypot(p[b]! - p[a]!, p[b + 1]! - p[a + 1]!, p[b + 2]! - p[a + 2]!);
  }

  /** Progress in metres at a position, given the previous progress and the distance moved since. */
  advanced(beforeM: number, movedM: number, position: Vec3): number {
    const untilM = beforeM + 1.5 * movedM + SLACK_M;
    const p = this.#points;
    let best = Infinity;
    let progress = beforeM;
    for (let leg = 0; leg + 1 < this.#lengths.length; leg++) {
      const [from, to] = [this.#lengths[leg]!, this.#lengths[leg + 1]!];
      if (to < beforeM) {
        continue;
      }
      if (from > untilM) {
        break;
      }
      const at = 3 * leg;
      const length = to - from;
      let along = 0;
      if (length > 0) {
        for (let axis = 0; axis < 3; axis++) {
          along += ((p[at + 3 + axis]! - p[at + axis]!) / length) * (position[axis]! - p[at + axis]!);
        }
      }
      along = Math.min(Math.max(along, beforeM - from, 0), untilM - from, length);
      let apart = 0;
      for (let axis = 0; axis < 3; axis++) {
        const share = length > 0 ? along / length : 0;
        apart += (p[at + axis]! + share * (p[at + 3 + axis]! - p[at + axis]!) - position[axis]!) ** 2;
      }
      // Of equally near points the first one is taken.
      if (apart < best - 1e-9) {
        best = apart;
        progress = from + along;
      }
    }
    return progress;
  }

  /** The waypoints ahead. */
  remaining(progressM: number): Vec3[] {
    const rest: Vec3[] = [];
    for (let point = 1; point < this.#lengths.length; point++) {
      if (this.#lengths[point]! > progressM + NEAR_M) {
        rest.push([this.#points[3 * point]!, this.#points[3 * point + 1]!, this.#points[3 * point + 2]!]);
      }
    }
    return rest;
  }
}
