/**
 * Trails of agents: one ribbon each, brightest at the most recent end.
 *
 * A track has a point every few ticks; the trail keeps only as many as it needs to stay within a
 * tolerance of the agent's position at each time. Points are appended as the run becomes known and
 * never rebuilt; the draw range and the segment from the last point to the agent give any time.
 */

import { BufferAttribute, BufferGeometry, DynamicDrawUsage, Mesh, type RawShaderMaterial } from "three";
import type { Track, Vec3 } from "../data/run.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type SharedUniforms } from "./glsl.ts";
import { GLOW, ribbonMaterial, WIDEN } from "./ribbons.ts";

const TOLERANCE_M = 0.1;
/** Maximum number of points skipped in a row; bounds the cost per point. */
const SKIPPED_MAX = 48;

type Point = readonly [timeS: number, x: number, y: number, z: number];

/** Simplifies a track: omits points that a straight motion at constant speed approximates. */
export class TrackSimplifier {
  #anchor: readonly number[] | null = null;
  #skipped: (readonly number[])[] = [];

  /** Adds the next point (t, x, y, z) and calls back with each one that is kept. */
  push(point: readonly number[], keep: (point: readonly number[]) => void): void {
    if (this.#anchor === null) {
      this.#anchor = point;
      keep(point);
      return;
    }
    if (this.#skipped.length === SKIPPED_MAX || !this.#isNear(this.#anchor, point)) {
      this.#anchor = this.#skipped.pop() ?? point;
      this.#skipped = [];
      keep(this.#anchor);
    }
    this.#skipped.push(point);
  }

  /**
   * Each point is compared with all that were skipped, so this allocates nothing: the first seek
   * after reading a recording waits for it.
   */
  #isNear(from: readonly number[], to: readonly number[]): boolean {
    const [fromS, fromX, fromY, fromZ] = from as Point;
    const [toS, toX, toY, toZ] = to as Point;
    const span = Math.max(toS - fromS, 1e-9);
    for (const point of this.#skipped) {
      const share = (point[0]! - fromS) / span;
      const x = fromX + (toX - fromX) * share - point[1]!;
      const y = fromY + (toY - fromY) * share - point[2]!;
      const z = fromZ + (toZ - fromZ) * share - point[3]!;
      if (Math.sqrt(x * x + y * y + z * z) > TOLERANCE_M) return false;
    }
    return true;
  }
}

const VERTEX = /* glsl */ `${VERTEX_HEAD}${WIDEN}
in vec3 point;
in vec3 before;
in vec3 after;
in vec2 shape; // time in seconds, side (-1 or 1)
uniform float widthPx;
uniform float leastM;
out float vTimeS;
out float vSide;
out vec3 vPositionM;
void main() {
  vec3 at = (viewMatrix * vec4(point, 1.0)).xyz;
  vec3 incoming = at - (viewMatrix * vec4(before, 1.0)).xyz;
  vec3 outgoing = (viewMatrix * vec4(after, 1.0)).xyz - at;
  float incomingM = length(incoming);
  float outgoingM = length(outgoing);
  vec3 tangent = (incomingM > 1e-6 ? incoming / incomingM : vec3(0.0)) + (outgoingM > 1e-6 ? outgoing / outgoingM : vec3(0.0));
  if (dot(tangent, tangent) < 1e-4) tangent = incoming;
  vTimeS = shape.x;
  vSide = shape.y * ${GLOW.toFixed(1)};
  vPositionM = point;
  gl_Position = projectionMatrix * vec4(widen(at, tangent, shape.y, widthPx * 0.5 * ${GLOW.toFixed(1)}, leastM * ${GLOW.toFixed(1)}), 1.0);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in float vTimeS;
in float vSide;
in vec3 vPositionM;
uniform float strength;
uniform vec3 tint;
uniform float nowS;
uniform float bright;
void main() {
  float core = 1.0 - smoothstep(0.45, 1.15, abs(vSide));
  float glow = exp(-vSide * vSide * 0.75) * 0.22;
  float age = max(nowS - vTimeS, 0.0);
  float young = exp(-age / 40.0);
  float alpha = (core * mix(0.32, 1.0, young) + glow * young) * strength * bright;
  if (isCut(vPositionM)) alpha *= 0.2;
  if (alpha < 0.004) discard;
  colour = vec4(mix(tint * mix(0.72, 1.0, young), vec3(1.0), 0.35 * young * core), min(alpha, 1.0));
}
`;

const SIZES = { point: 3, before: 3, after: 3, shape: 2 };

/** The trail of one agent. */
export class Trail {
  readonly meshes: readonly Mesh<BufferGeometry, RawShaderMaterial>[];
  #geometry = new BufferGeometry();
  readonly #simplifier = new TrackSimplifier();
  #read = 0;
  #count = 0;
  #capacity = 0;
  #times: number[] = [];
  #last: Vec3 = [0, 0, 0];

  constructor(common: SharedUniforms, colour: readonly [number, number, number], radiusM: number) {
    const shaders = { vertex: VERTEX, fragment: FRAGMENT };
    this.meshes = [false, true].map((isBehind) => {
      const material = ribbonMaterial(common, shaders, isBehind, isBehind ? 0.2 : 1);
      Object.assign(material.uniforms, {
        tint: { value: colour },
        nowS: { value: 0 },
        bright: { value: 1 },
        widthPx: { value: 2 },
        leastM: { value: radiusM * 0.1 },
      });
      const mesh = new Mesh(this.#geometry, material);
      mesh.frustumCulled = false;
      mesh.renderOrder = 4;
      return mesh;
    });
  }

  /** Adds the new points of a track. */
  extend(track: Track): void {
    const { timeS, positions } = track;
    for (; this.#read < track.count; this.#read++) {
      const at = this.#read * 3;
      const point = [timeS[this.#read]!, positions[at]!, positions[at + 1]!, positions[at + 2]!];
      this.#simplifier.push(point, (kept) => this.#append(kept[0]!, [kept[1]!, kept[2]!, kept[3]!]));
    }
  }

  /**
   * Shows the trail up to a time. Returns its last point, for the segment to the agent; null: there
   * is none.
   */
  show(timeS: number, look: { readonly bright: number; readonly widthPx: number }): Vec3 | null {
    let count = 0;
    for (let low = 0, high = this.#count; low < high; count = low) {
      const middle = (low + high) >>> 1;
      if (this.#times[middle]! <= timeS) low = middle + 1;
      else high = middle;
    }
    for (const mesh of this.meshes) {
      mesh.visible = count > 1;
      mesh.material.uniforms.nowS!.value = timeS;
      mesh.material.uniforms.bright!.value = look.bright;
      mesh.material.uniforms.widthPx!.value = look.widthPx;
    }
    this.#geometry.setDrawRange(0, Math.max(count - 1, 0) * 6);
    if (count === 0) return null;
    const point = this.#geometry.getAttribute("point");
    const vertex = (count - 1) * 2;
    return [point.getX(vertex), point.getY(vertex), point.getZ(vertex)];
  }

  hide(): void {
    for (const mesh of this.meshes) mesh.visible = false;
  }

  dispose(): void {
    this.#geometry.dispose();
    for (const mesh of this.meshes) mesh.material.dispose();
  }

  #append(timeS: number, point: Vec3): void {
    if (this.#count === this.#capacity) this.#grow();
    const at = this.#count * 2;
    const before = this.#count === 0 ? point : this.#last;
    for (const vertex of [at, at + 1]) {
      this.#attribute("point").setXYZ(vertex, ...point);
      this.#attribute("before").setXYZ(vertex, ...before);
      this.#attribute("after").setXYZ(vertex, ...point);
      this.#attribute("shape").setXY(vertex, timeS, vertex === at ? -1 : 1);
    }
    if (this.#count > 0)
      for (const vertex of [at - 2, at - 1]) this.#attribute("after").setXYZ(vertex, ...point);
    for (const [name, size] of Object.entries(SIZES)) {
      const attribute = this.#attribute(name);
      const from = Math.max(at - 2, 0);
      attribute.addUpdateRange(from * size, (at + 2 - from) * size);
      attribute.needsUpdate = true;
    }
    this.#times[this.#count] = timeS;
    this.#last = point;
    this.#count++;
  }

  #attribute(name: string): BufferAttribute {
    return this.#geometry.getAttribute(name) as BufferAttribute;
  }

  #grow(): void {
    this.#capacity = Math.max(256, this.#capacity * 2);
    const geometry = new BufferGeometry();
    for (const [name, size] of Object.entries(SIZES)) {
      const array = new Float32Array(this.#capacity * 2 * size);
      if (this.#count > 0) array.set(this.#attribute(name).array.subarray(0, this.#count * 2 * size));
      geometry.setAttribute(name, new BufferAttribute(array, size).setUsage(DynamicDrawUsage));
    }
    const indices = new Uint32Array((this.#capacity - 1) * 6);
    for (let piece = 0; piece < this.#capacity - 1; piece++) {
      indices.set(
        [0, 1, 3, 0, 3, 2].map((corner) => piece * 2 + corner),
        piece * 6,
      );
    }
    geometry.setIndex(new BufferAttribute(indices, 1));
    this.#geometry.dispose();
    this.#geometry = geometry;
    for (const mesh of this.meshes) mesh.geometry = geometry;
  }
}
