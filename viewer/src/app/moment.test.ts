import { describe, expect, it } from "vitest";
import type { Progress, Result } from "../data/run.ts";
import { AgentDigits, curves, neighbour, progressAt, seedOf, teamOf } from "./moment.ts";

function progress(timeS: number, explored: number): Progress {
  return {
    timeS,
    explored,
    covered: explored / 10,
    exploredBy: [explored / 2, explored / 3],
    coveredBy: [0, 0],
    believedBy: [0, 0],
    distanceM: [timeS, timeS],
    pairsInContact: 0,
    parcelBytes: 0,
  };
}

const TOLD = [progress(0, 0), progress(10, 0.2), progress(20, 0.4)];
const RESULT: Result = {
  ...progress(24.5, 1),
  tick: 1225,
  reason: "explored",
  counters: new Map(),
  digest: "00",
};

describe("progress", () => {
  it("is the last that was told", () => {
    const run = { progress: TOLD, result: RESULT };
    expect(progressAt(run, 9.99)?.timeS).toBe(0);
    expect(progressAt(run, 10)?.timeS).toBe(10);
    expect(progressAt(run, 24)?.timeS).toBe(20);
    expect(progressAt(run, 24.5)).toBe(RESULT);
    expect(progressAt({ progress: [], result: null }, 5)).toBeNull();
  });

  it("makes curves that end with the result, once", () => {
    const setup = { agents: 2 } as never;
    const [times, explored, covered, ...agents] = curves({ progress: TOLD, result: RESULT, setup });
    expect(times).toEqual([0, 10, 20, 24.5]);
    expect(explored).toEqual([0, 0.2, 0.4, 1]);
    expect(covered!.at(-1)).toBe(0.1);
    expect(agents.map((column) => column.at(-1))).toEqual([1 / 2, 1 / 3]);
    const toldAtEnd = [...TOLD, progress(24.5, 1)];
    expect(curves({ progress: toldAtEnd, result: RESULT, setup })[0]).toEqual([0, 10, 20, 24.5]);
  });
});

describe("agents", () => {
  it("are gone through with the cave between the last and the first", () => {
    const seen: (number | null)[] = [];
    for (let place: number | null = null, turn = 0; turn < 4; turn++)
      seen.push((place = neighbour(place, 1, 3)));
    expect(seen).toEqual([0, 1, 2, null]);
    expect(neighbour(null, -1, 3)).toBe(2);
    expect(neighbour(0, -1, 3)).toBeNull();
  });

  it("are named by a digit, or by two that come quickly", () => {
    const digits = new AgentDigits();
    expect(digits.typed(1, 0, 20)).toBe(1);
    expect(digits.typed(2, 500, 20)).toBe(12);
    expect(digits.typed(3, 600, 20)).toBe(3);
    expect(digits.typed(1, 5000, 20)).toBe(1);
    expect(digits.typed(2, 5700, 20)).toBe(2);
    expect(digits.typed(5, 5800, 20)).toBe(5);
    expect(digits.typed(0, 9000, 20)).toBe(0);
    expect(digits.typed(4, 9100, 20)).toBe(4);
  });

  it("that do not exist are not named", () => {
    const digits = new AgentDigits();
    expect(digits.typed(7, 0, 5)).toBeNull();
    expect(digits.typed(2, 100, 5)).toBe(2);
  });

  it("are a team in few words", () => {
    expect(teamOf(["rbw", "rbw"])).toBe("rbw");
    expect(teamOf(["rbw", "lvd visits_max=2", "rbw"])).toBe("2 rbw, 1 lvd");
    expect(teamOf(["lvd visits_max=2", "lvd"])).toBe("lvd");
  });
});

describe("the seed of a scenario", () => {
  it("is the one at the top", () => {
    expect(seedOf("duration_s = 1.0\nseed = 4711\n[map]\nseed = 3\n")).toBe("4711");
    expect(seedOf("[map]\nseed = 3\n")).toBeNull();
  });
});
