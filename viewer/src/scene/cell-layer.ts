/**
 * A layer of cells that changes over time, such as the unexplored ones: its surface, chunk by
 * chunk.
 *
 * A chunk is rebuilt only if it looks different at the given tick (see `ChunkStaleness`), and only
 * within the time budget of the frame; the remaining chunks are rebuilt in later frames, in order.
 */

import { GLSL3, Group, RawShaderMaterial, Vector3, type IUniform } from "three";
import type { CellTimes } from "../data/cell-times.ts";
import { ChunkStaleness, Grid, type Size } from "./chunks.ts";
import { Faces, FacesMesh, type QuadBuffers } from "./faces.ts";
import {
  setDefines,
  FRAGMENT_HEAD,
  NORMALS,
  PACKED_CORNER,
  VERTEX_HEAD,
  type SharedUniforms,
} from "./glsl.ts";
import { Mesher, type Surface } from "./mesher.ts";
import type { OcclusionUniforms } from "./volumes.ts";

/** Contents and appearance of a layer. */
export interface CellLayerStyle {
  /** Whether a cell can be in the layer. */
  readonly counts: (cell: number) => boolean;
  /** Whether cells are in the layer before their time, or from then on. */
  readonly isBefore: boolean;
  /** sRGB, with the alpha of a face seen frontally and at a grazing angle. */
  readonly colour: readonly [number, number, number];
  readonly alphas: readonly [number, number];
  readonly renderOrder: number;
}

const VERTEX = /* glsl */ `${VERTEX_HEAD}${NORMALS}
${PACKED_CORNER}
uniform vec3 tint;
uniform vec2 alphas;
out vec3 positionM;
out vec4 painted;
const vec3 HAZE_SHOWN = vec3(0.051, 0.065, 0.088);
void main() {
  vec3 normal = NORMALS[cornerFacing()];
  ivec3 cells = cornerCells();
  positionM = vec3(cells) * modelMatrix[0].x;
  gl_Position = projectionMatrix * viewMatrix * vec4(positionM, 1.0);
  vec3 away = positionM - eye;
  float distanceM = length(away);
  // Against rock the shading normal is as smooth as that of the rock.
  vec3 rock = occlusionOf(occlusionTexel(cells)).xyz;
  vec3 n = normalize(normal * 0.35 - rock * max(-dot(rock, normal), 0.0));
  float glance = 1.0 - clamp(-dot(n, away) / distanceM, 0.0, 1.0);
  float key = max(dot(n, light), 0.0);
  vec3 c = tint * sqrt(0.62 + 0.38 * key + 0.1 * n.z);
  painted = vec4(mix(c, mix(HAZE_SHOWN, vec3(1.0), paper), hazinessAt(distanceM)), mix(alphas.x, alphas.y, glance * glance));
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec3 positionM;
in vec4 painted;
void main() {
  #ifdef CUT
  if (isCut(positionM)) discard;
  #endif
  colour = painted;
}
`;

/** Lighting is per vertex, so rectangles must be short; cells. */
const LONGEST = 6;

/** Chunk edge in cells: small chunks change less often, large ones need fewer draw calls. */
function edgeFor(size: Size): number {
  return size[0] * size[1] * size[2] > 500_000 ? 25 : 16;
}

export class CellLayer {
  readonly group = new Group();
  readonly #clocks: ChunkStaleness;
  readonly #grid: Grid;
  readonly #edge: number;
  readonly #padded: Uint8Array;
  readonly #mesher = new Mesher(LONGEST);
  readonly #meshes: (FacesMesh | undefined)[] = [];
  readonly #material: RawShaderMaterial;
  #next = 0;
  #shownTick = -1;
  #hasNews = true;

  constructor(
    size: Size,
    readonly times: CellTimes,
    readonly kind: CellLayerStyle,
    readonly buffers: QuadBuffers,
    common: SharedUniforms,
    occlusion: OcclusionUniforms,
  ) {
    this.#edge = edgeFor(size);
    this.#grid = new Grid(size, this.#edge);
    this.#padded = new Uint8Array((this.#edge + 2) ** 3);
    this.#clocks = new ChunkStaleness(this.#grid, times, kind.counts);
    const uniforms: { [name: string]: IUniform } = {
      ...common,
      ...occlusion,
      tint: { value: new Vector3(...kind.colour) },
      alphas: { value: kind.alphas },
    };
    this.#material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms,
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      transparent: true,
      depthWrite: false,
    });
  }

  markChanged(cells: Iterable<number>): void {
    this.#clocks.markChanged(cells);
    this.#hasNews = true;
  }

  /**
   * Rebuilds stale chunks for `tick` while `hasTime` returns true. Returns how many were built, and
   * whether none is stale.
   */
  show(tick: number, hasTime: () => boolean): { readonly built: number; readonly isComplete: boolean } {
    if (tick === this.#shownTick && !this.#hasNews) return { built: 0, isComplete: true };
    let built = 0;
    const chunks = this.#grid.chunks;
    for (let i = 0; i < chunks; i++) {
      const chunk = (this.#next + i) % chunks;
      if (!this.#clocks.isStale(chunk, tick)) continue;
      if (!hasTime()) {
        this.#next = chunk;
        this.#shownTick = -1;
        return { built, isComplete: false };
      }
      this.#make(chunk, tick);
      built++;
    }
    this.#shownTick = tick;
    this.#hasNews = false;
    return { built, isComplete: true };
  }

  /** Prepares a frame for a camera position in cells. */
  selectFacing(eye: Vector3, isCut: boolean): void {
    for (const mesh of this.#meshes) mesh?.selectFacing(eye);
    setDefines(this.#material, isCut ? ["CUT"] : []);
  }

  dispose(): void {
    for (const mesh of this.#meshes) mesh?.dispose();
    this.#material.dispose();
  }

  #make(chunk: number, tick: number): void {
    const { times, kind } = this;
    const contains = kind.isBefore
      ? (cell: number): boolean => times.get(cell) > tick && kind.counts(cell)
      : (cell: number): boolean => times.get(cell) <= tick && kind.counts(cell);
    const isAny = this.#grid.fill(chunk, this.#padded, contains);
    const origin = this.#grid.origin(chunk);
    const block = { edge: this.#edge, origin, padded: this.#padded };
    const surface = isAny ? this.#mesher.surface(block, false) : EMPTY;
    this.#clocks.markBuilt(chunk, tick);
    let mesh = this.#meshes[chunk];
    const isEmpty = surface.corners.length === 0;
    if (mesh !== undefined) mesh.mesh.visible = !isEmpty;
    if (isEmpty) return;
    const edge = this.#edge;
    const faces = new Faces(surface, this.buffers, origin, [
      origin[0] + edge,
      origin[1] + edge,
      origin[2] + edge,
    ]);
    if (mesh === undefined) {
      mesh = new FacesMesh(faces, this.#material, false);
      mesh.mesh.renderOrder = kind.renderOrder;
      this.#meshes[chunk] = mesh;
      this.group.add(mesh.mesh);
    } else {
      mesh.replace(faces);
    }
  }
}

const EMPTY: Surface = { corners: new Uint16Array(0), ends: [0, 0, 0, 0, 0, 0] };
