/**
 * Setup and terrain of a run, from the attachments of its recording and the message on
 * `/sim/scenario`.
 *
 * Throws a RangeError if they contradict each other or exceed the limits of a scenario.
 */

import { lattice, shell, type Lidar } from "./lidar.ts";
import type { CellMap } from "./cell-map.ts";
import type { Scenario } from "./messages.ts";
import { TICK_S, type Setup, type Terrain } from "./run.ts";
import type { RecordedScenario } from "./recorded-scenario.ts";

/** Limits of a scenario. */
const RAYS_MAX = 1 << 20;
const SHELL_RADIUS_CELLS_MAX = 200;
/** The present limit of a scenario, with a margin for later versions. */
const AGENTS_MAX = 1 << 16;

export interface RunHeader {
  readonly setup: Setup;
  readonly terrain: Terrain;
}

/** All agents have the scenario's default controller until their join messages name another. */
export function runHeaderOf(
  message: Scenario,
  recorded: RecordedScenario,
  toml: string,
  map: CellMap,
): RunHeader {
  const { cellM, agents, rangeM, fovRad } = message;
  if (message.size.some((cells, axis) => cells !== map.size[axis]) || !(cellM > 0 && cellM < Infinity)) {
    throw new RangeError(
      `the scenario has ${message.size.join(" x ")} cells of ${cellM} m, but the map has ${map.size.join(" x ")}`,
    );
  }
  if (agents > AGENTS_MAX || message.rays > RAYS_MAX) {
    throw new RangeError(
      `the scenario has ${agents} agents with ${message.rays} rays, expected at most ${AGENTS_MAX} and ${RAYS_MAX}`,
    );
  }
  const freeCells = map.walls.length - map.walls.count;
  return {
    setup: {
      agents,
      controllers: Array.from({ length: agents }, () => message.controller),
      radiusM: message.radiusM,
      seed: recorded.seed,
      durationS: message.durationTicks * TICK_S,
      lidar: { rays: isShell(recorded) ? 0 : message.rays, rangeM, fovRad },
      communicationRangeM: message.communicationRangeM,
      obstacles: recorded.obstacles,
      scenarioToml: toml,
    },
    terrain: { size: map.size, cellM, walls: map.walls, freeCells },
  };
}

/** The rays of the LiDAR; null if they are rows and columns, which are not cast here. */
export function lidarOf(message: Scenario, recorded: RecordedScenario): Lidar | null {
  if (isShell(recorded)) {
    const radius = recorded.shellRadiusCells ?? 0;
    return shell(Math.min(radius, SHELL_RADIUS_CELLS_MAX), message.fovRad);
  }
  if (recorded.hasRows) {
    return null;
  }
  return lattice(message.rays, message.rangeM, message.fovRad, message.cellM);
}

function isShell({ lidarPattern }: RecordedScenario): boolean {
  return lidarPattern === "shell";
}

/**
 * Whether observed poses are true ones. They are not where the pose has sensor noise or drifts; then the true
 * poses that the server records are used, if it does record them.
 */
export function areObservedPosesTrue(recorded: RecordedScenario): boolean {
  const hasNoise = recorded.hasDrift || (recorded.poseBoundM ?? 0) > 0;
  const hasTruePoses = (recorded.posesPeriodTicks ?? 1) > 0;
  return !hasNoise || !hasTruePoses;
}
