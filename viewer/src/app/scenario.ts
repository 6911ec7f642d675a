/**
 * Values of the start form and the scenario made of them: ranges and defaults of the reference, and
 * the TOML for the server. Pure. The server validates the scenario; only errors of the form itself
 * are found here.
 */

import controllers from "./controllers.json";
import SCENARIO_KEYS from "./scenario-keys.json";

export type Generator = "spheres" | "noise" | "building" | "mine" | "scene" | "file";

/**
 * The scenes at true scale: cells along x, y, z, the length of a cell, and the range of the LiDAR,
 * as in `launch_scripts/scenarios`.
 */
export const SCENES = {
  office: { size: [202, 202, 29], cellM: 0.1, lidarRangeM: 5 },
  "octagon-maze": { size: [202, 202, 22], cellM: 0.1, lidarRangeM: 5 },
  tunnels: { size: [512, 362, 42], cellM: 0.2, lidarRangeM: 15 },
  garage: { size: [252, 152, 36], cellM: 0.2, lidarRangeM: 15 },
  pillars: { size: [102, 102, 17], cellM: 0.2, lidarRangeM: 5 },
  campus: { size: [202, 152, 32], cellM: 0.5, lidarRangeM: 20 },
  forest: { size: [127, 127, 27], cellM: 0.4, lidarRangeM: 15 },
} as const;

export type SceneName = keyof typeof SCENES;

export interface FormValues {
  agents: number;
  durationMin: number;
  controller: string;
  generator: Generator;
  mapFile: string;
  /** Cells along x, y, z. */
  size: [number, number, number];
  spheresFillPercent: number;
  spheresRadiusMin: number;
  spheresRadiusMax: number;
  spheresConnections: number;
  spheresSmoothing: number;
  noiseFillPercent: number;
  noiseSmoothing: number;
  buildingFloors: number;
  sceneName: SceneName;
  /** Whether path searches take sim time, and their budget of cells per tick. */
  isSearchBudgeted: boolean;
  searchCellsPerTick: number;
  /** Metres; Infinity: unlimited. */
  communicationRangeM: number;
  sensingFovDeg: number;
  /** Ticks between two map messages of an agent; 0: none. */
  sharePeriodTicks: number;
  stopWhenExplored: boolean;
  stopWhenCovered: boolean;
  seed: number;
  /** Real-time factor; 0: as fast as possible. */
  rtf: number;
}

export interface Range {
  readonly min: number;
  readonly max: number;
  readonly step: number;
}

/** Ranges of the reference; it has 10 agents at most. */
export const RANGES = {
  agents: { min: 1, max: 27, step: 1 },
  durationMin: { min: 1, max: 120, step: 1 },
  size: { min: 30, max: 100, step: 1 },
  buildingHeight: { min: 5, max: 100, step: 1 },
  spheresFillPercent: { min: 1, max: 30, step: 1 },
  spheresRadius: { min: 2, max: 15, step: 1 },
  spheresConnections: { min: 1, max: 10, step: 1 },
  smoothing: { min: 0, max: 20, step: 1 },
  noiseFillPercent: { min: 45, max: 60, step: 1 },
  searchCellsPerTick: { min: 10, max: 250, step: 10 },
  communicationRangeM: { min: 1, max: 100, step: 1 },
  sensingFovDeg: { min: 1, max: 360, step: 1 },
  sharePeriodTicks: { min: 0, max: 2510, step: 1 },
} as const satisfies Record<string, Range>;

/** Largest team of the reference. */
export const REFERENCE_AGENTS_MAX = 10;

export const DEFAULTS: FormValues = {
  agents: 3,
  durationMin: 30,
  controller: "rbw",
  generator: "spheres",
  mapFile: "",
  size: [50, 50, 50],
  spheresFillPercent: 20,
  spheresRadiusMin: 3,
  spheresRadiusMax: 8,
  spheresConnections: 3,
  spheresSmoothing: 5,
  noiseFillPercent: 53,
  noiseSmoothing: 5,
  buildingFloors: 3,
  sceneName: "office",
  isSearchBudgeted: true,
  searchCellsPerTick: 100,
  communicationRangeM: Infinity,
  sensingFovDeg: 360,
  sharePeriodTicks: 251,
  stopWhenExplored: true,
  stopWhenCovered: false,
  seed: 1,
  rtf: 1,
};

/** A scenario key that a value of the form sets; the value times `factor` is the value of the key. */
interface FormKey {
  readonly key: keyof typeof SCENARIO_KEYS;
  readonly factor: number;
}

export const FORM_KEYS = {
  agents: { key: "agents.count", factor: 1 },
  durationMin: { key: "duration_s", factor: 60 },
  controller: { key: "agents.controller", factor: 1 },
  mapFile: { key: "map.file", factor: 1 },
  size: { key: "map.size", factor: 1 },
  spheresFillPercent: { key: "map.spheres.fill_ratio", factor: 0.01 },
  spheresRadiusMin: { key: "map.spheres.radius_min", factor: 1 },
  spheresRadiusMax: { key: "map.spheres.radius_max", factor: 1 },
  spheresConnections: { key: "map.spheres.connections", factor: 1 },
  spheresSmoothing: { key: "map.spheres.smoothing", factor: 1 },
  noiseFillPercent: { key: "map.noise.fill", factor: 0.01 },
  noiseSmoothing: { key: "map.noise.smoothing", factor: 1 },
  buildingFloors: { key: "map.building.floors", factor: 1 },
  sceneName: { key: "map.scene.name", factor: 1 },
  communicationRangeM: { key: "communication.range_m", factor: 1 },
  sensingFovDeg: { key: "lidar.fov_rad", factor: Math.PI / 180 },
  sharePeriodTicks: { key: "agents.share_period_ticks", factor: 1 },
  stopWhenExplored: { key: "stop_when_explored", factor: 1 },
  stopWhenCovered: { key: "stop_when_covered", factor: 1 },
  seed: { key: "seed", factor: 1 },
} as const satisfies Partial<Record<keyof FormValues, FormKey>>;

/** Meaning and limits of the scenario key that a value of the form sets. */
export function help(name: keyof typeof FORM_KEYS): string {
  return SCENARIO_KEYS[FORM_KEYS[name].key].help;
}

export interface Controller {
  readonly value: string;
  readonly label: string;
  /** Whether the controller has the settings of path searches. */
  readonly searches: boolean;
}

/** All controllers; the file is generated from the registry of agent_node. */
export const CONTROLLERS: readonly Controller[] = controllers;

/** Cells of a storey, of a ceiling, and of the outer walls. */
const FLOOR_HEIGHT = 3;
const SLAB = 1;

/** Height in cells of a building with this number of floors. */
export function buildingHeight(floors: number): number {
  return floors * (FLOOR_HEIGHT + SLAB) - SLAB + 2;
}

/** Largest sphere radius that the server accepts for a map of this size. */
export function radiusLimit(size: readonly number[]): number {
  return Math.floor((Math.min(...size) - 4) / 2);
}

/** A TOML number: `inf`, 0.5, 3. */
function number(value: number): string {
  return value === Infinity ? "inf" : String(value);
}

/** A TOML float. */
function real(value: number): string {
  return Number.isInteger(value) ? `${value}.0` : number(value);
}

/** A TOML basic string. */
export function tomlString(text: string): string {
  // eslint-disable-next-line no-control-regex -- these are the characters that TOML wants escaped
  return `"${text.replace(/["\\\u0000-\u001f\u007f]/g, (character) => {
    if (character === '"' || character === "\\") return `\\${character}`;
    return `\\u${character.charCodeAt(0).toString(16).padStart(4, "0")}`;
  })}"`;
}

function mapTable(values: FormValues): string[] {
  const lines = ["[map]", `kind = ${tomlString(values.generator)}`];
  if (values.generator === "file") {
    lines.push(`file = ${tomlString(values.mapFile)}`);
    return lines;
  }
  if (values.generator === "scene") {
    const { size, cellM } = SCENES[values.sceneName];
    lines.push(`size = [${size.join(", ")}]`, `cell_m = ${number(cellM)}`);
    lines.push("", "[map.scene]", `name = ${tomlString(values.sceneName)}`);
    return lines;
  }
  const [x, y, z] = values.size;
  lines.push(x === y && y === z ? `size = ${x}` : `size = [${x}, ${y}, ${z}]`);
  if (values.generator === "spheres") {
    lines.push(
      "",
      "[map.spheres]",
      `fill_ratio = ${number(values.spheresFillPercent / 100)}`,
      `radius_min = ${values.spheresRadiusMin}`,
      `radius_max = ${values.spheresRadiusMax}`,
      `connections = ${values.spheresConnections}`,
      `smoothing = ${values.spheresSmoothing}`,
    );
  } else if (values.generator === "noise") {
    lines.push(
      "",
      "[map.noise]",
      `fill = ${number(values.noiseFillPercent / 100)}`,
      `smoothing = ${values.noiseSmoothing}`,
    );
  } else if (values.generator === "building") {
    lines.push("", "[map.building]", `floors = ${values.buildingFloors}`);
  }
  return lines;
}

function agentsTable(values: FormValues): string[] {
  const lines = [
    "[agents]",
    `count = ${values.agents}`,
    `controller = ${tomlString(values.controller)}`,
    `share_period_ticks = ${values.sharePeriodTicks}`,
  ];
  const controller = CONTROLLERS.find((candidate) => candidate.value === values.controller);
  if (controller?.searches && values.isSearchBudgeted) {
    lines.push(`set = { search_time = "budgeted", search_cells_per_tick = ${values.searchCellsPerTick} }`);
  }
  return lines;
}

/** The body and the LiDAR; small and short-sighted in scenes, whose passages are narrow. */
function robotTables(values: FormValues): string[] {
  const lidar = ["[lidar]", `fov_rad = ${real((values.sensingFovDeg / 180) * Math.PI)}`];
  if (values.generator !== "scene") return lidar;
  const body = ["[body]", 'kind = "aerial"', "radius_m = 0.25", "speed_max_m_s = 2.0"];
  body.push("acceleration_m_s2 = 2.0", "deceleration_m_s2 = 2.0");
  return [...body, "", ...lidar, `range_m = ${real(SCENES[values.sceneName].lidarRangeM)}`];
}

/** The scenario of a form. */
export function toToml(values: FormValues): string {
  const lines = [
    `seed = ${values.seed}`,
    `duration_s = ${real(values.durationMin * 60)}`,
    `stop_when_explored = ${values.stopWhenExplored}`,
    ...(values.stopWhenCovered ? ["stop_when_covered = true"] : []),
    "",
    ...mapTable(values),
    "",
    ...agentsTable(values),
    "",
    ...robotTables(values),
    "",
    "[communication]",
    `range_m = ${real(values.communicationRangeM)}`,
    "",
    "[execution]",
    `rtf = ${values.rtf === 0 ? '"max"' : real(values.rtf)}`,
  ];
  return `${lines.join("\n")}\n`;
}

/** Errors of the form; empty if there are none. */
export function faults(values: FormValues): string[] {
  const found: string[] = [];
  if (values.generator === "file" && values.mapFile.trim() === "") {
    found.push("Map file: expected the path of a map on the machine of the simulator.");
  }
  if (!Number.isSafeInteger(values.seed) || values.seed < 0) {
    found.push("Seed: expected an integer from 0 on.");
  }
  if (values.generator === "spheres") {
    if (values.spheresRadiusMin > values.spheresRadiusMax) {
      found.push("Radius: the smallest exceeds the largest.");
    }
    const limit = radiusLimit(values.size);
    if (values.spheresRadiusMax > limit) {
      found.push(`Radius: at most ${limit} cells fit into a map of ${values.size.join(" x ")} cells.`);
    }
  }
  if (values.generator === "building" && values.size[2] < buildingHeight(values.buildingFloors)) {
    found.push(
      `Size: ${values.buildingFloors} floors need a height of ${buildingHeight(values.buildingFloors)} cells.`,
    );
  }
  return found;
}

/** A six-digit seed, as in the reference. `random` is in [0, 1). */
export function drawSeed(random: number): number {
  return 100000 + Math.floor(random * 900000);
}
