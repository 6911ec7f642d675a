import { InstancedMesh, Matrix4, PerspectiveCamera, Vector3 } from "three";
import { expect, test, vi } from "vitest";
import type { ObstacleShape, Run, Vec3 } from "../data/run.ts";
import { makeSharedUniforms } from "./glsl.ts";
import { Obstacles } from "./obstacles.ts";
import type { Viewport } from "./on-screen.ts";

/** A camera at the origin that looks along x, with z up. */
function viewport(): Viewport {
  const camera = new PerspectiveCamera(90, 2, 0.1, 1000);
  camera.up.set(0, 0, 1);
  camera.lookAt(1, 0, 0);
  camera.updateMatrixWorld();
  return { camera, width: 800, height: 400 };
}

function obstaclesOf(
  shapes: readonly (ObstacleShape | null)[],
  centres: readonly (Vec3 | null)[],
): Obstacles {
  const obstacleAt = (number: number, timeS: number): Vec3 | null => {
    const centre = centres[number] ?? null;
    return centre && [centre[0] + timeS, centre[1], centre[2]];
  };
  const run = { setup: { obstacles: shapes }, obstacleAt } as unknown as Run;
  return new Obstacles(run, makeSharedUniforms());
}

/** Position and scale of what the meshes show. */
function shownBy(obstacles: Obstacles): { position: number[]; scale: number[] }[] {
  return obstacles.root.children.flatMap((mesh) => {
    if (!(mesh instanceof InstancedMesh)) throw new Error("a mesh without instances");
    return Array.from({ length: mesh.count }, (_, instance) => {
      const matrix = new Matrix4();
      mesh.getMatrixAt(instance, matrix);
      const scale = new Vector3().setFromMatrixScale(matrix);
      return { position: new Vector3().setFromMatrixPosition(matrix).toArray(), scale: scale.toArray() };
    });
  });
}

const SPHERE: ObstacleShape = { kind: "sphere", radiusM: 2 };
const BOX: ObstacleShape = { kind: "box", sizeM: [1, 2, 4] };

test("a run without obstacles has nothing to draw", () => {
  const warn = vi.spyOn(console, "error");
  const obstacles = obstaclesOf([], []);
  expect(warn).not.toHaveBeenCalled();
  obstacles.show(0, viewport());
  expect(obstacles.root.children).toEqual([]);
  expect(obstacles.pick(400, 200)).toBeNull();
});

test("obstacles have their true places and sizes, each with its silhouette", () => {
  const obstacles = obstaclesOf([BOX, SPHERE, null, BOX], [[9, 0, 0], [19, 5, 1], [9, 9, 9], null]);
  obstacles.show(1, viewport());
  const sphere = { position: [20, 5, 1], scale: [4, 4, 4] };
  const box = { position: [10, 0, 0], scale: [1, 2, 4] };
  expect(shownBy(obstacles)).toEqual([sphere, sphere, box, box]);
});

test("a far obstacle is as large as a body at least, in its proportions", () => {
  const obstacles = obstaclesOf([BOX], [[400, 0, 0]]);
  obstacles.show(0, viewport());
  // Half its height, 2 m, is one pixel, and ten are the minimum.
  shownBy(obstacles)[0]!.scale.forEach((edge, axis) => expect(edge).toBeCloseTo(10 * BOX.sizeM[axis]!, 4));
});

test("the nearest obstacle is at a position of the canvas", () => {
  const obstacles = obstaclesOf(
    [SPHERE, BOX, BOX],
    [
      [20, 0, 0],
      [10, 0, 0],
      [-10, 0, 0],
    ],
  );
  obstacles.show(0, viewport());
  expect(obstacles.pick(400, 200)).toBe(1);
  expect(obstacles.pick(700, 200)).toBeNull();
  obstacles.show(30, viewport());
  expect(obstacles.pick(400, 200)).toBe(2);
});
