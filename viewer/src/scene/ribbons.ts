/**
 * Camera-facing ribbons: line segments that are set for each frame (paths, contacts, the bounding
 * box). The shader code is shared with the trails (see `trails.ts`).
 *
 * Widths are in CSS pixels, edges are soft. Colours are sRGB with alpha.
 */

import {
  BufferAttribute,
  BufferGeometry,
  DynamicDrawUsage,
  GLSL3,
  GreaterDepth,
  LessEqualDepth,
  Mesh,
  RawShaderMaterial,
  type DepthModes,
} from "three";
import type { Vec3 } from "../data/run.ts";
import { quadIndices } from "./faces.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type SharedUniforms } from "./glsl.ts";

/** Width of the ribbon including its glow, in line widths. */
export const GLOW = 3;

/** Offsets a point of a ribbon sideways: `along` is the ribbon's direction in view space. */
export const WIDEN = /* glsl */ `
vec3 widen(vec3 position, vec3 along, float side, float halfWidthPx, float halfWidthLeastM) {
  vec3 across = cross(along, position);
  float size = length(across);
  if (size < 1e-9) return position;
  float halfWidthM = max(halfWidthPx * pixelRatio * pixelM * abs(position.z), halfWidthLeastM);
  return position + across / size * (side * halfWidthM);
}
`;

const VERTEX = /* glsl */ `${VERTEX_HEAD}${WIDEN}
in vec3 from;
in vec3 to;
in vec4 tint;
in vec4 shape; // end (0 or 1), side (-1 or 1), width in CSS pixels, length of a dash in metres (0: none)
out vec4 vTint;
out float vSide;
out float vAlongM;
flat out float vDashM;
void main() {
  vec3 a = (viewMatrix * vec4(from, 1.0)).xyz;
  vec3 b = (viewMatrix * vec4(to, 1.0)).xyz;
  vec3 position = mix(a, b, shape.x);
  vTint = tint;
  vSide = shape.y * ${GLOW.toFixed(1)};
  vAlongM = shape.x * distance(from, to);
  vDashM = shape.w;
  gl_Position = projectionMatrix * vec4(widen(position, b - a, shape.y, shape.z * 0.5 * ${GLOW.toFixed(1)}, 0.0), 1.0);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec4 vTint;
in float vSide;
in float vAlongM;
flat in float vDashM;
uniform float strength;
void main() {
  float core = 1.0 - smoothstep(0.6, 1.3, abs(vSide));
  if (core <= 0.0) discard;
  float dash = vDashM > 0.0 ? step(fract(vAlongM / vDashM), 0.6) : 1.0;
  colour = vec4(vTint.rgb, vTint.a * core * dash * strength);
}
`;

/** A soft line in front of walls, or a faint one behind them. */
export function ribbonMaterial(
  common: SharedUniforms,
  shaders: { readonly vertex: string; readonly fragment: string },
  isBehind: boolean,
  strength: number,
): RawShaderMaterial {
  const depthFunc: DepthModes = isBehind ? GreaterDepth : LessEqualDepth;
  return new RawShaderMaterial({
    glslVersion: GLSL3,
    uniforms: { ...common, strength: { value: strength } },
    vertexShader: shaders.vertex,
    fragmentShader: shaders.fragment,
    transparent: true,
    depthWrite: false,
    depthFunc,
    side: 2,
  });
}

/** A straight line segment. */
export interface Segment {
  readonly from: Vec3;
  readonly to: Vec3;
  readonly colour: readonly [number, number, number];
  readonly alpha: number;
  readonly widthPx: number;
  readonly dashM: number;
}

/** Vertex attributes and their sizes. */
const ATTRIBUTES = { from: 3, to: 3, tint: 4, shape: 4 };

/** Line segments that are set for each frame. */
export class Segments {
  readonly meshes: readonly Mesh<BufferGeometry, RawShaderMaterial>[];
  #geometry = new BufferGeometry();
  #capacity = 0;

  /** `behind` is the strength of the parts behind walls, 0 to 1. */
  constructor(common: SharedUniforms, behind: number, renderOrder: number) {
    const shaders = { vertex: VERTEX, fragment: FRAGMENT };
    const materials = [ribbonMaterial(common, shaders, false, 1)];
    if (behind > 0) materials.push(ribbonMaterial(common, shaders, true, behind));
    this.meshes = materials.map((material) => {
      const mesh = new Mesh(this.#geometry, material);
      mesh.frustumCulled = false;
      mesh.renderOrder = renderOrder;
      return mesh;
    });
  }

  show(segments: readonly Segment[]): void {
    if (segments.length > this.#capacity) this.#grow(segments.length);
    for (const mesh of this.meshes) mesh.visible = segments.length > 0;
    if (segments.length === 0) return;
    const parts = Object.keys(ATTRIBUTES).map((name) => this.#geometry.getAttribute(name) as BufferAttribute);
    for (let corner = 0; corner < segments.length * 4; corner++) {
      const { from, to, colour, alpha, widthPx, dashM } = segments[corner >> 2]!;
      const turn = corner & 3;
      parts[0]!.setXYZ(corner, ...from);
      parts[1]!.setXYZ(corner, ...to);
      parts[2]!.setXYZW(corner, ...colour, alpha);
      parts[3]!.setXYZW(corner, turn === 1 || turn === 2 ? 1 : 0, turn >= 2 ? 1 : -1, widthPx, dashM);
    }
    for (const part of parts) {
      part.clearUpdateRanges();
      part.addUpdateRange(0, segments.length * 4 * part.itemSize);
      part.needsUpdate = true;
    }
    this.#geometry.setDrawRange(0, segments.length * 6);
  }

  dispose(): void {
    this.#geometry.dispose();
    for (const mesh of this.meshes) mesh.material.dispose();
  }

  #grow(segments: number): void {
    this.#capacity = Math.max(64, 2 ** Math.ceil(Math.log2(segments)));
    this.#geometry.dispose();
    this.#geometry = new BufferGeometry();
    for (const mesh of this.meshes) mesh.geometry = this.#geometry;
    for (const [name, size] of Object.entries(ATTRIBUTES)) {
      const attribute = new BufferAttribute(new Float32Array(this.#capacity * 4 * size), size);
      this.#geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
    }
    this.#geometry.setIndex(new BufferAttribute(quadIndices(this.#capacity), 1));
  }
}
