/**
 * LiDAR ray casting in the true map.
 *
 * Ray patterns and voxel traversal are those of the simulator: rays are fixed in the `map` frame, a
 * limited field of view is a cone around the heading, and where a ray reaches two boundaries at
 * once the lower axis steps first. Without sensor noise the result equals the recorded scan.
 */

import type { Terrain, Vec3 } from "./run.ts";

const GOLDEN_RATIO = (1 + Math.sqrt(5)) / 2;

export interface Lidar {
  /** x, y, z of each direction; its length is the unit of distances along it. */
  readonly directions: Float64Array;
  /** In lengths of a direction times the cell edge. */
  readonly reachCells: number;
  readonly fovRad: number;
}

/** Rays spread evenly over the sphere (Fibonacci lattice). */
export function lattice(rays: number, rangeM: number, fovRad: number, cellM: number): Lidar {
  const directions = new Float64Array(3 * rays);
  for (let ray = 0; ray < rays; ray++) {
    const azimuth = (2 * Math.PI * ray) / GOLDEN_RATIO;
    const along = 1 - (2 * (ray + 0.5)) / rays;
    const aside = Math.sqrt(1 - along * along);
    directions.set([along, Math.cos(azimuth) * aside, Math.sin(azimuth) * aside], 3 * ray);
  }
  return { directions, reachCells: rangeM / cellM, fovRad };
}

/** One ray to each cell on the surface of a sphere, ending there. */
export function shell(radius: number, fovRad: number): Lidar {
  const isInside = (x: number, y: number, z: number) => x * x + y * y + z * z <= radius * radius;
  const directions: number[] = [];
  for (let z = -radius; z <= radius; z++) {
    for (let y = -radius; y <= radius; y++) {
      for (let x = -radius; x <= radius; x++) {
        const isEdge =
          !isInside(Math.abs(x) + 1, y, z) ||
          !isInside(x, Math.abs(y) + 1, z) ||
          !isInside(x, y, Math.abs(z) + 1);
        if (isInside(x, y, z) && isEdge) {
          directions.push(x, y, z);
        }
      }
    }
  }
  return { directions: Float64Array.from(directions), reachCells: 1, fovRad };
}

/**
 * Distance, in metres times the length of the direction, at which a ray enters its first wall; null
 * if it ends before one.
 */
export function firstWall(
  terrain: Pick<Terrain, "size" | "cellM" | "walls">,
  from: Vec3,
  direction: Vec3,
  reachCells: number,
): number | null {
  const { size, cellM, walls } = terrain;
  const [sizeX, sizeY, sizeZ] = size;
  const [px, py, pz] = [from[0] / cellM, from[1] / cellM, from[2] / cellM];
  let x = Math.floor(px);
  let y = Math.floor(py);
  let z = Math.floor(pz);
  const [dx, dy, dz] = direction;
  const [stepX, stepY, stepZ] = [dx < 0 ? -1 : 1, dy < 0 ? -1 : 1, dz < 0 ? -1 : 1];
  const [deltaX, deltaY, deltaZ] = [1 / Math.abs(dx), 1 / Math.abs(dy), 1 / Math.abs(dz)];
  let nextX = dx === 0 ? Infinity : (dx < 0 ? px - x : x + 1 - px) * deltaX;
  let nextY = dy === 0 ? Infinity : (dy < 0 ? py - y : y + 1 - py) * deltaY;
  let nextZ = dz === 0 ? Infinity : (dz < 0 ? pz - z : z + 1 - pz) * deltaZ;
  let entry = 0;
  while (x >= 0 && x < sizeX && y >= 0 && y < sizeY && z >= 0 && z < sizeZ) {
    if (walls.has((z * sizeY + y) * sizeX + x)) {
      return entry * cellM;
    }
    if (nextX <= nextY && nextX <= nextZ) {
      entry = nextX;
      nextX += deltaX;
      x += stepX;
    } else if (nextY <= nextZ) {
      entry = nextY;
      nextY += deltaY;
      y += stepY;
    } else {
      entry = nextZ;
      nextZ += deltaZ;
      z += stepZ;
    }
    if (entry > reachCells || entry === Infinity) {
      return null;
    }
  }
  return null;
}

/** x, y, z of the points at which a scan hits walls. */
export function cast(lidar: Lidar, terrain: Terrain, position: Vec3, yawRad: number): Float32Array {
  const { directions, reachCells, fovRad } = lidar;
  const hits = new Float32Array(directions.length);
  const isLimited = fovRad < 2 * Math.PI;
  const leastCos = Math.cos(fovRad / 2);
  const [headingX, headingY] = [Math.cos(yawRad), Math.sin(yawRad)];
  let count = 0;
  for (let at = 0; at < directions.length; at += 3) {
    const direction: Vec3 = [directions[at]!, directions[at + 1]!, directions[at + 2]!];
    if (
      isLimited &&
      headingX * direction[0] + headingY * direction[1] <= leastCos * Math.hypot(...direction)
    ) {
      continue;
    }
    const distanceM = firstWall(terrain, position, direction, reachCells);
    if (distanceM !== null) {
      for (let axis = 0; axis < 3; axis++) {
        hits[count++] = position[axis]! + direction[axis]! * distanceM;
      }
    }
  }
  return hits.slice(0, count);
}
