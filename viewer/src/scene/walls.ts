/**
 * The walls of the cave: faces between rock and free cells, coloured by when the free cell was
 * seen.
 *
 * Faces towards the camera are solid; those that look away, between the camera and the inside of
 * the cave, are a faint shell or omitted, so that the cave looks like a model cut open. Where the
 * map is cut, a rim of rock is drawn around the free space. All colours come from textures, so
 * another time costs nothing here.
 *
 * Faces are built chunk by chunk, a few per frame; they never change.
 */

import {
  BackSide,
  DataTexture,
  FrontSide,
  GLSL3,
  Group,
  LinearFilter,
  RawShaderMaterial,
  RGBAFormat,
  Vector3,
} from "three";
import { Grid } from "./chunks.ts";
import { heatRgb } from "./colours.ts";
import { Faces, FacesMesh, type QuadBuffers } from "./faces.ts";
import { setDefines, type SharedUniforms } from "./glsl.ts";
import type { BlockModel } from "./block-model.ts";
import { CORNERS, FACING_ORDER, Mesher, NUMBERS_PER_CORNER } from "./mesher.ts";
import type { OcclusionUniforms, TimesVolume } from "./volumes.ts";
import {
  CELL_PX_LEAST,
  GLASS_BELOW,
  RIM_FRAGMENT,
  RIM_VERTEX,
  WALL_FRAGMENT,
  WALL_SHELL_FRAGMENT,
  WALL_SHELL_VERTEX,
  WALL_VERTEX,
} from "./wall-shaders.ts";

const EDGE = 32;
/** Lighting is per vertex, so rectangles must be short; cells. */
const LONGEST = 4;

/** Appearance of the walls. */
export interface WallLook {
  readonly isVisible: boolean;
  readonly opacity: number;
  readonly isHeat: boolean;
  /** End of the scale of `heat`, ticks. */
  readonly heatTicks: number;
  /** Times at which one agent learned of the cells, and its colour. */
  readonly known: { readonly volume: TimesVolume; readonly colour: Vector3 } | null;
}

export class Walls {
  readonly group = new Group();
  readonly #shell = new Group();
  readonly #faces: FacesMesh[] = [];
  readonly #rim: FacesMesh;
  readonly #grid: Grid;
  readonly #mesher = new Mesher(LONGEST);
  readonly #padded = new Uint8Array((EDGE + 2) ** 3);
  readonly #front: RawShaderMaterial;
  readonly #back: RawShaderMaterial;
  readonly #rimMaterial: RawShaderMaterial;
  readonly #heat = heatTexture();
  #built = 0;
  #rimKey = "";

  constructor(
    readonly model: BlockModel,
    readonly buffers: QuadBuffers,
    readonly common: SharedUniforms,
    times: TimesVolume,
    occlusion: OcclusionUniforms,
  ) {
    this.#grid = new Grid(model.size, EDGE);
    const own = {
      cellM: { value: model.cellM },
      times: { value: times.texture },
      known: { value: times.texture },
      knownColour: { value: new Vector3() },
      heatScale: { value: 1 },
      heat: { value: this.#heat },
      opacity: { value: 0 },
    };
    const uniforms = { ...common, ...occlusion, ...own };
    const shared = { glslVersion: GLSL3, uniforms, vertexShader: WALL_VERTEX };
    this.#front = new RawShaderMaterial({ ...shared, fragmentShader: WALL_FRAGMENT, side: FrontSide });
    this.#back = new RawShaderMaterial({
      ...shared,
      vertexShader: WALL_SHELL_VERTEX,
      fragmentShader: WALL_SHELL_FRAGMENT,
      side: BackSide,
      transparent: true,
      depthWrite: false,
    });
    this.#rimMaterial = new RawShaderMaterial({
      ...shared,
      vertexShader: RIM_VERTEX,
      fragmentShader: RIM_FRAGMENT,
      side: FrontSide,
      defines: { RIM: 1 },
    });
    this.#rim = new FacesMesh(this.#rimFaces(0, -1), this.#rimMaterial, false);
    this.#rim.mesh.frustumCulled = false;
    this.group.add(this.#shell, this.#rim.mesh);
  }

  /** Number of chunks whose faces are not built yet. */
  get missing(): number {
    return this.#grid.chunks - this.#built;
  }

  /** Builds the faces of one more chunk. */
  buildNext(): void {
    const chunk = this.#built++;
    const { walls } = this.model;
    if (!this.#grid.fill(chunk, this.#padded, (cell) => walls[cell] === 0)) return;
    const origin = this.#grid.origin(chunk);
    const surface = this.#mesher.surface({ edge: EDGE, origin, padded: this.#padded }, true);
    if (surface.corners.length === 0) return;
    const faces = new Faces(surface, this.buffers, origin, [
      origin[0] + EDGE,
      origin[1] + EDGE,
      origin[2] + EDGE,
    ]);
    const front = new FacesMesh(faces, this.#front, false);
    const back = new FacesMesh(faces, this.#back, true);
    back.mesh.renderOrder = 6;
    this.#faces.push(front, back);
    this.group.add(front.mesh);
    this.#shell.add(back.mesh);
  }

  /** Prepares a frame for a camera position in cells. */
  show(look: WallLook, eye: Vector3, isCut: boolean): void {
    const shared = [
      ...(isCut ? ["CUT"] : []),
      ...(look.isHeat ? ["HEAT"] : []),
      ...(look.known !== null ? ["KNOWN"] : []),
    ];
    setDefines(this.#front, [...shared, ...(this.#hasEdges(eye) ? ["EDGES"] : [])]);
    setDefines(this.#back, [...shared, ...(look.opacity < GLASS_BELOW ? ["GLASS"] : [])]);
    for (const faces of this.#faces) faces.selectFacing(eye);
    this.#rim.selectFacing(eye);
    this.group.visible = look.isVisible;
    this.#shell.visible = look.opacity > 0;
    const { uniforms } = this.#front;
    uniforms.opacity!.value = look.opacity;
    uniforms.heatScale!.value = 1 / Math.max(look.heatTicks, 1);
    if (look.known !== null) {
      uniforms.known!.value = look.known.volume.texture;
      (uniforms.knownColour!.value as Vector3).copy(look.known.colour);
    }
    const isSolid = look.opacity >= 1;
    this.#back.depthWrite = isSolid;
  }

  /**
   * Draws the rim of rock where the map is cut beyond `positionCells` along an axis; null: it is not
   * cut.
   */
  cutAt(cut: { readonly axis: number; readonly positionCells: number } | null): void {
    const layer = cut === null ? -1 : Math.ceil(cut.positionCells) - 1;
    const { mesh } = this.#rim;
    mesh.visible = cut !== null && layer >= 0 && layer < this.model.size[cut.axis]!;
    if (cut === null || !mesh.visible) return;
    const key = `${cut.axis} ${layer}`;
    if (key !== this.#rimKey) this.#rim.replace(this.#rimFaces(cut.axis, layer));
    this.#rimKey = key;
    mesh.position.set(0, 0, 0).setComponent(cut.axis, cut.positionCells - (layer + 1));
  }

  dispose(): void {
    for (const faces of [...this.#faces, this.#rim]) faces.dispose();
    for (const material of [this.#front, this.#back, this.#rimMaterial]) material.dispose();
    this.#heat.dispose();
  }

  /** Whether any cell is near enough for its edges to be drawn. */
  #hasEdges(eye: Vector3): boolean {
    const nearest = eye.clone().clamp(new Vector3(), new Vector3(...this.model.size));
    return nearest.distanceTo(eye) * this.common.pixelM.value * CELL_PX_LEAST < 1;
  }

  #rimFaces(axis: number, layer: number): Faces {
    const corners = layer < 0 ? new Uint16Array(0) : rimOf(this.model, axis, layer);
    const count = corners.length / (NUMBERS_PER_CORNER * CORNERS);
    const ends = FACING_ORDER.map((_, slot) => (slot < FACING_ORDER.indexOf(axis * 2) ? 0 : count));
    return new Faces({ corners, ends }, this.buffers, [0, 0, 0], this.model.size, false);
  }
}

/**
 * The rim: rock of a layer with a free cell of the layer among its eight neighbours, as faces along
 * the axis.
 */
function rimOf(model: BlockModel, axis: number, layer: number): Uint16Array {
  const { size, walls } = model;
  const strides = [1, size[0], size[0] * size[1]] as const;
  const [u, v] = axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
  const isFree = (i: number, j: number): boolean =>
    i >= 0 &&
    j >= 0 &&
    i < size[u!]! &&
    j < size[v!]! &&
    walls[layer * strides[axis]! + i * strides[u!]! + j * strides[v!]!] === 0;
  const quads: number[] = [];
  for (let j = 0; j < size[v!]!; j++) {
    for (let i = 0; i < size[u!]!; i++) {
      if (isFree(i, j)) continue;
      let isRim = false;
      for (const [di, dj] of AROUND) isRim ||= isFree(i + di, j + dj);
      if (!isRim) continue;
      const turn = axis === 1 ? [0, 3, 2, 1] : [0, 1, 2, 3];
      for (const corner of turn) {
        const vertex = [0, 0, 0];
        vertex[axis] = layer + 1;
        vertex[u!] = i + (corner === 1 || corner === 2 ? 1 : 0);
        vertex[v!] = j + (corner >= 2 ? 1 : 0);
        quads.push(...vertex, axis * 2);
      }
    }
  }
  return Uint16Array.from(quads);
}

const AROUND: readonly (readonly [number, number])[] = [
  [-1, -1],
  [0, -1],
  [1, -1],
  [-1, 0],
  [1, 0],
  [-1, 1],
  [0, 1],
  [1, 1],
];

function heatTexture(): DataTexture {
  const texels = new Uint8Array(256 * 4);
  for (let texel = 0; texel < 256; texel++) {
    const colour = heatRgb(texel / 255);
    texels.set([...colour.map((share) => Math.round(share * 255)), 255], texel * 4);
  }
  const texture = new DataTexture(texels, 256, 1, RGBAFormat);
  texture.minFilter = LinearFilter;
  texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
