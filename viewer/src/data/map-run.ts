/**
 * A map file (`docs/maps.md`) as a run without agents, in which everything has been seen, so that
 * the page shows a map as it shows a recording.
 */

import type { CellMap } from "./cell-map.ts";
import { readMap } from "./maps.ts";
import type { Batch } from "./protocol.ts";
import type { RunHeader } from "./run-header.ts";
import { UnreadableError } from "./run.ts";

/** Cells that were just seen glow; by this tick they have ceased to. */
const END_TICK = 250;

/** Whether the name of a file is that of a map. */
export function isMapFile(name: string): boolean {
  return /\.m3dm$/i.test(name);
}

/** The header and the only batch of a map. */
export function mapRun(name: string, bytes: Uint8Array): { header: RunHeader; batch: Batch } {
  let map: CellMap;
  try {
    map = readMap(name, bytes);
  } catch (error) {
    throw new UnreadableError(`${name}: ${(error as Error).message}`);
  }
  const { size, walls, cellM } = map;
  const freeCells = walls.length - walls.count;
  const header: RunHeader = {
    setup: {
      agents: 0,
      controllers: [],
      radiusM: [],
      seed: null,
      durationS: 0,
      lidar: { rays: 0, rangeM: 0, fovRad: 0 },
      communicationRangeM: 0,
      obstacles: [],
      scenarioToml: "",
    },
    terrain: { size, cellM: cellM ?? 1, walls, freeCells },
  };
  const batch: Batch = {
    endTick: END_TICK,
    isComplete: true,
    problem: null,
    seen: Uint32Array.of(0, 0, walls.length),
    covered: new Uint32Array(0),
    poses: new Float64Array(0),
    obstacles: new Float64Array(0),
    observations: new Float64Array(0),
    contacts: new Uint32Array(0),
    commands: new Float64Array(0),
    waypoints: new Float64Array(0),
    infos: [],
    mapChanges: [],
    progress: [],
    result: null,
    learned: null,
  };
  return { header, batch };
}
