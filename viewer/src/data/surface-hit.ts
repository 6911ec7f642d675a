/**
 * The wall that a line of sight meets, as the image shows walls: from their free side only, without
 * those towards the camera and without what is cut away.
 */

import type { Terrain, Vec3 } from "./run.ts";

/** What lies beyond this share of the map's length along the axis is cut away; 1: nothing. */
export interface Cut {
  readonly axis: "x" | "y" | "z";
  readonly share: number;
}

export interface SurfaceHit {
  /** On the wall, metres. */
  readonly point: Vec3;
  /** Centre of the free cell before the wall, metres. */
  readonly free: Vec3;
}

/** The first step from a free cell into a wall along a line; null: there is none. */
export function surfaceHit(
  { size, cellM, walls }: Pick<Terrain, "size" | "cellM" | "walls">,
  cut: Cut,
  from: Vec3,
  direction: Vec3,
): SurfaceHit | null {
  const origin = from.map((value) => value / cellM) as Vec3;
  const high: Vec3 = [...size];
  high["xyz".indexOf(cut.axis)]! *= cut.share;
  // The part of the line in the box that is shown.
  let [enter, leave] = [0, Infinity];
  for (let axis = 0; axis < 3; axis++) {
    const step = direction[axis]!;
    if (step === 0) {
      if (origin[axis]! < 0 || origin[axis]! > high[axis]!) return null;
      continue;
    }
    const ends = [-origin[axis]! / step, (high[axis]! - origin[axis]!) / step];
    enter = Math.max(enter, Math.min(...ends));
    leave = Math.min(leave, Math.max(...ends));
  }
  if (!(enter < leave)) return null;
  const at = (along: number): Vec3 => origin.map((value, axis) => value + along * direction[axis]!) as Vec3;
  const inside = at(enter + Math.min(1e-9, (leave - enter) / 2));
  const cell = inside.map((value, axis) => Math.min(Math.max(Math.floor(value), 0), size[axis]! - 1)) as Vec3;
  const isWall = (): boolean => walls.has((cell[2] * size[1] + cell[1]) * size[0] + cell[0]);
  const next = cell.map((value, axis) => {
    const step = direction[axis]!;
    return step === 0 ? Infinity : (value + (step > 0 ? 1 : 0) - origin[axis]!) / step;
  });
  let free: Vec3 | null = isWall() ? null : [...cell];
  for (;;) {
    const axis = next.indexOf(Math.min(...next));
    const along = next[axis]!;
    if (!(along < leave)) return null;
    cell[axis]! += Math.sign(direction[axis]!);
    if (cell[axis]! < 0 || cell[axis]! >= size[axis]!) return null;
    next[axis]! += 1 / Math.abs(direction[axis]!);
    if (!isWall()) {
      free = [...cell];
    } else if (free !== null) {
      const inMetres = (point: Vec3): Vec3 => point.map((value) => value * cellM) as Vec3;
      return { point: inMetres(at(along)), free: inMetres(free.map((value) => value + 0.5) as Vec3) };
    }
  }
}
