import { describe, expect, it } from "vitest";
import {
  labels,
  lineEndS,
  milestones,
  shareOf,
  timeAt,
  toTick,
  recordedMilestones,
} from "./timeline-axis.ts";

describe("the end of the timeline", () => {
  it("is that of a complete run", () => {
    expect(lineEndS(407.2, 1800, true)).toBe(407.2);
  });

  it("is between the known end and the time limit", () => {
    for (let endS = 0; endS <= 2000; endS += 7.3) {
      const line = lineEndS(endS, 1800, false);
      expect(line).toBeGreaterThanOrEqual(endS);
      expect(line).toBeLessThanOrEqual(Math.max(1800, endS));
    }
  });

  it("grows in steps", () => {
    expect(lineEndS(0, 1800, false)).toBe(60);
    expect(lineEndS(55, 1800, false)).toBe(60);
    expect(lineEndS(59, 1800, false)).toBe(120);
    expect(lineEndS(20000, 1e6, false)).toBe(21600);
  });
});

describe("positions and times", () => {
  it("are inverse to each other", () => {
    for (const timeS of [0, 1, 99.5, 400])
      expect(timeAt(shareOf(timeS, 400) * 720, 720, 400)).toBeCloseTo(timeS, 9);
  });

  it("are clamped", () => {
    expect(timeAt(-5, 100, 60)).toBe(0);
    expect(timeAt(500, 100, 60)).toBe(60);
    expect(timeAt(5, 0, 60)).toBe(0);
    expect(shareOf(10, 0)).toBe(0);
  });

  it("round down to ticks", () => {
    expect(toTick(0.039)).toBeCloseTo(0.02, 12);
    expect(toTick(35 * 0.02)).toBeCloseTo(0.7, 12);
  });

  it("have a limited number of round labels", () => {
    expect(labels(60, 6)).toEqual([0, 10, 20, 30, 40, 50, 60]);
    for (const endS of [1, 47, 407, 1800, 7200, 3e5]) expect(labels(endS, 8).length).toBeLessThanOrEqual(9);
  });
});

describe("milestones", () => {
  /** One cell is seen every tenth of a second, up to `all`. */
  const seen = (all: number) => (timeS: number) => Math.min(all, Math.floor(timeS * 10 + 1e-6));

  it("are the first ticks with that many cells", () => {
    const found = milestones(seen(1000), 1000, 120);
    expect(found.map(({ share }) => share)).toEqual([0.5, 0.9, 0.99, 0.999, 1]);
    [50, 90, 99, 99.9, 100].forEach((timeS, index) => expect(found[index]!.timeS).toBeCloseTo(timeS, 9));
  });

  it("stop at the share reached", () => {
    expect(milestones(seen(1000), 1000, 95).map(({ share }) => share)).toEqual([0.5, 0.9]);
    expect(milestones(seen(1000), 1000, 0)).toEqual([]);
    expect(milestones(seen(0), 0, 10)).toEqual([]);
  });

  it("tolerate rounding errors", () => {
    const found = milestones(seen(10), 10, 2, [0.9]);
    expect(found[0]!.timeS).toBeCloseTo(0.9, 9);
  });

  it("are taken from the result if it has them", () => {
    const counters = new Map([
      ["scans", 7],
      ["tick_explored_permille_500", 100],
      ["tick_explored_permille_999", 2000],
    ]);
    expect(recordedMilestones({ counters })).toEqual([
      { share: 0.5, timeS: 2 },
      { share: 0.999, timeS: 40 },
    ]);
    expect(recordedMilestones({ counters: new Map([["scans", 7]]) })).toBeNull();
    expect(recordedMilestones(null)).toBeNull();
  });
});
