/**
 * Zstandard decompression: WebAssembly where it is allowed, else JavaScript, which takes about four
 * times as long.
 */

import { decompress as decompressSlowly } from "fzstd";
import { ZSTDDecoder } from "three/examples/jsm/libs/zstddec.module.js";

/** Decompresses bytes into a known length. */
export type Zstd = (bytes: Uint8Array, length: number) => Uint8Array;

/** The JavaScript fallback. */
export const slowZstd: Zstd = (bytes, length) => decompressSlowly(bytes, new Uint8Array(length));

export async function loadZstd(): Promise<Zstd> {
  const decoder = new ZSTDDecoder();
  try {
    await decoder.init();
  } catch {
    // A content security policy may forbid WebAssembly, or the data URL that the decoder is loaded
    // from.
    return slowZstd;
  }
  return (bytes, length) => (length === 0 ? new Uint8Array(0) : decoder.decode(bytes, length));
}
