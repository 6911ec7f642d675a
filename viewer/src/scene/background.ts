/** The background of the image: a dark radial gradient, or white. */

import { GLSL3, Mesh, RawShaderMaterial, type BufferGeometry } from "three";
import { FRAGMENT_HEAD, HEAD, type SharedUniforms } from "./glsl.ts";
import { screenTriangle } from "./screen-triangle.ts";

const VERTEX = /* glsl */ `${HEAD}
in vec2 at;
out vec2 vAt;
void main() {
  vAt = at;
  gl_Position = vec4(at, 1.0, 1.0);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec2 vAt;
void main() {
  vec2 p = vAt * vec2(min(frameSize.x / frameSize.y, 2.2) * 0.62, 1.0) - vec2(0.0, 0.12);
  float share = smoothstep(1.45, 0.0, length(p));
  vec3 c = mix(vec3(0.030, 0.037, 0.052), vec3(0.088, 0.108, 0.142), share);
  // Dithering hides the bands of the slow gradient.
  uvec2 q = uvec2(gl_FragCoord.xy);
  uint h = (q.x * 1597334677u) ^ (q.y * 3812015801u);
  h = (h ^ (h >> 15)) * 2246822519u;
  colour = vec4(mix(c + (float(h >> 24) / 255.0 - 0.5) / 255.0, vec3(1.0), paper), 1.0);
}
`;

export class Background {
  readonly mesh: Mesh<BufferGeometry, RawShaderMaterial>;

  constructor(common: SharedUniforms) {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { ...common },
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      depthTest: false,
      depthWrite: false,
    });
    this.mesh = new Mesh(screenTriangle(), material);
    this.mesh.frustumCulled = false;
    this.mesh.renderOrder = -1;
  }

  dispose(): void {
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
  }
}
