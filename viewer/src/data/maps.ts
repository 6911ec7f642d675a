/**
 * Reads the true map of a recording: plain M3DM, packed M3DM, and the text format of older
 * recordings.
 *
 * The formats are those of `docs/maps.md`. Lengths are checked before cells are allocated, and
 * nothing is repaired: malformed bytes throw an UnreadableError that names the position.
 */

import type { CellMap } from "./cell-map.ts";
import { CellSet } from "./cell-set.ts";
import { packedMap, isPacked } from "./packed-map.ts";
import { UnreadableError } from "./run.ts";

/** Reads the map of an attachment; its name gives the format. */
export function readMap(name: string, bytes: Uint8Array): CellMap {
  if (name.endsWith(".txt")) {
    return textMap(new TextDecoder().decode(bytes));
  }
  return isPacked(bytes) ? packedMap(bytes) : plainMap(bytes);
}

/** Plain M3DM: one bit per cell, x slowest, then z, y fastest. */
function plainMap(bytes: Uint8Array): CellMap {
  if (bytes.length < 3) {
    throw new UnreadableError(`byte ${bytes.length}: the map ends within its header of 3 bytes`);
  }
  const header = (bytes[0]! << 16) | (bytes[1]! << 8) | bytes[2]!;
  const [sizeX, sizeZ, sizeY] = [header >> 17, (header >> 10) & 127, (header >> 3) & 127];
  const padding = header & 7;
  const cells = sizeX * sizeY * sizeZ;
  const length = 3 + Math.ceil(cells / 8);
  if (cells === 0 || (cells + padding) % 8 !== 0 || bytes.length !== length) {
    throw new UnreadableError(
      `a map of ${sizeX} x ${sizeY} x ${sizeZ} cells with ${padding} bits of padding has ${length} bytes, ` +
        `not ${bytes.length}`,
    );
  }
  if (bytes[3]! >> (8 - padding) !== 0) {
    throw new UnreadableError("byte 3: the padding of the map is not all 0");
  }
  const walls = new CellSet(cells);
  let bit = 24 + padding;
  for (let x = 0; x < sizeX; x++) {
    for (let z = 0; z < sizeZ; z++) {
      for (let y = 0; y < sizeY; y++, bit++) {
        if ((bytes[bit >> 3]! >> (7 - (bit & 7))) & 1) walls.add((z * sizeY + y) * sizeX + x);
      }
    }
  }
  return { size: [sizeX, sizeY, sizeZ], cellM: null, walls };
}

/** Text: layers from the bottom to the top, the row of the highest y first. */
function textMap(drawn: string): CellMap {
  const layers = drawn
    .replaceAll("\r", "")
    .split(/\n{2,}/)
    .map((layer) => layer.split("\n").filter((row) => row !== ""))
    .filter((layer) => layer.length > 0);
  const [sizeX, sizeY, sizeZ] = [layers[0]?.[0]?.length ?? 0, layers[0]?.length ?? 0, layers.length];
  const walls = new CellSet(sizeX * sizeY * sizeZ);
  if (walls.length === 0) {
    throw new UnreadableError("the text map has no cells");
  }
  layers.forEach((layer, z) => {
    layer.forEach((row, line) => {
      if (layer.length !== sizeY || row.length !== sizeX || /[^#. ]/.test(row)) {
        throw new UnreadableError(
          `layer ${z + 1}, row ${line + 1} of the text map: expected ${sizeY} rows of ${sizeX} of the ` +
            "characters #, . and space",
        );
      }
      for (let x = 0; x < sizeX; x++) {
        if (row[x] === "#") walls.add((z * sizeY + (sizeY - 1 - line)) * sizeX + x);
      }
    });
  });
  return { size: [sizeX, sizeY, sizeZ], cellM: null, walls };
}
