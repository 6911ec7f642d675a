/** The hits of a scan as points, from warm (near) to cool (far). */

import { BufferAttribute, BufferGeometry, GLSL3, Points, RawShaderMaterial, Vector3 } from "three";
import type { Hits, Vec3 } from "../data/run.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type SharedUniforms } from "./glsl.ts";

const VERTEX = /* glsl */ `${VERTEX_HEAD}
in vec3 point;
uniform vec3 from;
out vec3 vTint;
void main() {
  float share = 1.0 - exp(-distance(point, from) / 14.0);
  vTint = mix(mix(vec3(1.0, 0.86, 0.45), vec3(0.45, 0.95, 0.75), smoothstep(0.0, 0.5, share)),
    vec3(0.35, 0.6, 1.0), smoothstep(0.5, 1.0, share));
  vec4 view = viewMatrix * vec4(point, 1.0);
  // Offset towards the camera, so that points lie on walls rather than in them.
  gl_Position = projectionMatrix * vec4(view.xyz * 0.997, 1.0);
  gl_PointSize = pixelRatio * clamp(0.09 / (pixelM * pixelRatio * -view.z), 1.6, 5.0);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec3 vTint;
void main() {
  vec2 at = gl_PointCoord * 2.0 - 1.0;
  if (dot(at, at) > 1.0) discard;
  colour = vec4(vTint, 0.9);
}
`;

export class HitPoints {
  readonly points: Points<BufferGeometry, RawShaderMaterial>;
  #shown: Hits | null = null;

  constructor(common: SharedUniforms) {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { ...common, from: { value: new Vector3() } },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      transparent: true,
      depthWrite: false,
    });
    this.points = new Points(new BufferGeometry(), material);
    this.points.frustumCulled = false;
    this.points.renderOrder = 5;
  }

  /** `from` is the position of the scan. */
  show(hits: Hits | null, from: Vec3): void {
    this.points.visible = hits !== null && hits.positions.length > 0;
    if (hits === this.#shown || hits === null) return;
    this.#shown = hits;
    this.points.geometry.dispose();
    this.points.geometry = new BufferGeometry();
    this.points.geometry.setAttribute("point", new BufferAttribute(hits.positions, 3));
    this.points.geometry.setDrawRange(0, hits.positions.length / 3);
    (this.points.material.uniforms.from!.value as Vector3).set(...from);
  }

  dispose(): void {
    this.points.geometry.dispose();
    this.points.material.dispose();
  }
}
