/** Where round things are on the canvas, and which of them is at a position of it. */

import { Vector3, type PerspectiveCamera } from "three";
import type { Vec3 } from "../data/run.ts";

/** Camera and size of the canvas. */
export interface Viewport {
  readonly camera: PerspectiveCamera;
  /** Of the canvas, CSS pixels. */
  readonly width: number;
  readonly height: number;
}

/** A sphere on the canvas, CSS pixels from the upper left corner. */
export interface OnScreen {
  readonly x: number;
  readonly y: number;
  /** Along the view; negative: behind the camera. */
  readonly depthM: number;
  readonly radiusPx: number;
  /** What `radiusPx` would be without a minimum. */
  readonly trueRadiusPx: number;
}

/** Tolerance of a pointer around a thing. */
const PICK_SLACK_PX = 8;

/** Projects a sphere, which is drawn with at least `radiusMinPx`. */
export function onScreen(
  position: Vec3,
  radiusM: number,
  radiusMinPx: number,
  { camera, width, height }: Viewport,
): OnScreen {
  const view = new Vector3(...position).applyMatrix4(camera.matrixWorldInverse);
  const depthM = -view.z;
  const screen = view.applyMatrix4(camera.projectionMatrix);
  const halfHeightM = Math.tan((camera.fov * Math.PI) / 360) * Math.max(depthM, 0.01);
  const trueRadiusPx = (radiusM / halfHeightM) * (height / 2);
  return {
    x: (screen.x * 0.5 + 0.5) * width,
    y: (0.5 - screen.y * 0.5) * height,
    depthM,
    radiusPx: Math.max(trueRadiusPx, radiusMinPx),
    trueRadiusPx,
  };
}

/** The nearest of the things at a position of the canvas; null: none is there. */
export function nearest<Thing extends OnScreen>(
  things: readonly Thing[],
  x: number,
  y: number,
): Thing | null {
  let best: Thing | null = null;
  for (const thing of things) {
    const isHit = thing.depthM > 0 && Math.hypot(thing.x - x, thing.y - y) <= thing.radiusPx + PICK_SLACK_PX;
    if (isHit && (best === null || thing.depthM < best.depthM)) best = thing;
  }
  return best;
}
