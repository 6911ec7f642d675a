/** Queries on a run for the panels. Pure. */
import type { Progress, Run } from "../data/run.ts";
import type { LiveConnection } from "./live.ts";

/** The state that the panels show. */
export interface PanelState {
  readonly run: Run;
  readonly timeS: number;
  readonly selected: number | null;
  /** The simulator of the run; null: a recording. */
  readonly live: LiveConnection | null;
  /** Measured real-time factor of a live run. */
  readonly realTimeFactor: number;
  /** The time at the right end of the timeline. */
  readonly lineEndS: number;
}

/** The last progress message up to this time, the result included; null: none yet. */
export function progressAt(run: Pick<Run, "progress" | "result">, timeS: number): Progress | null {
  const { progress, result } = run;
  if (result && result.timeS <= timeS) return result;
  let low = 0;
  let high = progress.length;
  while (low < high) {
    const middle = (low + high) >>> 1;
    if (progress[middle]!.timeS <= timeS) low = middle + 1;
    else high = middle;
  }
  return progress[low - 1] ?? null;
}

/**
 * Shares of the free cells at this time: those of the result at the end, before that counted from
 * the cells.
 */
export function sharesAt(run: Run, timeS: number): { explored: number; covered: number } {
  const { result } = run;
  if (result && result.timeS <= timeS) return { explored: result.explored, covered: result.covered };
  const free = run.terrain.freeCells || 1;
  return { explored: run.seenAt(timeS) / free, covered: run.coveredAt(timeS) / free };
}

/** Resolves when the run is known up to this time, or completely. */
export function waitUntilKnown(run: Run, timeS: number): Promise<void> {
  if (run.endS >= timeS || run.isComplete) return Promise.resolve();
  return new Promise((resolve) => {
    const unlisten = run.onUpdate(() => {
      if (run.endS < timeS && !run.isComplete) return;
      unlisten();
      resolve();
    });
  });
}

/**
 * Columns of the chart: times, explored, covered, and the explored share of each agent; the result
 * is the last row.
 */
export function progressColumns(run: Pick<Run, "progress" | "result" | "setup">): (number | null)[][] {
  const { progress, result, setup } = run;
  const last = progress.at(-1);
  const points: Progress[] =
    result && (!last || last.timeS < result.timeS) ? [...progress, result] : [...progress];
  const columns: (number | null)[][] = [
    points.map((point) => point.timeS),
    points.map((point) => point.explored),
    points.map((point) => point.covered),
  ];
  for (let agent = 0; agent < setup.agents; agent++) {
    columns.push(points.map((point) => point.exploredBy[agent] ?? null));
  }
  return columns;
}

/** The name of a controller without its settings. */
export function nameOf(controller: string): string {
  return controller.split(" ", 1)[0]!;
}

/** Summary of the controllers of a team: `dsvp`, `8 dsvp, 2 rbw`. */
export function teamOf(controllers: readonly string[]): string {
  const counts = new Map<string, number>();
  for (const name of controllers.map(nameOf)) counts.set(name, (counts.get(name) ?? 0) + 1);
  if (counts.size === 1) return [...counts.keys()][0]!;
  return [...counts].map(([controller, count]) => `${count} ${controller}`).join(", ");
}
