/**
 * Meshes of the mesher's rectangles for three.js.
 *
 * All geometries share one index buffer, so each consists of its corners only. Shaders derive the
 * corner number from `gl_VertexID`. Only face directions that can be visible from the camera are
 * drawn.
 */

import {
  BufferAttribute,
  BufferGeometry,
  Mesh,
  Sphere,
  Uint32BufferAttribute,
  Vector3,
  type RawShaderMaterial,
} from "three";
import type { Size } from "./chunks.ts";
import { occlusionAt, type AmbientOcclusion } from "./ambient-occlusion.ts";
import { CORNERS, FACING_ORDER, NUMBERS_PER_CORNER, type Surface } from "./mesher.ts";

/** The index buffer, as large as the largest geometry needs. */
export class QuadIndex {
  #attribute = new Uint32BufferAttribute(quadIndices(1024), 1);

  for(quads: number): BufferAttribute {
    if (this.#attribute.count < quads * 6) {
      const capacity = 2 ** Math.ceil(Math.log2(quads));
      this.#attribute = new Uint32BufferAttribute(quadIndices(capacity), 1);
    }
    return this.#attribute;
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

/** A surface with its ambient occlusion as vertex attributes; several meshes may draw it. */
export class Faces {
  readonly #attributes: Readonly<Record<string, BufferAttribute>>;

  /** `low` and `high` bound the surface, in cells. */
  constructor(
    readonly surface: Surface,
    occlusion: AmbientOcclusion,
    readonly index: QuadIndex,
    readonly low: Size,
    readonly high: Size,
  ) {
    const { each, mean } = occlusionAt(occlusion, surface.corners);
    this.#attributes = {
      corner: new BufferAttribute(surface.corners, NUMBERS_PER_CORNER),
      occlusion: new BufferAttribute(each, 4, true),
      occlusionMean: new BufferAttribute(mean, 4, true),
    };
  }

  geometry(): BufferGeometry {
    const geometry = new BufferGeometry();
    for (const [name, attribute] of Object.entries(this.#attributes)) geometry.setAttribute(name, attribute);
    geometry.setIndex(this.index.for(this.surface.ends.at(-1)!));
    const [low, high] = [new Vector3(...this.low), new Vector3(...this.high)];
    geometry.boundingSphere = new Sphere(low.clone().add(high).multiplyScalar(0.5), high.distanceTo(low) / 2);
    return geometry;
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
  }

  /** Draws other faces from now on. */
  replace(faces: Faces): void {
    this.#faces = faces;
    this.#drawn = -1;
    this.dispose();
    this.mesh.geometry = faces.geometry();
  }

  /** Selects the directions that can be visible from a camera position in cells. */
  selectFacing(eye: Vector3): void {
    const { low, high, surface } = this.#faces;
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
      const end = surface.ends[slot]!;
      const isDrawn = ((drawn >> facing) & 1) === 1;
      if (isDrawn) to = end;
      if (!isDrawn || slot === FACING_ORDER.length - 1) {
        if (to > from) geometry.addGroup(from * 6, (to - from) * 6, 0);
        from = end;
        to = end;
      }
    }
  }

  /** Disposes of the geometry, but not of the shared index buffer. */
  dispose(): void {
    this.mesh.geometry.setIndex(null);
    this.mesh.geometry.dispose();
  }
}
