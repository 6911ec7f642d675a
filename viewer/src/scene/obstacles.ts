/**
 * The moving obstacles of a run: striped spheres and boxes, so that they are not taken for agents.
 *
 * An obstacle has its true size, but at least that of a body on the screen. Behind walls it is a
 * pale silhouette. All spheres are one mesh, and so are all boxes.
 */

import {
  BoxGeometry,
  GLSL3,
  GreaterDepth,
  Group,
  InstancedMesh,
  LessEqualDepth,
  Matrix4,
  Quaternion,
  RawShaderMaterial,
  SphereGeometry,
  Vector3,
  type BufferGeometry,
} from "three";
import type { ObstacleShape, Run, Vec3 } from "../data/run.ts";
import { BODY_RADIUS_PX } from "./bodies.ts";
import { FRAGMENT_HEAD, VERTEX_HEAD, type SharedUniforms } from "./glsl.ts";
import { nearest, onScreen, type OnScreen, type Viewport } from "./on-screen.ts";

/** Stripes across the longest edge of an obstacle. */
const STRIPES = 5;

const VERTEX = /* glsl */ `${VERTEX_HEAD}
in vec3 position;
in vec3 normal;
in mat4 instanceMatrix;
out vec3 vNormal;
out vec3 vPositionM;
out float vStripe;
void main() {
  vec3 size = vec3(instanceMatrix[0].x, instanceMatrix[1].y, instanceMatrix[2].z);
  vec4 world = instanceMatrix * vec4(position, 1.0);
  vNormal = normalize(normal / size);
  vPositionM = world.xyz;
  vStripe = dot(position * size, vec3(1.0)) / max(size.x, max(size.y, size.z)) * ${STRIPES}.0;
  gl_Position = projectionMatrix * viewMatrix * world;
}
`;

const GHOST_FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
void main() {
  colour = vec4(mix(vec3(0.95), vec3(0.25), paper), 0.42);
}
`;

const FRAGMENT = /* glsl */ `${FRAGMENT_HEAD}
in vec3 vNormal;
in vec3 vPositionM;
in float vStripe;
void main() {
  vec3 n = normalize(vNormal);
  float key = max(dot(n, light), 0.0);
  // Stripes that are too narrow for the pixels become their mean.
  float width = fwidth(vStripe);
  float wave = abs(fract(vStripe) - 0.5) - 0.25;
  float dark = mix(clamp(wave / max(width, 1e-4) + 0.5, 0.0, 1.0), 0.5, smoothstep(0.4, 0.8, width));
  vec3 base = mix(vec3(0.95), vec3(0.02), dark);
  colour = vec4(shown(base * (0.4 + 0.12 * n.z + 0.6 * key)), 1.0);
}
`;

/** An obstacle that has a shape and is somewhere. */
interface PlacedObstacle extends OnScreen {
  readonly number: number;
}

/** Obstacles of one kind, by number. */
interface KindMeshes {
  readonly numbers: readonly number[];
  readonly meshes: readonly InstancedMesh<BufferGeometry, RawShaderMaterial>[];
}

export class Obstacles {
  readonly root = new Group();
  readonly #kinds: readonly KindMeshes[];
  #onScreen: readonly PlacedObstacle[] = [];

  constructor(
    readonly run: Run,
    common: SharedUniforms,
  ) {
    const { obstacles } = run.setup;
    this.#kinds = (["sphere", "box"] as const).flatMap((kind) => {
      const numbers = [...obstacles.keys()].filter((number) => obstacles[number]?.kind === kind);
      return numbers.length === 0 ? [] : [{ numbers, meshes: meshesOf(kind, numbers.length, common) }];
    });
    for (const { meshes } of this.#kinds) this.root.add(...meshes);
  }

  show(timeS: number, viewport: Viewport): void {
    this.#onScreen = this.#kinds.flatMap(({ numbers, meshes }) => {
      const placed: PlacedObstacle[] = [];
      for (const number of numbers) {
        const position = this.run.obstacleAt(number, timeS);
        if (position === null) continue;
        const sizeM = sizeOf(this.run.setup.obstacles[number]!);
        const trueM = Math.max(...sizeM) / 2;
        const shown = onScreen(position, trueM, BODY_RADIUS_PX, viewport);
        const matrix = matrixOf(position, sizeM, shown.radiusPx / shown.trueRadiusPx);
        for (const mesh of meshes) mesh.setMatrixAt(placed.length, matrix);
        placed.push({ ...shown, number });
      }
      for (const mesh of meshes) {
        mesh.count = placed.length;
        mesh.instanceMatrix.needsUpdate = true;
      }
      return placed;
    });
  }

  /** The obstacle at a position of the canvas in the last frame. */
  pick(x: number, y: number): number | null {
    return nearest(this.#onScreen, x, y)?.number ?? null;
  }

  dispose(): void {
    for (const { meshes } of this.#kinds) {
      for (const mesh of meshes) {
        mesh.dispose();
        mesh.geometry.dispose();
        mesh.material.dispose();
      }
    }
  }
}

/** Edges of the box around a shape, metres. */
export function sizeOf(shape: ObstacleShape): Vec3 {
  if (shape.kind === "box") return shape.sizeM;
  const edgeM = 2 * shape.radiusM;
  return [edgeM, edgeM, edgeM];
}

/** Places a shape of edge 1. */
function matrixOf(position: Vec3, sizeM: Vec3, factor: number): Matrix4 {
  const scale = new Vector3(...sizeM).multiplyScalar(factor);
  return new Matrix4().compose(new Vector3(...position), new Quaternion(), scale);
}

/** Obstacles of edge 1, and their silhouettes behind walls. */
function meshesOf(
  kind: ObstacleShape["kind"],
  count: number,
  common: SharedUniforms,
): InstancedMesh<BufferGeometry, RawShaderMaterial>[] {
  const geometry = kind === "box" ? new BoxGeometry() : new SphereGeometry(0.5, 24, 16);
  return [false, true].map((isGhost) => {
    const material = new RawShaderMaterial({
      glslVersion: GLSL3,
      uniforms: { ...common },
      vertexShader: VERTEX,
      fragmentShader: isGhost ? GHOST_FRAGMENT : FRAGMENT,
      transparent: isGhost,
      depthWrite: !isGhost,
      depthFunc: isGhost ? GreaterDepth : LessEqualDepth,
    });
    const mesh = new InstancedMesh(geometry, material, count);
    mesh.frustumCulled = false;
    mesh.renderOrder = isGhost ? 4 : 2;
    return mesh;
  });
}
