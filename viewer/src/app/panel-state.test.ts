import { describe, expect, it } from "vitest";
import type { Progress, Result } from "../data/run.ts";
import { progressAt, progressColumns, teamOf } from "./panel-state.ts";

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
    messageBytes: 0,
  };
}

const PROGRESS = [progress(0, 0), progress(10, 0.2), progress(20, 0.4)];
const RESULT: Result = {
  ...progress(24.5, 1),
  tick: 1225,
  reason: "explored",
  counters: new Map(),
  digest: "00",
};

describe("progress", () => {
  it("is the last one published", () => {
    const run = { progress: PROGRESS, result: RESULT };
    expect(progressAt(run, 9.99)?.timeS).toBe(0);
    expect(progressAt(run, 10)?.timeS).toBe(10);
    expect(progressAt(run, 24)?.timeS).toBe(20);
    expect(progressAt(run, 24.5)).toBe(RESULT);
    expect(progressAt({ progress: [], result: null }, 5)).toBeNull();
  });

  it("columns end with the result, once", () => {
    const setup = { agents: 2 } as never;
    const [times, explored, covered, ...agents] = progressColumns({
      progress: PROGRESS,
      result: RESULT,
      setup,
    });
    expect(times).toEqual([0, 10, 20, 24.5]);
    expect(explored).toEqual([0, 0.2, 0.4, 1]);
    expect(covered!.at(-1)).toBe(0.1);
    expect(agents.map((column) => column.at(-1))).toEqual([1 / 2, 1 / 3]);
    const progressToEnd = [...PROGRESS, progress(24.5, 1)];
    expect(progressColumns({ progress: progressToEnd, result: RESULT, setup })[0]).toEqual([0, 10, 20, 24.5]);
  });
});

describe("controllers of a team", () => {
  it("are summarised", () => {
    expect(teamOf(["rbw", "rbw"])).toBe("rbw");
    expect(teamOf(["rbw", "lvd visits_max=2", "rbw"])).toBe("2 rbw, 1 lvd");
    expect(teamOf(["lvd visits_max=2", "lvd"])).toBe("lvd");
  });
});
