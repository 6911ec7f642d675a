/**
 * A layer of cells that changes with time, such as those that nobody has seen: its surface, chunk by chunk.
 *
 * A chunk is made again only if it looks different at the moment that is asked (see `Clocks`), and only while the picture's budget
 * lasts; what is left over is made for the next pictures, beginning where this one has stopped.
 */

import { GLSL3, Group, Mesh, RawShaderMaterial, Vector3, type BufferGeometry, type IUniform } from "three";
import { Clocks, Grid, type Size } from "./chunks.ts";
import { facesGeometry, freeFaces, type QuadIndex } from "./faces.ts";
import { FRAGMENT_HEAD, NORMALS, VERTEX_HEAD, type Common } from "./glsl.ts";
import { Mesher } from "./mesher.ts";

/** What a layer consists of, and how it looks. */
export interface CellsKind {
  /** Which cells count at all. */
  readonly counts: (cell: number) => boolean;
  /** Whether cells are in the layer before their time, or from then on. */
  readonly isBefore: boolean;
  /** As shown, with the alpha of a face that is looked at squarely and of one at a glance. */
  readonly colour: readonly [number, number, number];
  readonly alphas: readonly [number, number];
  readonly renderOrder: number;
}

const VERTEX = /* glsl */ `${VERTEX_HEAD}${NORMALS}
in vec4 corner;
out vec3 placeM;
flat out vec3 normal;
void main() {
  normal = NORMALS[int(corner.w)];
  vec4 place = modelMatrix * vec4(corner.xyz, 1.0);
  placeM = place.xyz;
  gl_Position = projectionMatrix * viewMatrix * place;
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec3 placeM;
flat in vec3 normal;
uniform vec3 tint;
uniform vec2 alphas;
void main() {
  if (isCut(placeM)) discard;
  vec3 away = placeM - eye;
  float distanceM = length(away);
  float square_on = abs(dot(normal, away)) / distanceM;
  vec3 c = square(tint) * (0.55 + 0.45 * max(dot(normal, light), 0.0) + 0.25 * normal.z);
  colour = vec4(shown(hazy(c, distanceM)), mix(alphas.y, alphas.x, square_on));
}
`;

/** Cells along the edge of a chunk: small ones change more seldom, large ones are fewer to draw. */
function edgeFor(size: Size): number {
  return size[0] * size[1] * size[2] > 4e6 ? 32 : 16;
}

export class CellsLayer {
  readonly group = new Group();
  readonly #clocks: Clocks;
  readonly #grid: Grid;
  readonly #edge: number;
  readonly #padded: Uint8Array;
  readonly #mesher = new Mesher();
  readonly #meshes: (Mesh<BufferGeometry, RawShaderMaterial> | undefined)[] = [];
  readonly #material: RawShaderMaterial;
  #next = 0;
  #shownTick = -1;
  #hasNews = true;

  constructor(
    size: Size,
    readonly times: Uint32Array,
    readonly kind: CellsKind,
    readonly index: QuadIndex,
    common: Common,
  ) {
    this.#edge = edgeFor(size);
    this.#grid = new Grid(size, this.#edge);
    this.#padded = new Uint8Array((this.#edge + 2) ** 3);
    this.#clocks = new Clocks(this.#grid, times, kind.counts);
    const uniforms: { [name: string]: IUniform } = {
      ...common,
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

  learn(cells: Iterable<number>): void {
    this.#clocks.learn(cells);
    this.#hasNews = true;
  }

  /** Makes chunks until all are as they are at `tick`, or until `mayGoOn` says no. Returns how many were made, and whether all are right. */
  show(tick: number, mayGoOn: () => boolean): { readonly made: number; readonly isRight: boolean } {
    if (tick === this.#shownTick && !this.#hasNews) return { made: 0, isRight: true };
    let made = 0;
    const chunks = this.#grid.chunks;
    for (let i = 0; i < chunks; i++) {
      const chunk = (this.#next + i) % chunks;
      if (!this.#clocks.isStale(chunk, tick)) continue;
      if (!mayGoOn()) {
        this.#next = chunk;
        this.#shownTick = -1;
        return { made, isRight: false };
      }
      this.#make(chunk, tick);
      made++;
    }
    this.#shownTick = tick;
    this.#hasNews = false;
    return { made, isRight: true };
  }

  dispose(): void {
    for (const mesh of this.#meshes) if (mesh !== undefined) freeFaces(mesh.geometry);
    this.#material.dispose();
  }

  #make(chunk: number, tick: number): void {
    const { times, kind } = this;
    const contains = kind.isBefore
      ? (cell: number): boolean => times[cell]! > tick && kind.counts(cell)
      : (cell: number): boolean => times[cell]! <= tick && kind.counts(cell);
    const isAny = this.#grid.fill(chunk, this.#padded, contains);
    const origin = this.#grid.origin(chunk);
    const block = { edge: this.#edge, origin, padded: this.#padded };
    const quads = isAny ? this.#mesher.surface(block, false) : new Uint16Array(0);
    this.#clocks.made(chunk, tick);
    let mesh = this.#meshes[chunk];
    if (mesh === undefined && quads.length === 0) return;
    const low = new Vector3(...origin);
    const geometry = facesGeometry(quads, this.index, low, low.clone().addScalar(this.#edge));
    if (mesh === undefined) {
      mesh = new Mesh(geometry, this.#material);
      mesh.renderOrder = kind.renderOrder;
      this.#meshes[chunk] = mesh;
      this.group.add(mesh);
    } else {
      freeFaces(mesh.geometry);
      mesh.geometry = geometry;
    }
    mesh.visible = quads.length > 0;
  }
}
