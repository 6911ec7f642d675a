/**
 * The camera and its controls: flights to the selection, and input of mouse, wheel, touch and keys.
 *
 * Dragging orbits, with Shift or the middle button it pans; the wheel zooms; two fingers do both.
 * Input is ignored during a flight. A drag is no click: the canvas sends no `click` event after it.
 */

import { PerspectiveCamera, type Vector3 } from "three";
import type { Vec3 } from "../data/run.ts";
import {
  between,
  cameraPositionOf,
  FIELD_OF_VIEW_RAD,
  panned,
  rightOf,
  turned,
  zoomed,
  type Orbit,
} from "./orbit.ts";

const FLIGHT_MS = 500;
/** A pointer that has moved less than this, in CSS pixels, has clicked. */
const CLICK_PX = 4;

/** A change of the pose, within limits of the distance. */
export type CameraMove = (orbit: Orbit, limits: readonly [number, number]) => Orbit;

interface Flight {
  readonly from: Orbit;
  readonly beganMs: number;
}

export class CameraRig {
  readonly camera = new PerspectiveCamera((FIELD_OF_VIEW_RAD * 180) / Math.PI, 1, 0.1, 1000);
  /** The present pose or the destination of the flight; its centre is relative to the anchor. */
  #orbit: Orbit = { centre: [0, 0, 0], yawRad: 0, pitchRad: 0.5, distanceM: 10 };
  #anchor: Vec3 = [0, 0, 0];
  /** The pose in the last frame. */
  #shown: Orbit = this.#orbit;
  #flight: Flight | null = null;
  #limits: readonly [number, number] = [1, 100];
  /** Half the diagonal of the map. */
  #reachM = 1;
  readonly #pointers = new Map<number, { x: number; y: number }>();
  #draggedPx = 0;
  #hasDragged = false;
  #hasMoved = true;
  readonly #abort = new AbortController();

  constructor(readonly canvas: HTMLCanvasElement) {
    this.camera.up.set(0, 0, 1);
    const { signal } = this.#abort;
    canvas.style.touchAction = "none";
    canvas.addEventListener("pointerdown", (event) => this.#down(event), { signal });
    canvas.addEventListener("pointermove", (event) => this.#drag(event), { signal });
    for (const name of ["pointerup", "pointercancel"] as const) {
      canvas.addEventListener(name, (event) => this.#pointers.delete(event.pointerId), { signal });
    }
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { signal, passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault(), { signal });
    const swallow = (event: MouseEvent): void => {
      if (this.#hasDragged) event.stopImmediatePropagation();
      this.#hasDragged = false;
    };
    canvas.addEventListener("click", swallow, { signal, capture: true });
  }

  /** Whether the camera has moved since the last `update`, or is in flight. */
  get needsRedraw(): boolean {
    return this.#hasMoved || this.#flight !== null;
  }

  /** Distance to the centre, at the end of a flight. */
  get distanceM(): number {
    return this.#orbit.distanceM;
  }

  /** The pose relative to the anchor, at the end of a flight. */
  get orbit(): Orbit {
    return this.#orbit;
  }

  /** Takes a pose relative to the anchor, at once, within the limits. */
  setOrbit(orbit: Orbit): void {
    this.#flight = null;
    this.#change(zoomed(orbit, 1, this.#limits));
  }

  /** Moves the camera at once. */
  move(change: CameraMove): void {
    if (this.#flight === null) this.#change(change(this.#orbit, this.#limits));
  }

  /** Limits of the distance, and the radius of the map around its middle; metres. */
  setLimits(limits: readonly [number, number], reachM: number): void {
    this.#limits = limits;
    this.#reachM = reachM;
  }

  /** Orbits an anchor (see `update`) from now on, at once or after a flight. */
  goTo(orbit: Orbit, anchor: Vec3, fly: boolean): void {
    this.#orbit = orbit;
    this.#anchor = anchor;
    this.#flight = fly ? { from: this.#shown, beganMs: performance.now() } : null;
    this.#hasMoved = true;
  }

  endFlight(): void {
    this.#flight = null;
  }

  /** Updates the camera; `anchor` is the position that it follows. */
  update(anchor: Vec3, mapCentre: Vec3): void {
    this.#anchor = anchor;
    this.#hasMoved = false;
    let orbit = this.#absolute();
    if (this.#flight !== null) {
      const share = (performance.now() - this.#flight.beganMs) / FLIGHT_MS;
      orbit = between(this.#flight.from, orbit, share);
      if (share >= 1) this.#flight = null;
    }
    this.#shown = orbit;
    const position = cameraPositionOf(orbit);
    this.camera.position.set(...position);
    this.camera.lookAt(...orbit.centre);
    const farM = Math.hypot(...position.map((value, axis) => value - mapCentre[axis]!)) + this.#reachM * 1.6;
    this.camera.near = Math.max(Math.min(orbit.distanceM, farM) * 0.02, 0.02);
    this.camera.far = farM;
    this.camera.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /**
   * Direction to the main light: from above and the left of the view, so that surfaces facing the
   * camera have shading from any side.
   */
  aimLight(target: Vector3): void {
    const right = rightOf(this.#orbit);
    const toEye = this.camera.getWorldDirection(target).negate();
    target
      .set(toEye.x * 0.55 - right[0] * 0.55, toEye.y * 0.55 - right[1] * 0.55, toEye.z * 0.35 + 0.75)
      .normalize();
  }

  dispose(): void {
    this.#abort.abort();
  }

  #absolute(): Orbit {
    const { centre } = this.#orbit;
    const [x, y, z] = this.#anchor;
    return { ...this.#orbit, centre: [centre[0] + x, centre[1] + y, centre[2] + z] };
  }

  #change(orbit: Orbit): void {
    this.#orbit = orbit;
    this.#hasMoved = true;
  }

  #down(event: PointerEvent): void {
    this.canvas.setPointerCapture(event.pointerId);
    this.#pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (this.#pointers.size === 1) {
      this.#draggedPx = 0;
      this.#hasDragged = false;
    }
    if (event.button === 1) event.preventDefault();
  }

  #drag(event: PointerEvent): void {
    const before = this.#pointers.get(event.pointerId);
    if (before === undefined) return;
    const others = [...this.#pointers]
      .filter(([id]) => id !== event.pointerId)
      .map(([, position]) => position);
    const now = { x: event.clientX, y: event.clientY };
    this.#pointers.set(event.pointerId, now);
    const [right, down] = [now.x - before.x, now.y - before.y];
    this.#draggedPx += Math.hypot(right, down);
    if (this.#draggedPx >= CLICK_PX) this.#hasDragged = true;
    if (this.#flight !== null || !this.#hasDragged) return;
    const height = Math.max(this.canvas.clientHeight, 1);
    const other = others[0];
    if (other !== undefined) {
      const spread = (position: { x: number; y: number }): number =>
        Math.max(Math.hypot(position.x - other.x, position.y - other.y), 1);
      const nearer = zoomed(this.#orbit, spread(before) / spread(now), this.#limits);
      this.#change(panned(nearer, right / height / 2, down / height / 2));
    } else if (event.shiftKey || (event.buttons & 4) !== 0) {
      this.#change(panned(this.#orbit, right / height, down / height));
    } else {
      this.#change(turned(this.#orbit, right / height, down / height));
    }
  }

  #wheel(event: WheelEvent): void {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE ? event.deltaY * 16 : event.deltaY;
    const factor = Math.exp(Math.min(Math.max(lines, -240), 240) * 0.0015);
    this.move((orbit, limits) => zoomed(orbit, factor, limits));
  }
}
