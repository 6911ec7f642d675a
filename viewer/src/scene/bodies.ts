/**
 * The bodies of agents: a hull in the agent's colour between four ring guards, and a bright nose
 * that shows the heading.
 *
 * A body has its true size, but at least a few pixels on the screen. Behind walls it is a pale
 * silhouette.
 */

import {
  BoxGeometry,
  BufferAttribute,
  GLSL3,
  GreaterDepth,
  LessEqualDepth,
  Mesh,
  RawShaderMaterial,
  SphereGeometry,
  TorusGeometry,
  type BufferGeometry,
} from "three";
import { mergeGeometries } from "three/examples/jsm/utils/BufferGeometryUtils.js";
import type { Vec3 } from "../data/run.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type SharedUniforms } from "./glsl.ts";

const VERTEX = /* glsl */ `${VERTEX_HEAD}
in vec3 position;
in vec3 normal;
in float part;
out vec3 vNormal;
out vec3 vPositionM;
flat out int vPart;
void main() {
  vec4 world = modelMatrix * vec4(position, 1.0);
  vNormal = mat3(modelMatrix) * normal;
  vPositionM = world.xyz;
  vPart = int(part);
  gl_Position = projectionMatrix * viewMatrix * world;
}
`;

const GHOST_FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
uniform vec3 tint;
void main() {
  colour = vec4(tint, 0.42);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec3 vNormal;
in vec3 vPositionM;
flat in int vPart;
uniform vec3 tint;
void main() {
  vec3 n = normalize(vNormal);
  vec3 toEye = normalize(eye - vPositionM);
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

/** Minimum radius of a body on the screen, CSS pixels. */
export const BODY_RADIUS_PX = 10;

export class Bodies {
  readonly meshes: readonly Mesh<BufferGeometry, RawShaderMaterial>[];
  /** For each agent the body and its silhouette behind walls. */
  readonly #pairs: readonly (readonly [Mesh, Mesh])[];
  readonly #fine = bodyGeometry(true);
  readonly #coarse = bodyGeometry(false);

  constructor(common: SharedUniforms, colours: readonly (readonly [number, number, number])[]) {
    const make = (
      colour: readonly [number, number, number],
      isGhost: boolean,
    ): Mesh<BufferGeometry, RawShaderMaterial> => {
      const material = new RawShaderMaterial({
        glslVersion: GLSL3,
        uniforms: { ...common, tint: { value: colour } },
        vertexShader: VERTEX,
        fragmentShader: isGhost ? GHOST_FRAGMENT : FRAGMENT,
        transparent: isGhost,
        depthWrite: !isGhost,
        depthFunc: isGhost ? GreaterDepth : LessEqualDepth,
      });
      const mesh = new Mesh(this.#coarse, material);
      mesh.renderOrder = isGhost ? 4 : 2;
      return mesh;
    };
    const pairs = colours.map((colour) => [make(colour, false), make(colour, true)] as const);
    this.#pairs = pairs;
    this.meshes = pairs.flat();
  }

  show(id: number, position: Vec3, yawRad: number, radiusM: number, isLarge: boolean): void {
    for (const mesh of this.#pairs[id]!) {
      mesh.position.set(...position);
      mesh.rotation.set(0, 0, yawRad);
      mesh.scale.setScalar(radiusM);
      mesh.geometry = isLarge ? this.#fine : this.#coarse;
    }
  }

  dispose(): void {
    this.#fine.dispose();
    this.#coarse.dispose();
    for (const mesh of this.meshes) mesh.material.dispose();
  }
}

/** A body of radius 1 facing +x, with a fine or a coarse tessellation. */
function bodyGeometry(isFine: boolean): BufferGeometry {
  const [around, along] = isFine ? [20, 12] : [8, 5];
  const hull = new SphereGeometry(1, around, along).scale(0.78, 0.34, 0.3);
  const nose = new SphereGeometry(0.19, isFine ? 12 : 6, isFine ? 8 : 4).translate(0.7, 0, 0.02);
  const fin = new BoxGeometry(0.36, 0.05, 0.36).translate(-0.6, 0, 0.24);
  const beams = [1, -1].map((turn) => new BoxGeometry(1.3, 0.09, 0.07).rotateZ((turn * Math.PI) / 4));
  const guards = [0, 1, 2, 3].map((corner) => {
    const [x, y] = [corner & 1 ? 0.5 : -0.5, corner & 2 ? 0.5 : -0.5];
    return new TorusGeometry(0.34, 0.055, isFine ? 6 : 3, isFine ? 20 : 9).translate(x, y, 0.04);
  });
  const parts: readonly (readonly [BufferGeometry, number])[] = [
    [hull, 0],
    [nose, 1],
    [fin, 0],
    ...beams.map((beam) => [beam, 2] as const),
    ...guards.map((guard) => [guard, 0] as const),
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
