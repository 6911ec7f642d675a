/**
 * What a run has to say of one moment, for the panels. Pure.
 */
import type { Progress, Run } from "../data/run.ts";
import type { LiveConnection } from "./live.ts";

/** What the panels show. */
export interface Moment {
  readonly run: Run;
  readonly timeS: number;
  readonly selected: number | null;
  /** The simulator that the run comes from; null: a recording. */
  readonly live: LiveConnection | null;
  /** Sim seconds for each second on the wall in which a run under way grows. */
  readonly pace: number;
}

/** What the server has said last at this time, the result included; null: nothing yet. */
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

/** Shares of the free cells at this time: the server's own at the end, before that those of the cells. */
export function sharesAt(run: Run, timeS: number): { explored: number; covered: number } {
  const { result } = run;
  if (result && result.timeS <= timeS) return { explored: result.explored, covered: result.covered };
  const free = run.terrain.freeCells || 1;
  return { explored: run.seenAt(timeS) / free, covered: run.coveredAt(timeS) / free };
}

/** Resolves when so much of a run is known, or no more will be. */
export function known(run: Run, timeS: number): Promise<void> {
  if (run.endS >= timeS || run.isComplete) return Promise.resolve();
  return new Promise((resolve) => {
    const unlisten = run.onNews(() => {
      if (run.endS < timeS && !run.isComplete) return;
      unlisten();
      resolve();
    });
  });
}

/** Columns for the curves: times, explored, covered, and the explored share of each agent. The end comes last. */
export function curves(run: Pick<Run, "progress" | "result" | "setup">): (number | null)[][] {
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

/** The name of a controller, which may have its settings after it. */
export function nameOf(controller: string): string {
  return controller.split(" ", 1)[0]!;
}

/** Controllers of a team in few words: `dsvp`, `8 dsvp, 2 rbw`. */
export function teamOf(controllers: readonly string[]): string {
  const counts = new Map<string, number>();
  for (const name of controllers.map(nameOf)) counts.set(name, (counts.get(name) ?? 0) + 1);
  if (counts.size === 1) return [...counts.keys()][0]!;
  return [...counts].map(([controller, count]) => `${count} ${controller}`).join(", ");
}

/** The seed that a scenario names at its top; null if it does not. */
export function seedOf(scenarioToml: string): string | null {
  const top = scenarioToml.split(/^\s*\[/m, 1)[0]!;
  return /^\s*seed\s*=\s*([0-9_]+)/m.exec(top)?.[1] ?? null;
}

/** The agent that the bar's buttons lead to: the cave lies between the last one and the first. */
export function neighbour(selected: number | null, step: 1 | -1, agents: number): number | null {
  // Place 0 is the cave, and agent n has place n + 1.
  const places = agents + 1;
  const place = ((selected === null ? 0 : selected + 1) + step + places) % places;
  return place === 0 ? null : place - 1;
}

/** How long a second digit may take, milliseconds. */
const DIGITS_MS = 600;

/** Digits that are typed become the number of an agent; two of them one number if they come quickly and there is such an agent. */
export class AgentDigits {
  #last: { digit: number; atMs: number } | null = null;

  /** The agent that is meant now; null: there is none of that number. */
  typed(digit: number, atMs: number, agents: number): number | null {
    const before = this.#last;
    this.#last = { digit, atMs };
    if (before && before.digit > 0 && atMs - before.atMs <= DIGITS_MS) {
      const both = before.digit * 10 + digit;
      if (both < agents) {
        this.#last = null;
        return both;
      }
    }
    return digit < agents ? digit : null;
  }
}
