/**
 * Screen-space markers over everything else: glows of agents, the ring of the selected one,
 * targets, waypoints and labels. They are set for each frame, in drawing order.
 */

import {
  BufferAttribute,
  BufferGeometry,
  CanvasTexture,
  DynamicDrawUsage,
  GLSL3,
  LinearFilter,
  Mesh,
  RawShaderMaterial,
} from "three";
import type { Vec3 } from "../data/run.ts";
import { quadIndices } from "./faces.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type SharedUniforms } from "./glsl.ts";

/** Shape of a marker; labels are markers of their own set. */
export const MARKER = { glow: 0, ring: 1, target: 2, dot: 3, label: 4 } as const;

export interface Marker {
  readonly kind: (typeof MARKER)[keyof typeof MARKER];
  readonly anchor: Vec3;
  /** Half the width, CSS pixels. */
  readonly radiusPx: number;
  /** Offset above the position, CSS pixels. */
  readonly abovePx: number;
  readonly colour: readonly [number, number, number];
  readonly alpha: number;
  /** The number on a label. */
  readonly number: number;
}

/** Labels are rendered once into a texture atlas with this many columns. */
const COLUMNS = 8;
const CELL_PX = 96;

const VERTEX = /* glsl */ `${VERTEX_HEAD}
in vec3 anchor;
in vec4 tint;
in vec4 shape; // corner number, kind, radius and height above the anchor in CSS pixels
in float number;
uniform vec2 sheet;
out vec4 vTint;
out vec2 vAt;
out vec2 vOnSheet;
out float vRadiusPx;
flat out int vKind;
void main() {
  int turn = int(shape.x);
  vAt = vec2(turn == 1 || turn == 2 ? 1.0 : -1.0, turn >= 2 ? 1.0 : -1.0);
  vTint = tint;
  vKind = int(shape.y);
  vRadiusPx = shape.z * pixelRatio;
  vec2 cell = vec2(mod(number, sheet.x), floor(number / sheet.x));
  vOnSheet = (cell + vec2(0.5 + 0.5 * vAt.x, 0.5 - 0.5 * vAt.y)) / sheet;
  vec4 centre = projectionMatrix * viewMatrix * vec4(anchor, 1.0);
  vec2 offset = (vAt * shape.z + vec2(0.0, shape.w)) * pixelRatio;
  gl_Position = centre + vec4(offset / frameSize * 2.0 * centre.w, 0.0, 0.0);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec4 vTint;
in vec2 vAt;
in vec2 vOnSheet;
in float vRadiusPx;
flat in int vKind;
uniform sampler2D labels;
// Coverage of a ring: 1 on it, falling to 0 within a pixel.
float ring(float r, float at, float halfWidthPx) {
  return clamp(halfWidthPx + 0.5 - abs(r - at) * vRadiusPx, 0.0, 1.0);
}
void main() {
  float r = length(vAt);
  float alpha = 0.0;
  vec3 c = vTint.rgb;
  #ifdef LABELS
  vec4 texel = texture(labels, vOnSheet);
  c = texel.r > 0.0 ? mix(vTint.rgb, vec3(1.0), texel.g) * texel.r : vec3(0.0);
  alpha = texel.a;
  #else
  if (vKind == ${MARKER.glow}) {
    alpha = max(exp(-r * r * 4.5) - 0.011, 0.0);
  } else if (vKind == ${MARKER.ring}) {
    alpha = ring(r, 0.86, pixelRatio) + 0.25 * max(1.0 - abs(r - 0.86) * 7.0, 0.0);
  } else if (vKind == ${MARKER.target}) {
    float cross = min(abs(vAt.x), abs(vAt.y)) * vRadiusPx < 0.75 * pixelRatio && r > 0.55 ? 1.0 : 0.0;
    alpha = max(ring(r, 0.62, 0.75 * pixelRatio), cross * step(r, 1.0));
    alpha = max(alpha, clamp(2.0 * pixelRatio + 0.5 - r * vRadiusPx, 0.0, 1.0));
  } else {
    alpha = clamp((1.0 - r) * vRadiusPx, 0.0, 1.0);
  }
  #endif
  alpha *= vTint.a;
  if (alpha < 0.004) discard;
  colour = vec4(c, min(alpha, 1.0));
}
`;

const ATTRIBUTES = { anchor: 3, tint: 4, shape: 4, number: 1 };

export class Markers {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;
  readonly #sheet: CanvasTexture | null;
  #capacity = 0;

  /**
   * `labels` is the number of labels, which are 0, 1, 2...; all markers are labels, or none is where
   * it is 0.
   */
  constructor(common: SharedUniforms, labels: number) {
    const rows = Math.max(1, Math.ceil(labels / COLUMNS));
    this.#sheet = labels === 0 ? null : sheetOf(labels, rows);
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { ...common, labels: { value: this.#sheet }, sheet: { value: [COLUMNS, rows] } },
      defines: labels === 0 ? {} : { LABELS: 1 },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      transparent: true,
      depthTest: false,
      depthWrite: false,
    });
    this.mesh = new Mesh(new BufferGeometry(), material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = 9;
  }

  show(markers: readonly Marker[]): void {
    if (markers.length > this.#capacity) this.#grow(markers.length);
    this.mesh.visible = markers.length > 0;
    if (markers.length === 0) return;
    const { geometry } = this.mesh;
    const parts = Object.keys(ATTRIBUTES).map((name) => geometry.getAttribute(name) as BufferAttribute);
    for (let corner = 0; corner < markers.length * 4; corner++) {
      const { kind, anchor, radiusPx, abovePx, colour, alpha, number } = markers[corner >> 2]!;
      parts[0]!.setXYZ(corner, ...anchor);
      parts[1]!.setXYZW(corner, ...colour, alpha);
      parts[2]!.setXYZW(corner, corner & 3, kind, radiusPx, abovePx);
      parts[3]!.setX(corner, number);
    }
    for (const part of parts) {
      part.clearUpdateRanges();
      part.addUpdateRange(0, markers.length * 4 * part.itemSize);
      part.needsUpdate = true;
    }
    geometry.setDrawRange(0, markers.length * 6);
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.#sheet?.dispose();
  }

  #grow(markers: number): void {
    this.#capacity = Math.max(64, 2 ** Math.ceil(Math.log2(markers)));
    this.mesh.geometry.dispose();
    const geometry = new BufferGeometry();
    for (const [name, size] of Object.entries(ATTRIBUTES)) {
      const attribute = new BufferAttribute(new Float32Array(this.#capacity * 4 * size), size);
      geometry.setAttribute(name, attribute.setUsage(DynamicDrawUsage));
    }
    geometry.setIndex(new BufferAttribute(quadIndices(this.#capacity), 1));
    this.mesh.geometry = geometry;
  }
}

/**
 * Atlas of labels, white on dark plates with a coloured edge: red is the share of any colour, green
 * that of white in it.
 */
function sheetOf(labels: number, rows: number): CanvasTexture {
  const canvas = document.createElement("canvas");
  canvas.width = COLUMNS * CELL_PX;
  canvas.height = rows * CELL_PX;
  // The canvas is read back at once, which a GPU canvas would have to wait for.
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (context === null) throw new Error("The browser provides no 2D canvas for the labels of agents.");
  context.textAlign = "center";
  context.textBaseline = "middle";
  for (let name = 0; name < labels; name++) {
    const text = String(name);
    const size = text.length > 2 ? 40 : 52;
    context.font = `600 ${size}px system-ui, "DejaVu Sans", sans-serif`;
    const x = ((name % COLUMNS) + 0.5) * CELL_PX;
    const y = (Math.floor(name / COLUMNS) + 0.5) * CELL_PX;
    const halfWidth = Math.min(Math.max(context.measureText(text).width / 2 + 14, 32), CELL_PX / 2 - 4);
    context.beginPath();
    context.roundRect(x - halfWidth, y - 34, halfWidth * 2, 68, 22);
    context.fillStyle = "rgba(0, 0, 0, 0.72)";
    context.fill();
    context.lineWidth = 5;
    context.strokeStyle = "rgb(255, 0, 0)";
    context.stroke();
    context.fillStyle = "rgb(255, 255, 0)";
    context.fillText(text, x, y + 3);
  }
  const texture = new CanvasTexture(canvas);
  texture.flipY = false;
  texture.premultiplyAlpha = false;
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.generateMipmaps = false;
  return texture;
}
