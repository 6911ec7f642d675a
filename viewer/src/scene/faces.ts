/**
 * Rectangles of a mesher as something that three.js draws.
 *
 * All geometries share one list of indices, so each is just its corners. The shaders find the number of a corner in `gl_VertexID`.
 */

import { BufferAttribute, BufferGeometry, Sphere, Uint32BufferAttribute, Vector3 } from "three";
import { CORNERS, NUMBERS_PER_CORNER } from "./mesher.ts";

/** Indices of as many rectangles as the largest geometry has. */
export class QuadIndex {
  #attribute = quadIndices(1024);

  for(quads: number): BufferAttribute {
    if (this.#attribute.count < quads * 6) {
      let capacity = 1024;
      while (capacity < quads) capacity *= 2;
      this.#attribute = quadIndices(capacity);
    }
    return this.#attribute;
  }
}

/** Two triangles for each four corners. */
export function quadIndices(quads: number): BufferAttribute {
  const indices = new Uint32Array(quads * 6);
  for (let quad = 0; quad < quads; quad++) {
    const [at, first] = [quad * 6, quad * CORNERS];
    indices.set([first, first + 1, first + 2, first, first + 2, first + 3], at);
  }
  return new Uint32BufferAttribute(indices, 1);
}

/** A geometry of rectangles that lie within a box of cells. */
export function facesGeometry(quads: Uint16Array, index: QuadIndex, low: Vector3, high: Vector3): BufferGeometry {
  const geometry = new BufferGeometry();
  const count = quads.length / (NUMBERS_PER_CORNER * CORNERS);
  geometry.setAttribute("corner", new BufferAttribute(quads, NUMBERS_PER_CORNER));
  geometry.setIndex(index.for(count));
  geometry.setDrawRange(0, count * 6);
  geometry.boundingSphere = new Sphere(low.clone().add(high).multiplyScalar(0.5), high.distanceTo(low) / 2);
  return geometry;
}

/** Frees a geometry, but not the indices that others use. */
export function freeFaces(geometry: BufferGeometry): void {
  geometry.setIndex(null);
  geometry.dispose();
}
