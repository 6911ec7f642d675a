/**
 * Decompresses zstd, with WebAssembly where that may be used, else in plain JavaScript, which takes about four times as long.
 */

import { decompress as decompressSlowly } from "fzstd";
import { ZSTDDecoder } from "three/examples/jsm/libs/zstddec.module.js";

/** Gives out bytes of a length that is known. */
export type Zstd = (bytes: Uint8Array, length: number) => Uint8Array;

/** The plain way. */
export const slowZstd: Zstd = (bytes, length) => decompressSlowly(bytes, new Uint8Array(length));

export async function loadZstd(): Promise<Zstd> {
  const decoder = new ZSTDDecoder();
  try {
    await decoder.init();
  } catch {
    // A page may forbid WebAssembly, or the address of data that the decoder is loaded from.
    return slowZstd;
  }
  return (bytes, length) => (length === 0 ? new Uint8Array(0) : decoder.decode(bytes, length));
}
