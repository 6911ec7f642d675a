/** A triangle that covers the whole frame, as attribute `at` in clip coordinates. */

import { BufferAttribute, BufferGeometry } from "three";

export function screenTriangle(): BufferGeometry {
  const geometry = new BufferGeometry();
  geometry.setAttribute("at", new BufferAttribute(new Float32Array([-1, -1, 3, -1, -1, 3]), 2));
  // Three.js counts vertices by an attribute that these shaders do not have.
  geometry.setDrawRange(0, 3);
  return geometry;
}
