import { describe, expect, it } from "vitest";
import { recordedScenario } from "./recorded-scenario.ts";

describe("the scenario of a recording", () => {
  it("has the seed at the top", () => {
    expect(recordedScenario("duration_s = 1.0\nseed = 4711\n[map]\nseed = 3\n").seed).toBe("4711");
    expect(recordedScenario("[map]\nseed = 3\n").seed).toBeNull();
  });

  it("has seeds beyond 2^53 to the last digit", () => {
    expect(recordedScenario("seed = 9223372036854775807").seed).toBe("9223372036854775807");
  });

  it("has the sensor settings", () => {
    const toml = `
      lidar = { pattern = "shell", shell_radius_cells = 12 } # an inline table
      [sensor]
      pose_bound_m = inf
      [localisation]
      turn_bias = 0.1
      [recording]
      poses_period_ticks = 0`;
    expect(recordedScenario(toml)).toEqual({
      seed: null,
      lidarPattern: "shell",
      shellRadiusCells: 12,
      hasRows: false,
      poseBoundM: Infinity,
      hasDrift: true,
      posesPeriodTicks: 0,
      obstacles: [],
    });
  });

  it.each([
    ["[lidar]\nrange_m = 3.0", false],
    ['lidar = { pattern = "lattice" }', false],
    ['lidar = { pattern = "ring" }', true],
    ['lidar = { preset = "d435" }', true],
    ['[[lidars]]\nname = "top"', true],
  ])("knows which rays are rows: %j", (toml, hasRows) => {
    expect(recordedScenario(toml).hasRows).toBe(hasRows);
  });

  it("has the shapes of moving obstacles by number, null for one that it does not know", () => {
    const toml = `
      [[obstacle]]
      kind = "box"
      size_m = [0.5, 1, 1.8]
      [[obstacle]]
      kind = "cone"
      radius_m = 1.0
      [[obstacle]]
      kind = "sphere"
      radius_m = 0.6
      [[obstacle]]
      kind = "box"
      size_m = [1.0, 0.0, 2.0]`;
    expect(recordedScenario(toml).obstacles).toEqual([
      { kind: "box", sizeM: [0.5, 1, 1.8] },
      null,
      { kind: "sphere", radiusM: 0.6 },
      null,
    ]);
    expect(recordedScenario("obstacle = 3").obstacles).toEqual([]);
  });

  it.each(["", "seed = ", "lidar = 3", '[lidar]\npattern = 7\nshell_radius_cells = "many"', "seed = 1.5"])(
    "has null for what is missing or malformed: %j",
    (toml) => {
      expect(Object.values(recordedScenario(toml))).toEqual([null, null, null, false, null, false, null, []]);
    },
  );
});
