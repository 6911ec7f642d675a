/**
 * How the walls lie around each place: the direction out of the rock, and how open it is there. Light falls softly with it.
 *
 * It is made once for a map, on the grid of its cells or, for large maps, of blocks of them.
 */

import type { Size } from "./chunks.ts";

/** Four bytes for each block of cells, x fastest: the direction away from the rock (each part -1 to 1 as 0 to 255), and openness (0 to 1). */
export interface Hollows {
  readonly size: Size;
  /** Edge of a block in cells. */
  readonly step: number;
  readonly data: Uint8Array;
}

/** Passes of a blur of these radii, in cells, together say how open a place is: near folds, and the hall it lies in. */
const NEAR_RADIUS = 1;
const FAR_RADIUS = 4;
const NEAR_SHARE = 0.6;

/** `walls` is 1 where there is rock; all outside is rock. The grid has at most `blocks` blocks. */
export function hollowsOf(walls: Uint8Array, size: Size, blocks: number): Hollows {
  let step = 1;
  let coarse: Size = size;
  while (coarse[0] * coarse[1] * coarse[2] > blocks) {
    step *= 2;
    coarse = [Math.ceil(size[0] / step), Math.ceil(size[1] / step), Math.ceil(size[2] / step)];
  }
  const near = rockOf(walls, size, coarse, step);
  blur(near, coarse, Math.max(Math.round(NEAR_RADIUS / step), 1));
  blur(near, coarse, Math.max(Math.round(NEAR_RADIUS / step), 1));
  const far = near.slice();
  if (step <= FAR_RADIUS) blur(far, coarse, Math.round(FAR_RADIUS / step));
  return { size: coarse, step, data: encode(near, far, coarse) };
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

/** Replaces each value by the mean around it along x, then y, then z; outside is 1. */
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
        for (let k = 0; k < length; k++) line[radius + k] = values[start + k * stride]!;
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

function encode(near: Float32Array, far: Float32Array, size: Size): Uint8Array {
  const data = new Uint8Array(near.length * 4);
  const at = (x: number, y: number, z: number): number =>
    x < 0 || y < 0 || z < 0 || x >= size[0] || y >= size[1] || z >= size[2] ? 1 : near[(z * size[1] + y) * size[0] + x]!;
  let index = 0;
  for (let z = 0; z < size[2]; z++) {
    for (let y = 0; y < size[1]; y++) {
      for (let x = 0; x < size[0]; x++, index++) {
        const out = [at(x - 1, y, z) - at(x + 1, y, z), at(x, y - 1, z) - at(x, y + 1, z), at(x, y, z - 1) - at(x, y, z + 1)];
        const length = Math.max(Math.hypot(out[0]!, out[1]!, out[2]!), 1e-4);
        for (let axis = 0; axis < 3; axis++) data[index * 4 + axis] = Math.round(127.5 + (127.5 * out[axis]!) / length);
        const open = 1 - NEAR_SHARE * near[index]! - (1 - NEAR_SHARE) * far[index]!;
        data[index * 4 + 3] = Math.round(255 * Math.min(Math.max(open, 0), 1));
      }
    }
  }
  return data;
}
