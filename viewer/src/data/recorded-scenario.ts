/**
 * The few values of a recording's scenario that are not in the message on `/sim/scenario`.
 *
 * Values that are missing or have another type are null, and so are all values of a document that
 * is not TOML: a damaged scenario must not keep a recording from being shown.
 */

import { parse, type TomlTable, type TomlValue } from "smol-toml";
import type { ObstacleShape, Vec3 } from "./run.ts";

export interface RecordedScenario {
  /** Decimal, because a seed may exceed 2^53. */
  readonly seed: string | null;
  readonly lidarPattern: string | null;
  readonly shellRadiusCells: number | null;
  /** Whether the rays are rows and columns, or those of several LiDARs. */
  readonly hasRows: boolean;
  readonly poseBoundM: number | null;
  /** Whether the localisation of the agents drifts. */
  readonly hasDrift: boolean;
  readonly posesPeriodTicks: number | null;
  /** The shapes of the moving obstacles, by number. */
  readonly obstacles: readonly (ObstacleShape | null)[];
}

export function recordedScenario(toml: string): RecordedScenario {
  const root = parsed(toml);
  const seed = root["seed"];
  const { pattern, preset } = tableIn(root, "lidar");
  return {
    seed: typeof seed === "bigint" || Number.isInteger(seed) ? String(seed) : null,
    lidarPattern: typeof pattern === "string" ? pattern : null,
    shellRadiusCells: numberIn(root, "lidar", "shell_radius_cells"),
    hasRows:
      pattern === "ring" || pattern === "frustum" || preset !== undefined || root["lidars"] !== undefined,
    poseBoundM: numberIn(root, "sensor", "pose_bound_m"),
    hasDrift: Object.values(tableIn(root, "localisation")).some((value) => Number(value) > 0),
    posesPeriodTicks: numberIn(root, "recording", "poses_period_ticks"),
    obstacles: obstaclesIn(root["obstacle"]),
  };
}

function obstaclesIn(value: TomlValue | undefined): (ObstacleShape | null)[] {
  return Array.isArray(value) ? value.map((one) => (isTable(one) ? shapeIn(one) : null)) : [];
}

function shapeIn({ kind, radius_m: radiusM, size_m: sizeM }: TomlTable): ObstacleShape | null {
  if (kind === "sphere" && isLength(radiusM)) return { kind, radiusM };
  if (kind !== "box" || !Array.isArray(sizeM) || sizeM.length !== 3 || !sizeM.every(isLength)) return null;
  return { kind, sizeM: sizeM as Vec3 };
}

function isLength(value: TomlValue | undefined): value is number {
  return typeof value === "number" && value > 0 && value < Infinity;
}

function parsed(toml: string): TomlTable {
  try {
    return parse(toml, { integersAsBigInt: "asNeeded" });
  } catch {
    return {};
  }
}

function tableIn(root: TomlTable, name: string): TomlTable {
  const value = root[name];
  return isTable(value) ? value : {};
}

function isTable(value: TomlValue | undefined): value is TomlTable {
  return typeof value === "object" && !Array.isArray(value) && !(value instanceof Date);
}

function numberIn(root: TomlTable, table: string, key: string): number | null {
  const value = tableIn(root, table)[key];
  return typeof value === "number" && !Number.isNaN(value) ? value : null;
}
