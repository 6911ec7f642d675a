/**
 * What is set before a run begins, from the documents of its recording and the message on `/sim/scenario`.
 *
 * Throws a RangeError if they do not agree, or say what no scenario may say.
 */

import { lattice, shell, type Lidar } from "./lidar.ts";
import type { CellMap } from "./maps.ts";
import type { Scenario } from "./messages.ts";
import { TICK_S, type Setup, type Terrain } from "./run.ts";
import { tomlNumber, tomlText } from "./scenario_toml.ts";

/** What a scenario may have at the most. */
const RAYS_MAX = 1_000_000;
const SHELL_RADIUS_CELLS_MAX = 200;
/** The same, with room for later ones. */
const AGENTS_MAX = 1 << 16;

export interface Opening {
  readonly setup: Setup;
  readonly terrain: Terrain;
}

/** The terms of a run; all agents have the controller that is usual there until they are known to run another one. */
export function openingOf(told: Scenario, toml: string, map: CellMap): Opening {
  const { cellM, agents, rangeM, fovRad } = told;
  if (told.size.some((cells, axis) => cells !== map.size[axis]) || !(cellM > 0 && cellM < Infinity)) {
    throw new RangeError(
      `it is of ${told.size.join(" x ")} cells of ${cellM} m, and the map has ${map.size.join(" x ")}`,
    );
  }
  if (agents > AGENTS_MAX || told.rays > RAYS_MAX) {
    throw new RangeError(
      `it is of ${agents} agents with ${told.rays} rays, expected are ${AGENTS_MAX} and ${RAYS_MAX} at the most`,
    );
  }
  let freeCells = map.walls.length;
  for (let cell = 0; cell < map.walls.length; cell++) {
    freeCells -= map.walls[cell]!;
  }
  return {
    setup: {
      agents,
      controllers: Array.from({ length: agents }, () => told.controller),
      radiusM: told.radiusM,
      durationS: told.durationTicks * TICK_S,
      lidar: { rays: isShell(toml) ? 0 : told.rays, rangeM, fovRad },
      communicationRangeM: told.communicationRangeM,
      scenarioToml: toml,
    },
    terrain: { size: map.size, cellM, walls: map.walls, freeCells },
  };
}

export function lidarOf(told: Scenario, toml: string): Lidar {
  if (isShell(toml)) {
    const radius = tomlNumber(toml, "lidar", "shell_radius_cells") ?? 0;
    return shell(Math.min(radius, SHELL_RADIUS_CELLS_MAX), told.fovRad);
  }
  return lattice(told.rays, told.rangeM, told.fovRad, told.cellM);
}

function isShell(toml: string): boolean {
  return tomlText(toml, "lidar", "pattern") === "shell";
}

/** Whether agents are told where they truly are; if not, poses are those that the server shows, if it does. */
export function areToldPosesTrue(toml: string): boolean {
  const hasErrors = (tomlNumber(toml, "sensor", "pose_bound_m") ?? 0) > 0;
  const hasPoses = (tomlNumber(toml, "recording", "poses_period_ticks") ?? 1) > 0;
  return !hasErrors || !hasPoses;
}
