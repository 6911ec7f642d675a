/**
 * What is set before a run begins, from the documents of its recording and the message on `/sim/scenario`.
 *
 * Throws a RangeError if they do not agree, or say what no scenario may say.
 */

import { lattice, shell, type Lidar } from "./lidar.ts";
import type { CellMap } from "./cell-map.ts";
import type { Scenario } from "./messages.ts";
import { TICK_S, type Setup, type Terrain } from "./run.ts";
import type { RecordedScenario } from "./recorded-scenario.ts";

/** What a scenario may have at the most. */
const RAYS_MAX = 1_000_000;
const SHELL_RADIUS_CELLS_MAX = 200;
/** The same, with room for later ones. */
const AGENTS_MAX = 1 << 16;

export interface RunHeader {
  readonly setup: Setup;
  readonly terrain: Terrain;
}

/** The terms of a run; all agents have the controller that is usual there until they are known to run another one. */
export function runHeaderOf(
  message: Scenario,
  recorded: RecordedScenario,
  toml: string,
  map: CellMap,
): RunHeader {
  const { cellM, agents, rangeM, fovRad } = message;
  if (message.size.some((cells, axis) => cells !== map.size[axis]) || !(cellM > 0 && cellM < Infinity)) {
    throw new RangeError(
      `it is of ${message.size.join(" x ")} cells of ${cellM} m, and the map has ${map.size.join(" x ")}`,
    );
  }
  if (agents > AGENTS_MAX || message.rays > RAYS_MAX) {
    throw new RangeError(
      `it is of ${agents} agents with ${message.rays} rays, expected are ${AGENTS_MAX} and ${RAYS_MAX} at the most`,
    );
  }
  let freeCells = map.walls.length;
  for (let cell = 0; cell < map.walls.length; cell++) {
    freeCells -= map.walls[cell]!;
  }
  return {
    setup: {
      agents,
      controllers: Array.from({ length: agents }, () => message.controller),
      radiusM: message.radiusM,
      seed: recorded.seed,
      durationS: message.durationTicks * TICK_S,
      lidar: { rays: isShell(recorded) ? 0 : message.rays, rangeM, fovRad },
      communicationRangeM: message.communicationRangeM,
      scenarioToml: toml,
    },
    terrain: { size: map.size, cellM, walls: map.walls, freeCells },
  };
}

export function lidarOf(message: Scenario, recorded: RecordedScenario): Lidar {
  if (isShell(recorded)) {
    const radius = recorded.shellRadiusCells ?? 0;
    return shell(Math.min(radius, SHELL_RADIUS_CELLS_MAX), message.fovRad);
  }
  return lattice(message.rays, message.rangeM, message.fovRad, message.cellM);
}

function isShell({ lidarPattern }: RecordedScenario): boolean {
  return lidarPattern === "shell";
}

/** Whether agents are message where they truly are; if not, poses are those that the server shows, if it does. */
export function areObservedPosesTrue(recorded: RecordedScenario): boolean {
  const hasNoise = (recorded.poseBoundM ?? 0) > 0;
  const hasTruePoses = (recorded.posesPeriodTicks ?? 1) > 0;
  return !hasNoise || !hasTruePoses;
}
