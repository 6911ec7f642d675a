/** Three-dimensional textures: times of cells, and ambient occlusion. */

import {
  Box3,
  Data3DTexture,
  NearestFilter,
  RedIntegerFormat,
  RGBAIntegerFormat,
  UnsignedByteType,
  UnsignedIntType,
  type IUniform,
  Vector3,
  type WebGLRenderer,
} from "three";
import type { CellTimes } from "../data/cell-times.ts";
import type { AmbientOcclusion } from "./ambient-occlusion.ts";
import type { Size } from "./chunks.ts";

/** Maximum number of texels along an edge. */
export function edgeMaxOf(gl: WebGL2RenderingContext): number {
  return gl.getParameter(gl.MAX_3D_TEXTURE_SIZE) as number;
}

/** Times that are copied to a texture at once. */
const SLAB_CELLS_MAX = 2 ** 18;

/**
 * Times of cells, or of blocks of them, plus one: what has none, NEVER, is 0, with which the GPU
 * fills a new texture. Changed layers (of z) are copied in slabs with times, all through one array,
 * because browsers keep arrays that were given to the GPU for long.
 */
export class TimesVolume {
  readonly texture: Data3DTexture;
  readonly #slab: Data3DTexture;
  #low = 0;
  #high: number;

  constructor(
    readonly times: CellTimes,
    readonly size: Size,
  ) {
    const [x, y, z] = size;
    this.texture = integers(null, size);
    // Three.js is to reserve its memory only.
    this.texture.source.dataReady = false;
    this.texture.needsUpdate = true;
    const layers = Math.min(Math.max(Math.floor(SLAB_CELLS_MAX / (x * y)), 1), z);
    this.#slab = integers(new Uint32Array(x * y * layers), [x, y, layers]);
    this.#high = z - 1;
  }

  /** The times of these cells have changed; they have one. */
  markChanged(cells: Uint32Array): void {
    const area = this.size[0] * this.size[1];
    for (const cell of cells) {
      const z = Math.floor(cell / area);
      if (z < this.#low) this.#low = z;
      if (z > this.#high) this.#high = z;
    }
  }

  /** Any time may have changed, but those that there were remain. */
  markAllChanged(): void {
    this.#low = 0;
    this.#high = this.size[2] - 1;
  }

  /** Uploads the changes to the GPU. */
  upload(renderer: WebGLRenderer): void {
    const [x, y] = this.size;
    const { data, depth } = this.#slab.image as { data: Uint32Array; depth: number };
    for (let low = this.#low; low <= this.#high; low += depth) {
      const layers = Math.min(depth, this.#high + 1 - low);
      const part = data.subarray(0, x * y * layers);
      if (!this.times.copyTo(part, x * y * low)) continue;
      for (let cell = 0; cell < part.length; cell++) part[cell]!++;
      const box = new Box3(new Vector3(), new Vector3(x, y, layers));
      renderer.copyTextureToTexture(this.#slab, this.texture, box, new Vector3(0, 0, low));
    }
    this.#low = Infinity;
    this.#high = -Infinity;
  }

  dispose(): void {
    this.texture.dispose();
    this.#slab.dispose();
  }
}

/** Ambient occlusion as shaders read it. */
export interface OcclusionUniforms {
  readonly [name: string]: IUniform;
  readonly occlusion: IUniform<Data3DTexture>;
  readonly occlusionStep: IUniform<number>;
}

/** The data is dropped once it has been uploaded. */
export function occlusionUniforms({ counts, data, step }: AmbientOcclusion): OcclusionUniforms {
  const texture = new Data3DTexture(data as Uint8Array<ArrayBuffer>, ...counts);
  texture.format = RGBAIntegerFormat;
  texture.type = UnsignedByteType;
  texture.internalFormat = "RGBA8UI";
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.onUpdate = () => (texture.image.data = new Uint8Array(0));
  texture.needsUpdate = true;
  return { occlusion: { value: texture }, occlusionStep: { value: step } };
}

function integers(texels: Uint32Array<ArrayBuffer> | null, size: Size): Data3DTexture {
  const texture = new Data3DTexture(texels, ...size);
  texture.format = RedIntegerFormat;
  texture.type = UnsignedIntType;
  texture.internalFormat = "R32UI";
  texture.minFilter = NearestFilter;
  texture.magFilter = NearestFilter;
  texture.unpackAlignment = 4;
  return texture;
}
