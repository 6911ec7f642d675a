/** The map of a recording as an occupancy grid. */

import type { CellSet } from "./cell-set.ts";
import type { Vec3 } from "./run.ts";

export interface CellMap {
  /** Cells along x, y, z. */
  readonly size: Vec3;
  /** Cell edge in metres; null if the map format does not have it. */
  readonly cellM: number | null;
  /** The cells that are wall; the others are free. */
  readonly walls: CellSet;
}
