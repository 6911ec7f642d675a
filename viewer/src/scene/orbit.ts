/**
 * Camera pose as an orbit around a centre, with z up. Pure: no events and no three.js.
 *
 * The yaw is the horizontal viewing direction (0: along +x, growing towards +y); the pitch is the
 * angle below the horizon.
 */

import type { Vec3 } from "../data/run.ts";

export interface Orbit {
  readonly centre: Vec3;
  readonly yawRad: number;
  readonly pitchRad: number;
  readonly distanceM: number;
}

/** Views of the whole map with a name: the yaw and the pitch. The default is from a corner. */
export const NAMED_VIEWS = {
  /** x to the right, y upwards. */
  top: { yawRad: Math.PI / 2, pitchRad: (89 * Math.PI) / 180 },
  /** Along y: x to the right. */
  front: { yawRad: Math.PI / 2, pitchRad: 0 },
  /** Against x: y to the right. */
  side: { yawRad: Math.PI, pitchRad: 0 },
} as const satisfies Record<string, Pick<Orbit, "yawRad" | "pitchRad">>;

/** Vertical field of view. */
export const FIELD_OF_VIEW_RAD = (45 * Math.PI) / 180;

const PITCH_LIMIT_RAD = (89 * Math.PI) / 180;

/** Viewing direction, a unit vector. */
export function viewDirectionOf(orbit: Orbit): Vec3 {
  const flat = Math.cos(orbit.pitchRad);
  return [flat * Math.cos(orbit.yawRad), flat * Math.sin(orbit.yawRad), -Math.sin(orbit.pitchRad)];
}

/** Direction to the right of the image, a horizontal unit vector. */
export function rightOf(orbit: Orbit): Vec3 {
  return [Math.sin(orbit.yawRad), -Math.cos(orbit.yawRad), 0];
}

/** Position of the camera. */
export function cameraPositionOf(orbit: Orbit): Vec3 {
  const look = viewDirectionOf(orbit);
  const { centre, distanceM } = orbit;
  return [centre[0] - look[0] * distanceM, centre[1] - look[1] * distanceM, centre[2] - look[2] * distanceM];
}

/** Rotated by a drag, in shares of the image height. */
export function turned(orbit: Orbit, right: number, down: number): Orbit {
  const pitch = orbit.pitchRad + down * Math.PI;
  return {
    ...orbit,
    yawRad: orbit.yawRad - right * Math.PI * 1.2,
    pitchRad: Math.min(Math.max(pitch, -PITCH_LIMIT_RAD), PITCH_LIMIT_RAD),
  };
}

/** Zoomed by a factor, within limits. */
export function zoomed(orbit: Orbit, factor: number, limits: readonly [number, number]): Orbit {
  return { ...orbit, distanceM: Math.min(Math.max(orbit.distanceM * factor, limits[0]), limits[1]) };
}

/** Panned so that the centre follows the pointer; a drag in shares of the image height. */
export function panned(orbit: Orbit, right: number, down: number): Orbit {
  const span = 2 * Math.tan(FIELD_OF_VIEW_RAD / 2) * orbit.distanceM;
  const [look, side] = [viewDirectionOf(orbit), rightOf(orbit)];
  // The upward direction of the image is orthogonal to both.
  const up: Vec3 = [
    side[1] * look[2] - side[2] * look[1],
    side[2] * look[0] - side[0] * look[2],
    side[0] * look[1] - side[1] * look[0],
  ];
  const centre = orbit.centre.map((value, axis) => value + span * (down * up[axis]! - right * side[axis]!));
  return { ...orbit, centre: centre as Vec3 };
}

/** Interpolates between two poses with easing, along the shorter rotation; `share` is 0 to 1. */
export function between(from: Orbit, to: Orbit, share: number): Orbit {
  if (share >= 1) return to;
  const s = Math.max(share, 0);
  const ease = s * s * (3 - 2 * s);
  const mix = (a: number, b: number): number => a + (b - a) * ease;
  return {
    centre: [
      mix(from.centre[0], to.centre[0]),
      mix(from.centre[1], to.centre[1]),
      mix(from.centre[2], to.centre[2]),
    ],
    yawRad: from.yawRad + shorterTurnRad(from.yawRad, to.yawRad) * ease,
    pitchRad: mix(from.pitchRad, to.pitchRad),
    // Geometric interpolation looks uniform.
    distanceM: from.distanceM * (to.distanceM / from.distanceM) ** ease,
  };
}

/** Difference of two angles, between -pi and pi. */
export function shorterTurnRad(fromRad: number, toRad: number): number {
  const turn = (toRad - fromRad) % (2 * Math.PI);
  if (turn > Math.PI) return turn - 2 * Math.PI;
  return turn < -Math.PI ? turn + 2 * Math.PI : turn;
}

/** Distance from which a box just fits into an image of this aspect ratio. */
export function distanceToFit(orbit: Orbit, extentM: Vec3, aspect: number): number {
  const tanY = Math.tan(FIELD_OF_VIEW_RAD / 2);
  const tanX = tanY * aspect;
  const [look, side] = [viewDirectionOf(orbit), rightOf(orbit)];
  const up: Vec3 = [side[1] * look[2], -side[0] * look[2], side[0] * look[1] - side[1] * look[0]];
  let distance = 0;
  for (let corner = 0; corner < 8; corner++) {
    const offset = extentM.map((extent, axis) => ((corner >> axis) & 1 ? extent : -extent) / 2);
    const along = (v: Vec3): number => offset[0]! * v[0] + offset[1]! * v[1] + offset[2]! * v[2];
    distance = Math.max(
      distance,
      Math.abs(along(up)) / tanY - along(look),
      Math.abs(along(side)) / tanX - along(look),
    );
  }
  return distance;
}
