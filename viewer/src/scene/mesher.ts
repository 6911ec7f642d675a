/**
 * Greedy mesher: the surface of a set of cells within a cube, as few rectangles.
 *
 * A face lies between a cell of the set and a neighbour outside it. Coplanar faces of the same
 * direction are merged greedily, first along the lower axis, then along the higher one, starting at
 * the lowest cell: the same set gives the same rectangles in the same order.
 */

/** Numbers per corner: x, y, z in cells, and the direction of the face. */
export const NUMBERS_PER_CORNER = 4;
/**
 * Corners of a rectangle, counterclockwise seen from the front; the triangles are 0 1 2 and 0 2 3.
 */
export const CORNERS = 4;
const NUMBERS_PER_QUAD = NUMBERS_PER_CORNER * CORNERS;

/** Face directions by number: +x, -x, +y, -y, +z, -z. */
export const DIRECTIONS: readonly (readonly [number, number, number])[] = [
  [1, 0, 0],
  [-1, 0, 0],
  [0, 1, 0],
  [0, -1, 0],
  [0, 0, 1],
  [0, 0, -1],
];

/**
 * Order of the rectangles by direction. A camera sees three of the six, two of which are then often
 * adjacent.
 */
export const FACING_ORDER: readonly number[] = [0, 1, 3, 2, 4, 5];

/** Rectangles. */
export interface Surface {
  /**
   * `NUMBERS_PER_CORNER` numbers for each of the `CORNERS` of each rectangle. Those of a mesher are
   * valid until its next call.
   */
  readonly corners: Uint16Array;
  /** Number of rectangles up to the end of each direction of `FACING_ORDER`. */
  readonly ends: readonly number[];
}

/** A cube of `edge` cells that is meshed at once; `origin` is its lowest cell. */
export interface Block {
  readonly edge: number;
  readonly origin: readonly [number, number, number];
  /**
   * Whether each cell is in the set (not 0), with a border of one cell on every side: (edge + 2)^3
   * cells, x fastest, then y, then z.
   */
  readonly padded: Uint8Array;
}

/** Creates rectangles; reuses its memory between calls. */
export class Mesher {
  #out = new Uint16Array(NUMBERS_PER_QUAD * 256);
  #used = 0;
  #mask = new Uint8Array(0);

  /** `longest` is the maximum length of a rectangle, cells. */
  constructor(readonly longest: number) {}

  /** The surface of the block's set. Rectangles face away from the set, or into it if `inward`. */
  surface(block: Block, inward: boolean): Surface {
    const { edge } = block;
    this.#used = 0;
    if (this.#mask.length < edge * edge) this.#mask = new Uint8Array(edge * edge);
    const ends = FACING_ORDER.map((facing) => {
      const direction = inward ? facing ^ 1 : facing;
      for (let layer = 0; layer < edge; layer++) {
        if (this.#findFaces(block, direction, layer)) this.#merge(block, direction, layer, facing);
      }
      return this.#used / NUMBERS_PER_QUAD;
    });
    return { corners: this.#out.subarray(0, this.#used), ends };
  }

  /**
   * Marks the faces of a layer in the mask, u fastest; u and v are the axes across the direction,
   * the lower one first.
   */
  #findFaces(block: Block, direction: number, layer: number): boolean {
    const { edge, padded } = block;
    const row = edge + 2;
    const strides = [1, row, row * row] as const;
    const axis = direction >> 1;
    const [u, v] = acrossOf(axis);
    const [strideU, strideV] = [strides[u]!, strides[v]!];
    const towards = direction & 1 ? -strides[axis]! : strides[axis]!;
    const start = strides[0] + strides[1] + strides[2] + layer * strides[axis]!;
    let found = 0;
    for (let j = 0; j < edge; j++) {
      let cell = start + j * strideV;
      for (let i = 0; i < edge; i++, cell += strideU) {
        const isFace = padded[cell] !== 0 && padded[cell + towards] === 0 ? 1 : 0;
        this.#mask[j * edge + i] = isFace;
        found |= isFace;
      }
    }
    return found !== 0;
  }

  #merge(block: Block, direction: number, layer: number, facing: number): void {
    const { edge, origin } = block;
    const mask = this.#mask;
    const axis = direction >> 1;
    const plane = layer + (direction & 1 ? 0 : 1) + origin[axis]!;
    const [u, v] = acrossOf(axis);
    for (let j = 0; j < edge; j++) {
      for (let i = 0; i < edge;) {
        if (mask[j * edge + i] === 0) {
          i++;
          continue;
        }
        let width = 1;
        const [lastI, lastJ] = [Math.min(i + this.longest, edge), Math.min(j + this.longest, edge)];
        while (i + width < lastI && mask[j * edge + i + width] === 1) width++;
        let height = 1;
        while (j + height < lastJ && isRowFull(mask, (j + height) * edge + i, width)) height++;
        for (let h = 0; h < height; h++) mask.fill(0, (j + h) * edge + i, (j + h) * edge + i + width);
        this.#emit(axis, plane, i + origin[u]!, j + origin[v]!, width, height, facing);
        i += width;
      }
    }
  }

  #emit(
    axis: number,
    plane: number,
    u: number,
    v: number,
    width: number,
    height: number,
    facing: number,
  ): void {
    if (this.#used + NUMBERS_PER_QUAD > this.#out.length) {
      const larger = new Uint16Array(this.#out.length * 2);
      larger.set(this.#out);
      this.#out = larger;
    }
    // For the axes x and z the order u, v is counterclockwise; for y it is clockwise.
    const isTurned = (facing & 1) !== (axis === 1 ? 1 : 0);
    for (let corner = 0; corner < CORNERS; corner++) {
      const turn = isTurned ? CORNERS - 1 - corner : corner;
      const cornerU = u + (turn === 1 || turn === 2 ? width : 0);
      const cornerV = v + (turn >= 2 ? height : 0);
      const at = this.#used;
      this.#out[at] = axis === 0 ? plane : cornerU;
      this.#out[at + 1] = axis === 1 ? plane : axis === 0 ? cornerU : cornerV;
      this.#out[at + 2] = axis === 2 ? plane : cornerV;
      this.#out[at + 3] = facing;
      this.#used += NUMBERS_PER_CORNER;
    }
  }
}

/** The two other axes, the lower one first. */
function acrossOf(axis: number): readonly [number, number] {
  return axis === 0 ? [1, 2] : axis === 1 ? [0, 2] : [0, 1];
}

function isRowFull(mask: Uint8Array, from: number, width: number): boolean {
  for (let i = from; i < from + width; i++) if (mask[i] === 0) return false;
  return true;
}
