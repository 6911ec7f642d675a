/**
 * Baked ambient occlusion: at each corner of the cell grid, the direction out of the rock and how
 * open the surroundings are.
 *
 * It is computed once per map, on the grid of its cells or, for large maps, of blocks of cells.
 */

import type { Size } from "./chunks.ts";

/** Ambient occlusion at the corners of cells or blocks. */
export interface AmbientOcclusion {
  /** Corners along each axis. */
  readonly counts: Size;
  /** Block edge in cells. */
  readonly step: number;
  /**
   * Four bytes per corner, x fastest: direction away from the rock (components -1 to 1 as 0 to
   * 255), and openness (0 to 1 as 0 to 255).
   */
  readonly data: Uint8Array;
}

/**
 * Radii in cells of the box blurs whose weighted sum is the openness: nearby folds, and the wider
 * surroundings.
 */
const NEAR_RADIUS = 1;
const FAR_RADIUS = 4;
const NEAR_SHARE = 0.6;

/**
 * `walls` is 1 where there is rock; everything outside is rock. The grid has at most `blocksMax`
 * blocks, and `edgeMax` corners along an axis.
 */
export function computeOcclusion(
  walls: Uint8Array,
  size: Size,
  { blocksMax, edgeMax }: { readonly blocksMax: number; readonly edgeMax: number },
): AmbientOcclusion {
  let step = 1;
  let coarse: Size = size;
  while (coarse[0] * coarse[1] * coarse[2] > blocksMax || Math.max(...coarse) >= edgeMax) {
    step *= 2;
    coarse = [Math.ceil(size[0] / step), Math.ceil(size[1] / step), Math.ceil(size[2] / step)];
  }
  const near = rockOf(walls, size, coarse, step);
  blur(near, coarse, Math.max(Math.round(NEAR_RADIUS / step), 1));
  blur(near, coarse, Math.max(Math.round(NEAR_RADIUS / step), 1));
  const far = near.slice();
  if (step <= FAR_RADIUS) blur(far, coarse, Math.round(FAR_RADIUS / step));
  return { counts: [coarse[0] + 1, coarse[1] + 1, coarse[2] + 1], step, data: encode(near, far, coarse) };
}

/** Share of rock in each block. */
function rockOf(walls: Uint8Array, size: Size, coarse: Size, step: number): Float32Array {
  const rock = new Float32Array(coarse[0] * coarse[1] * coarse[2]);
  if (step === 1) {
    rock.set(walls);
    return rock;
  }
  rock.fill(1);
  const part = 1 / step ** 3;
  let cell = 0;
  for (let z = 0; z < size[2]; z++) {
    for (let y = 0; y < size[1]; y++) {
      const row = (Math.floor(z / step) * coarse[1] + Math.floor(y / step)) * coarse[0];
      for (let x = 0; x < size[0]; x++, cell++) {
        if (walls[cell] === 0) rock[row + Math.floor(x / step)]! -= part;
      }
    }
  }
  return rock;
}

/** Separable box blur along x, y and z; outside is 1. */
function blur(values: Float32Array, size: Size, radius: number): void {
  const strides = [1, size[0], size[0] * size[1]] as const;
  const line = new Float32Array(Math.max(...size) + 2 * radius);
  const weight = 1 / (2 * radius + 1);
  for (let axis = 0; axis < 3; axis++) {
    const [length, stride] = [size[axis]!, strides[axis]!];
    const [u, v] = axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
    for (let j = 0; j < size[v!]!; j++) {
      for (let i = 0; i < size[u!]!; i++) {
        const start = i * strides[u!]! + j * strides[v!]!;
        line.fill(1, 0, length + 2 * radius);
        let isRock = true;
        for (let k = 0, at = start; k < length; k++, at += stride) {
          const value = values[at]!;
          line[radius + k] = value;
          isRock &&= value === 1;
        }
        if (isRock) continue;
        let sum = 0;
        for (let k = 0; k < 2 * radius; k++) sum += line[k]!;
        for (let k = 0; k < length; k++) {
          sum += line[k + 2 * radius]!;
          values[start + k * stride] = sum * weight;
          sum -= line[k]!;
        }
      }
    }
  }
}

/** The first picture waits for this, so the cells left of a corner are kept from the one before. */
function encode(near: Float32Array, far: Float32Array, size: Size): Uint8Array {
  const [sizeX, sizeY, sizeZ] = size;
  const data = new Uint8Array((sizeX + 1) * (sizeY + 1) * (sizeZ + 1) * 4);
  // The four rows of cells around a row of corners: below, then above, the lower y first.
  const starts = new Int32Array(4);
  // In each of them the rock right of the last corner, near it and with the far surroundings.
  const right = new Float64Array(4);
  const rightRock = new Float64Array(4);
  let at = 0;
  for (let z = 0; z <= sizeZ; z++) {
    for (let y = 0; y <= sizeY; y++) {
      for (let row = 0; row < 4; row++) {
        const [j, k] = [y - 1 + (row & 1), z - 1 + (row >> 1)];
        starts[row] = j >= 0 && k >= 0 && j < sizeY && k < sizeZ ? (k * sizeY + j) * sizeX : -1;
        right[row] = 1;
        rightRock[row] = 1;
      }
      for (let x = 0; x <= sizeX; x++, at += 4) {
        let [outX, outY, outZ, rock] = [0, 0, 0, 0];
        for (let row = 0; row < 4; row++) {
          const before = right[row]!;
          const beforeRock = rightRock[row]!;
          const start = starts[row]!;
          const isInside = start >= 0 && x < sizeX;
          const here = isInside ? near[start + x]! : 1;
          const hereRock = isInside ? NEAR_SHARE * here + (1 - NEAR_SHARE) * far[start + x]! : 1;
          right[row] = here;
          rightRock[row] = hereRock;
          rock = rock + beforeRock + hereRock;
          outX = outX + before - here;
          outY = (row & 1) === 0 ? outY + before + here : outY - before - here;
          outZ = row < 2 ? outZ + before + here : outZ - before - here;
        }
        const length = Math.sqrt(outX * outX + outY * outY + outZ * outZ);
        const scale = 127.5 / Math.max(length, 1e-4);
        // The array cuts off what follows the point, which rounds 0.5 less.
        data[at] = 128 + scale * outX;
        data[at + 1] = 128 + scale * outY;
        data[at + 2] = 128 + scale * outZ;
        data[at + 3] = 0.5 + 255 * Math.min(Math.max(1 - rock / 8, 0), 1);
      }
    }
  }
  return data;
}
