import { describe, expect, it } from "vitest";
import { readFileSync } from "node:fs";
import { parse } from "smol-toml";
import { GENERATORS } from "./start-form.ts";
import SCENARIO_KEYS from "./scenario-keys.json";
import {
  buildingHeight,
  DEFAULTS,
  drawSeed,
  faults,
  FORM_KEYS,
  help,
  radiusLimit,
  RANGES,
  SCENES,
  type SceneName,
  tomlString,
  toToml,
} from "./scenario.ts";

describe("the scenario of the form", () => {
  it("defaults to the setting of the reference", () => {
    expect(toToml(DEFAULTS)).toBe(`seed = 1
duration_s = 1800.0
stop_when_explored = true

[map]
kind = "spheres"
size = 50

[map.spheres]
fill_ratio = 0.2
radius_min = 3
radius_max = 8
connections = 3
smoothing = 5

[agents]
count = 3
controller = "rbw"
share_period_ticks = 251

[lidar]
fov_rad = 6.283185307179586

[communication]
range_m = inf

[execution]
rtf = 1.0
`);
    expect(faults(DEFAULTS)).toEqual([]);
  });

  it("has the parameters of the chosen generator only", () => {
    const noise = toToml({ ...DEFAULTS, generator: "noise", size: [100, 80, 30] });
    expect(noise).toContain("size = [100, 80, 30]\n\n[map.noise]\nfill = 0.53\nsmoothing = 5\n");
    expect(noise).not.toContain("map.spheres");
    const building = toToml({ ...DEFAULTS, generator: "building", size: [60, 60, 13] });
    expect(building).toContain("[map.building]\nfloors = 3\n");
    const file = toToml({ ...DEFAULTS, generator: "file", mapFile: 'a "cave"\\1.m3dm' });
    expect(file).toContain('[map]\nkind = "file"\nfile = "a \\"cave\\"\\\\1.m3dm"\n\n[agents]');
    expect(file).not.toContain("size");
    const mine = toToml({ ...DEFAULTS, generator: "mine" });
    expect(mine).toContain('[map]\nkind = "mine"\nsize = 50\n\n[agents]');
  });

  it("has a place at the scale of its shipped scenario", () => {
    for (const name of Object.keys(SCENES) as SceneName[]) {
      const text = readFileSync(`../launch_scripts/scenarios/${name}.toml`, "utf8");
      const [form, shipped] = [toToml({ ...DEFAULTS, generator: "scene", sceneName: name }), text].map(
        (toml) => {
          const { map, body, lidar } = parse(toml) as Record<string, Record<string, unknown>>;
          return { map, body, rangeM: lidar!["range_m"] };
        },
      );
      expect(form, name).toEqual(shipped);
    }
  });

  it("knows all kinds of maps", () => {
    const schema = readFileSync("../launch_scripts/scenarios/scenario.schema.json", "utf8");
    const kinds = (
      JSON.parse(schema) as { properties: { map: { properties: { kind: { enum: string[] } } } } }
    ).properties.map.properties.kind.enum;
    expect(GENERATORS.map(({ value }) => value as string).sort()).toEqual([...kinds].sort());
  });

  it("has a search budget only for controllers that search", () => {
    const set = 'set = { search_time = "budgeted", search_cells_per_tick = 100 }';
    expect(toToml({ ...DEFAULTS, controller: "lvd" })).toContain(set);
    expect(toToml({ ...DEFAULTS, controller: "lvd", isSearchBudgeted: false })).not.toContain("search_time");
    expect(toToml({ ...DEFAULTS, controller: "dsvp" })).not.toContain("search_time");
  });

  it("writes limited and unlimited values", () => {
    const text = toToml({
      ...DEFAULTS,
      communicationRangeM: 50,
      sensingFovDeg: 180,
      rtf: 0,
      stopWhenCovered: true,
    });
    expect(text).toContain("range_m = 50.0\n");
    expect(text).toContain(`fov_rad = ${Math.PI}\n`);
    expect(text).toContain('rtf = "max"\n');
    expect(text).toContain("stop_when_covered = true\n");
  });

  it("escapes strings", () => {
    expect(tomlString("a\nb\u0007")).toBe('"a\\u000ab\\u0007"');
  });
});

describe("errors of the form", () => {
  it("say what is expected", () => {
    expect(faults({ ...DEFAULTS, generator: "file" })[0]).toMatch(/^Map file:/);
    expect(faults({ ...DEFAULTS, seed: NaN })[0]).toMatch(/^Seed:/);
    expect(faults({ ...DEFAULTS, spheresRadiusMin: 9 })[0]).toMatch(/^Radius:/);
    expect(faults({ ...DEFAULTS, size: [50, 50, 30], spheresRadiusMax: 14 })[0]).toContain(
      "at most 13 cells",
    );
    expect(faults({ ...DEFAULTS, generator: "building", size: [60, 60, 12] })[0]).toContain("13 cells");
  });

  it("follow the server's limits", () => {
    expect(radiusLimit([50, 50, 30])).toBe(13);
    expect(buildingHeight(3)).toBe(13);
  });
});

describe("a random seed", () => {
  it("has six digits", () => {
    expect(drawSeed(0)).toBe(100000);
    expect(drawSeed(1 - Number.EPSILON)).toBe(999999);
  });
});

describe("the keys of the form", () => {
  const declared = (name: keyof typeof FORM_KEYS) => {
    const key: { help: string; default?: unknown; min?: number; max?: number } =
      SCENARIO_KEYS[FORM_KEYS[name].key];
    return key;
  };
  const names = Object.keys(FORM_KEYS) as (keyof typeof FORM_KEYS)[];

  it("have the defaults of the server", () => {
    const compared = names.filter((name) => declared(name).default !== undefined);
    expect(compared.length).toBeGreaterThan(10);
    for (const name of compared) {
      const value = DEFAULTS[name];
      const scaled = typeof value === "number" ? value * FORM_KEYS[name].factor : value;
      if (typeof scaled === "number") expect(scaled, name).toBeCloseTo(declared(name).default as number, 12);
      else expect(scaled, name).toBe(declared(name).default);
    }
  });

  it("have ranges that the server accepts", () => {
    const ranges: [keyof typeof FORM_KEYS, keyof typeof RANGES][] = [
      ["agents", "agents"],
      ["durationMin", "durationMin"],
      ["size", "size"],
      ["size", "buildingHeight"],
      ["spheresFillPercent", "spheresFillPercent"],
      ["spheresRadiusMin", "spheresRadius"],
      ["spheresRadiusMax", "spheresRadius"],
      ["spheresConnections", "spheresConnections"],
      ["spheresSmoothing", "smoothing"],
      ["noiseSmoothing", "smoothing"],
      ["noiseFillPercent", "noiseFillPercent"],
      ["communicationRangeM", "communicationRangeM"],
      ["sensingFovDeg", "sensingFovDeg"],
      ["sharePeriodTicks", "sharePeriodTicks"],
    ];
    for (const [name, range] of ranges) {
      const { min = -Infinity, max = Infinity } = declared(name);
      expect(RANGES[range].min * FORM_KEYS[name].factor, name).toBeGreaterThanOrEqual(min);
      expect(RANGES[range].max * FORM_KEYS[name].factor, name).toBeLessThanOrEqual(max);
    }
  });

  it("have a help text", () => {
    expect(help("sensingFovDeg")).toMatch(/^Full opening angle/);
  });
});
