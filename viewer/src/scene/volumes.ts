/**
 * What a run says of each cell, as three-dimensional textures that shaders read.
 *
 * The texture of a map that the graphics can hold is the run's own array; for larger maps each texel is a block of cells with the
 * earliest time of its free ones. Only layers (of z) that have changed are sent again.
 */

import {
  Box3,
  Data3DTexture,
  NearestFilter,
  RedIntegerFormat,
  UnsignedIntType,
  Vector3,
  type WebGLRenderer,
} from "three";
import { NEVER } from "../data/run.ts";
import type { Size } from "./chunks.ts";

/** Most texels of a texture of times: 128 MiB. */
const TEXELS_MAX = 2 ** 25;

/** Times of cells. */
export class TimesVolume {
  readonly texture: Data3DTexture;
  /** Cells along the edge of a texel, as a power of two. */
  readonly shift: number;
  readonly #size: Size;
  readonly #texels: Uint32Array;
  readonly #upload: Data3DTexture;
  #isSent = false;
  #low = Infinity;
  #high = -Infinity;

  /** `counts` says of which cells the times are. */
  constructor(
    readonly times: Uint32Array,
    readonly cells: Size,
    readonly counts: (cell: number) => boolean,
    edgeMax: number,
  ) {
    this.shift = shiftFor(cells, edgeMax);
    const step = 2 ** this.shift;
    this.#size = [Math.ceil(cells[0] / step), Math.ceil(cells[1] / step), Math.ceil(cells[2] / step)];
    if (this.shift === 0) {
      this.#texels = times;
    } else {
      this.#texels = new Uint32Array(this.#size[0] * this.#size[1] * this.#size[2]).fill(NEVER);
      for (let cell = 0; cell < times.length; cell++) this.#note(cell);
    }
    this.texture = integers(this.#texels, this.#size);
    this.#upload = integers(this.#texels, this.#size);
  }

  /** The times of these cells have changed. */
  learn(cells: Iterable<number>): void {
    const area = this.cells[0] * this.cells[1];
    for (const cell of cells) {
      if (this.shift > 0) this.#note(cell);
      const z = Math.floor(cell / area) >> this.shift;
      if (z < this.#low) this.#low = z;
      if (z > this.#high) this.#high = z;
    }
  }

  /** Any time may have changed. */
  learnAll(): void {
    if (this.shift > 0) {
      this.#texels.fill(NEVER);
      for (let cell = 0; cell < this.times.length; cell++) this.#note(cell);
    }
    this.#low = 0;
    this.#high = this.#size[2] - 1;
  }

  /** Sends what has changed to the graphics. */
  send(renderer: WebGLRenderer): void {
    if (!this.#isSent) {
      this.texture.needsUpdate = true;
      this.#isSent = true;
    } else if (this.#low <= this.#high) {
      const box = new Box3(
        new Vector3(0, 0, this.#low),
        new Vector3(this.#size[0], this.#size[1], this.#high + 1),
      );
      renderer.copyTextureToTexture(this.#upload, this.texture, box, new Vector3(0, 0, this.#low));
    }
    this.#low = Infinity;
    this.#high = -Infinity;
  }

  dispose(): void {
    this.texture.dispose();
    this.#upload.dispose();
  }

  #note(cell: number): void {
    const time = this.times[cell]!;
    if (time === NEVER || !this.counts(cell)) return;
    const [sizeX, sizeY] = this.cells;
    const x = (cell % sizeX) >> this.shift;
    const y = (Math.floor(cell / sizeX) % sizeY) >> this.shift;
    const z = Math.floor(cell / (sizeX * sizeY)) >> this.shift;
    const texel = (z * this.#size[1] + y) * this.#size[0] + x;
    if (time < this.#texels[texel]!) this.#texels[texel] = time;
  }
}

/** How much a map has to be made coarser for the graphics. */
export function shiftFor(cells: Size, edgeMax: number): number {
  let shift = 0;
  while (
    Math.max(...cells) / 2 ** shift > edgeMax ||
    (cells[0] * cells[1] * cells[2]) / 8 ** shift > TEXELS_MAX
  )
    shift++;
  return shift;
}

function integers(texels: Uint32Array, size: Size): Data3DTexture {
  const texture = new Data3DTexture(texels as Uint32Array<ArrayBuffer>, size[0], size[1], size[2]);
  texture.format = RedIntegerFormat;
  texture.type = UnsignedIntType;
  texture.internalFormat = "R32UI";
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.unpackAlignment = 4;
  return texture;
}
