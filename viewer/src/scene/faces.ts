/**
 * Meshes of the mesher's rectangles for three.js.
 *
 * All geometries share one index buffer, so each consists of its corners only: 32 bits for each,
 * which are in the memory of the GPU alone. Shaders derive the corner number from `gl_VertexID`, and
 * ambient occlusion from a texture. Only face directions that can be visible from the camera are
 * drawn.
 */

import {
  BufferAttribute,
  BufferGeometry,
  GLBufferAttribute,
  Mesh,
  Sphere,
  Uint32BufferAttribute,
  Vector3,
  type NormalOrGLBufferAttributes,
  type RawShaderMaterial,
} from "three";
import type { Size } from "./chunks.ts";
import { CORNERS, FACING_ORDER, NUMBERS_PER_CORNER, type Surface } from "./mesher.ts";

/** The index buffer, as large as the largest geometry needs, and the way of corners to the GPU. */
export class QuadBuffers {
  #index = new Uint32BufferAttribute(quadIndices(1024), 1);
  /** Corners on their way: browsers keep arrays that were given to the GPU for long. */
  #staged = new Uint32Array(1024 * CORNERS);

  constructor(readonly gl: WebGL2RenderingContext) {}

  indexFor(quads: number): BufferAttribute {
    if (this.#index.count < quads * 6) {
      const capacity = 2 ** Math.ceil(Math.log2(quads));
      this.#index = new Uint32BufferAttribute(quadIndices(capacity), 1);
    }
    return this.#index;
  }

  /** Corners in the memory of the GPU, packed; see `pack`. */
  upload(corners: Uint16Array, origin: Size): GLBufferAttribute {
    const { gl } = this;
    const count = corners.length / NUMBERS_PER_CORNER;
    if (count > this.#staged.length) this.#staged = new Uint32Array(2 ** Math.ceil(Math.log2(count)));
    pack(corners, origin, this.#staged);
    const buffer = gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
    gl.bufferData(gl.ARRAY_BUFFER, this.#staged, gl.STATIC_DRAW, 0, count);
    return new GLBufferAttribute(buffer, gl.UNSIGNED_INT, 1, 4, count);
  }
}

/** Two triangles per four corners. */
export function quadIndices(quads: number): Uint32Array {
  const indices = new Uint32Array(quads * 6);
  for (let quad = 0; quad < quads; quad++) {
    const [at, first] = [quad * 6, quad * CORNERS];
    indices.set([first, first + 1, first + 2, first, first + 2, first + 3], at);
  }
  return indices;
}

/** Bits of a packed corner for each coordinate, and for each length of its rectangle. */
const PLACE_BITS = 6;
const LENGTH_BITS = 3;

/**
 * The corners of rectangles in a cube, packed: from the lowest bit x, y and z relative to the lowest
 * cell of the cube, the direction, and the lengths of the rectangle along the two axes across it,
 * the lower one first. `PACKED_CORNER` (`glsl.ts`) reads them.
 */
export function pack(corners: Uint16Array, origin: Size, words: Uint32Array): void {
  for (let at = 0; at < corners.length; at += CORNERS * NUMBERS_PER_CORNER) {
    const opposite = at + 2 * NUMBERS_PER_CORNER;
    const facing = corners[at + 3]!;
    const axis = facing >> 1;
    const [u, v] = axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
    const lengthU = Math.abs(corners[at + u]! - corners[opposite + u]!);
    const lengthV = Math.abs(corners[at + v]! - corners[opposite + v]!);
    const shared = ((((lengthV << LENGTH_BITS) | lengthU) << 3) | facing) << (3 * PLACE_BITS);
    for (let corner = 0; corner < CORNERS; corner++) {
      const from = at + corner * NUMBERS_PER_CORNER;
      const x = corners[from]! - origin[0];
      const y = corners[from + 1]! - origin[1];
      const z = corners[from + 2]! - origin[2];
      words[from / NUMBERS_PER_CORNER] = shared | (((z << PLACE_BITS) | y) << PLACE_BITS) | x;
    }
  }
}

/** Rectangles as a vertex attribute; several meshes may draw it. */
export class Faces {
  /** Where meshes of it are placed, cells: coordinates in the attribute are relative to it. */
  readonly origin: Vector3;
  /** Number of rectangles up to the end of each direction of `FACING_ORDER`. */
  readonly ends: readonly number[];
  readonly #corner: BufferAttribute | GLBufferAttribute;

  /**
   * `low` and `high` bound the surface, in cells. Without `isPacked` corners are as in the surface,
   * for places and lengths that do not fit the bits of packed ones.
   */
  constructor(
    { corners, ends }: Surface,
    readonly buffers: QuadBuffers,
    readonly low: Size,
    readonly high: Size,
    isPacked = true,
  ) {
    this.ends = ends;
    this.origin = isPacked ? new Vector3(...low) : new Vector3();
    this.#corner = isPacked ? buffers.upload(corners, low) : new BufferAttribute(corners, NUMBERS_PER_CORNER);
  }

  geometry(): BufferGeometry {
    const geometry = new BufferGeometry<NormalOrGLBufferAttributes>();
    geometry.setAttribute("corner", this.#corner);
    geometry.setIndex(this.buffers.indexFor(this.ends.at(-1)!));
    const [low, high] = [this.low, this.high].map((end) => new Vector3(...end).sub(this.origin));
    geometry.boundingSphere = new Sphere(
      low!.clone().add(high!).multiplyScalar(0.5),
      high!.distanceTo(low!) / 2,
    );
    // The types of meshes do not know that three.js draws these attributes as well.
    return geometry as BufferGeometry;
  }

  /** Three.js knows the corners of drawn geometries only. */
  dispose(): void {
    if (this.#corner instanceof GLBufferAttribute) this.buffers.gl.deleteBuffer(this.#corner.buffer);
  }
}

/** Mesh of the faces that look at the camera, or of those that look away from it. */
export class FacesMesh {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial[]>;
  #faces: Faces;
  /** Bit set of the directions drawn. */
  #drawn = -1;

  constructor(
    faces: Faces,
    material: RawShaderMaterial,
    readonly looksAway: boolean,
  ) {
    this.#faces = faces;
    this.mesh = new Mesh(faces.geometry(), [material]);
    this.mesh.position.copy(faces.origin);
  }

  /** Draws other faces from now on. */
  replace(faces: Faces): void {
    this.dispose();
    this.#faces = faces;
    this.#drawn = -1;
    this.mesh.geometry = faces.geometry();
    this.mesh.position.copy(faces.origin);
  }

  /** Selects the directions that can be visible from a camera position in cells. */
  selectFacing(eye: Vector3): void {
    const { low, high, ends } = this.#faces;
    let drawn = 0;
    for (let axis = 0; axis < 3; axis++) {
      const coordinate = eye.getComponent(axis);
      const [isAbove, isBelow] = [coordinate > low[axis]!, coordinate < high[axis]!];
      if (this.looksAway ? isBelow : isAbove) drawn |= 1 << (2 * axis);
      if (this.looksAway ? isAbove : isBelow) drawn |= 2 << (2 * axis);
    }
    if (drawn === this.#drawn) return;
    this.#drawn = drawn;
    const { geometry } = this.mesh;
    geometry.clearGroups();
    let from = 0;
    let to = 0;
    for (const [slot, facing] of FACING_ORDER.entries()) {
      const end = ends[slot]!;
      const isDrawn = ((drawn >> facing) & 1) === 1;
      if (isDrawn) to = end;
      if (!isDrawn || slot === FACING_ORDER.length - 1) {
        if (to > from) geometry.addGroup(from * 6, (to - from) * 6, 0);
        from = end;
        to = end;
      }
    }
  }

  /** Disposes of the geometry and its faces, but not of the shared index buffer. */
  dispose(): void {
    this.mesh.geometry.setIndex(null);
    this.mesh.geometry.dispose();
    this.#faces.dispose();
  }
}
