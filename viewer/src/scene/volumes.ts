/**
 * Times of cells as three-dimensional textures.
 *
 * The texture data is the array of times itself; only changed layers (of z) are uploaded again.
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
import type { Size } from "./chunks.ts";

/** Times of cells, or of blocks of them. */
export class TimesVolume {
  readonly texture: Data3DTexture;
  /** A texture of the same array, from which single layers are copied. */
  readonly #source: Data3DTexture;
  #isUploaded = false;
  #low = Infinity;
  #high = -Infinity;

  constructor(
    times: Uint32Array,
    readonly size: Size,
  ) {
    this.texture = integers(times, size);
    this.#source = integers(times, size);
  }

  /** The times of these cells have changed. */
  markChanged(cells: Uint32Array): void {
    const area = this.size[0] * this.size[1];
    for (const cell of cells) {
      const z = Math.floor(cell / area);
      if (z < this.#low) this.#low = z;
      if (z > this.#high) this.#high = z;
    }
  }

  /** Any time may have changed. */
  markAllChanged(): void {
    this.#low = 0;
    this.#high = this.size[2] - 1;
  }

  /** Uploads the changes to the GPU. */
  upload(renderer: WebGLRenderer): void {
    if (!this.#isUploaded) {
      this.texture.needsUpdate = true;
      this.#isUploaded = true;
    } else if (this.#low <= this.#high) {
      const from = new Vector3(0, 0, this.#low);
      const box = new Box3(from, new Vector3(this.size[0], this.size[1], this.#high + 1));
      renderer.copyTextureToTexture(this.#source, this.texture, box, from);
    }
    this.#low = Infinity;
    this.#high = -Infinity;
  }

  dispose(): void {
    this.texture.dispose();
    this.#source.dispose();
  }
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
