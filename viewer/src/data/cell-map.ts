/** The map of a recording as an occupancy grid. */

import type { Vec3 } from "./run.ts";

export interface CellMap {
  /** Cells along x, y, z. */
  readonly size: Vec3;
  /** Cell edge in metres; null if the map format does not have it. */
  readonly cellM: number | null;
  /** 1 is wall, 0 free; by cell number. */
  readonly walls: Uint8Array;
}
