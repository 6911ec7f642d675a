/**
 * The bodies of agents: a hull in the agent's colour within a guard ring, with a bright nose that shows the heading.
 *
 * A body is as large as it is in the run, but never smaller on the screen than a few pixels.
 */

import { BoxGeometry, BufferAttribute, GLSL3, Mesh, RawShaderMaterial, SphereGeometry, TorusGeometry, type BufferGeometry } from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Vec3 } from "../data/run.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type Common } from "./glsl.ts";

const VERTEX = /* glsl */ `${VERTEX_HEAD}
in vec3 position;
in vec3 normal;
in float part;
out vec3 vNormal;
out vec3 vPlaceM;
flat out int vPart;
void main() {
  vec4 place = modelMatrix * vec4(position, 1.0);
  vNormal = mat3(modelMatrix) * normal;
  vPlaceM = place.xyz;
  vPart = int(part);
  gl_Position = projectionMatrix * viewMatrix * place;
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec3 vNormal;
in vec3 vPlaceM;
flat in int vPart;
uniform vec3 tint;
void main() {
  vec3 n = normalize(vNormal);
  vec3 toEye = normalize(eye - vPlaceM);
  float key = max(dot(n, light), 0.0);
  float rim = pow(1.0 - max(dot(n, toEye), 0.0), 3.0);
  float shine = pow(max(dot(n, normalize(light + toEye)), 0.0), 40.0);
  vec3 paint = square(tint);
  vec3 base = vPart == 0 ? paint : vPart == 1 ? vec3(1.0) : paint * 0.3 + 0.02;
  vec3 lit = base * (0.34 + 0.12 * n.z + 0.8 * key) + paint * rim * 0.7 + vec3(0.5) * shine;
  if (vPart == 1) lit = vec3(1.0, 0.98, 0.9);
  colour = vec4(shown(lit), 1.0);
}
`;

/** Half the width of the body on the screen, at least; CSS pixels. */
export const BODY_RADIUS_PX = 6;

export class Bodies {
  readonly meshes: readonly Mesh<BufferGeometry, RawShaderMaterial>[];
  readonly #geometry = bodyGeometry();

  constructor(common: Common, colours: readonly (readonly [number, number, number])[]) {
    this.meshes = colours.map((colour) => {
      const material = new RawShaderMaterial({
        glslVersion: GLSL3,
        uniforms: { ...common, tint: { value: colour } },
        vertexShader: VERTEX,
        fragmentShader: FRAGMENT,
      });
      const mesh = new Mesh(this.#geometry, material);
      mesh.renderOrder = 2;
      return mesh;
    });
  }

  show(id: number, place: Vec3, yawRad: number, radiusM: number): void {
    const mesh = this.meshes[id]!;
    mesh.position.set(...place);
    mesh.rotation.set(0, 0, yawRad);
    mesh.scale.setScalar(radiusM);
  }

  dispose(): void {
    this.#geometry.dispose();
    for (const mesh of this.meshes) mesh.material.dispose();
  }
}

/** A body of radius 1 that looks along +x. */
function bodyGeometry(): BufferGeometry {
  const hull = new SphereGeometry(1, 20, 14).scale(0.72, 0.5, 0.42);
  const ring = new TorusGeometry(0.9, 0.085, 8, 32);
  const nose = new SphereGeometry(0.17, 12, 8).translate(0.68, 0, 0.04);
  const beam = new BoxGeometry(0.1, 1.75, 0.07);
  const fin = new BoxGeometry(0.34, 0.05, 0.42).translate(-0.62, 0, 0.28);
  const parts: readonly (readonly [BufferGeometry, number])[] = [
    [hull, 0],
    [nose, 1],
    [ring, 0],
    [beam, 2],
    [fin, 0],
  ];
  for (const [geometry, part] of parts) {
    const count = geometry.getAttribute("position").count;
    geometry.setAttribute("part", new BufferAttribute(new Float32Array(count).fill(part), 1));
    geometry.deleteAttribute("uv");
  }
  const merged = mergeGeometries(parts.map(([geometry]) => geometry));
  for (const [geometry] of parts) geometry.dispose();
  merged.computeBoundingSphere();
  return merged;
}
