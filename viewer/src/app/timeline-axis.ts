/** Arithmetic of the timeline: positions, its length, and milestones. Pure. */
import { TICK_S, type Result } from "../data/run.ts";

/** Lengths of a growing timeline, seconds. */
const ENDS_S = [60, 120, 300, 600, 900, 1200, 1800, 2700, 3600, 5400, 7200];

/**
 * End of the timeline: that of a complete run, else the next of a few lengths, so that the known
 * part does not shrink all the time while the run grows; never beyond the time limit.
 */
export function lineEndS(endS: number, durationS: number, isComplete: boolean): number {
  if (isComplete) return Math.max(endS, TICK_S);
  const wanted = endS * 1.05;
  let end = ENDS_S.find((candidate) => candidate >= wanted);
  if (end === undefined) end = Math.ceil(wanted / 7200) * 7200;
  return Math.max(Math.min(end, durationS), endS, TICK_S);
}

/** The time at a pixel position, clamped to the ends. */
export function timeAt(x: number, width: number, endS: number): number {
  if (width <= 0) return 0;
  return Math.min(1, Math.max(0, x / width)) * endS;
}

/** The share of the timeline before a time. */
export function shareOf(timeS: number, endS: number): number {
  return endS <= 0 ? 0 : Math.min(1, Math.max(0, timeS / endS));
}

/** The start of the tick that contains `timeS`. */
export function toTick(timeS: number): number {
  return Math.floor(timeS / TICK_S + 1e-6) * TICK_S;
}

/** Round times for labels, at most `maxCount` intervals. */
export function labels(endS: number, maxCount: number): number[] {
  const steps = [1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 28800, 86400];
  let step = steps.find((candidate) => endS / candidate <= maxCount);
  if (step === undefined) step = Math.ceil(endS / maxCount / 86400) * 86400;
  const times: number[] = [];
  for (let time = 0; time <= endS + 1e-9; time += step) times.push(time);
  return times;
}

export interface Milestone {
  /** Explored share of the free cells. */
  readonly share: number;
  readonly timeS: number;
}

/** Shares that are marked on the timeline. */
export const MILESTONE_SHARES = [0.5, 0.9, 0.99, 0.999, 1] as const;

/** The milestones in the counters of a result; null: it has none. */
export function recordedMilestones(result: Pick<Result, "counters"> | null): Milestone[] | null {
  const found: Milestone[] = [];
  for (const share of MILESTONE_SHARES) {
    const tick = result?.counters.get(`tick_explored_permille_${share * 1000}`);
    if (tick !== undefined) found.push({ share, timeS: tick * TICK_S });
  }
  return found.length > 0 ? found : null;
}

/**
 * When each share was reached: the first tick with that many seen cells. A recording contains cells
 * only when they are in an observation, some seconds after the scan at worst: prefer
 * `recordedMilestones`.
 */
export function milestones(
  seenAt: (timeS: number) => number,
  freeCells: number,
  endS: number,
  shares: readonly number[] = MILESTONE_SHARES,
): Milestone[] {
  const reached: Milestone[] = [];
  for (const share of shares) {
    // Rounding errors such as 9.000000000000002 for 0.9 * 10 must not require one cell too many.
    const needed = Math.ceil(share * freeCells - 1e-6);
    if (freeCells === 0 || seenAt(endS) < needed) break;
    let low = 0;
    let high = Math.ceil(endS / TICK_S);
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (seenAt(middle * TICK_S) >= needed) high = middle;
      else low = middle + 1;
    }
    reached.push({ share, timeS: Math.min(low * TICK_S, endS) });
  }
  return reached;
}
