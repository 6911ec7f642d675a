/**
 * The state of the tools for a map: measuring between two points, the reach of a body, and starts.
 * Pure but for the questions that it asks.
 */
import { cellsOf, type AskRoom, type RoomAnswer } from "../data/map-room.ts";
import type { CellSet } from "../data/cell-set.ts";
import type { Vec3 } from "../data/run.ts";
import type { SurfaceHit } from "../data/surface-hit.ts";

/** What a click on the image does. */
export type RoomTool = "look" | "measure" | "start";

export const DEFAULT_RADIUS_M = 0.4;

export class MapRoom {
  tool: RoomTool = "look";
  radiusM = DEFAULT_RADIUS_M;
  isReachShown = false;
  /** Up to two points, metres. */
  measured: readonly Vec3[] = [];
  answer: RoomAnswer | null = null;
  problem: string | null = null;
  /** Whether an answer is awaited. */
  isAsking = false;
  /** Cells that a body reaches, while they are shown. */
  reach: CellSet | null = null;
  readonly #ask: AskRoom | null;
  readonly #cells: number;
  readonly #changed: () => void;
  #near: readonly Vec3[] = [];
  #asked = 0;

  /** `ask`: null without a server that answers; `cells`: number of cells of the map. */
  constructor(ask: AskRoom | null, cells: number, changed: () => void) {
    this.#ask = ask;
    this.#cells = cells;
    this.#changed = changed;
  }

  /** Whether there is somebody who answers. */
  get canAsk(): boolean {
    return this.#ask !== null;
  }

  get starts(): readonly Vec3[] {
    return this.answer?.starts ?? [];
  }

  /** A click on the image; null: beside the map. */
  clicked(hit: SurfaceHit | null): void {
    if (hit === null || this.tool === "look") return;
    if (this.tool === "measure") {
      this.measured = this.measured.length === 1 ? [...this.measured, hit.point] : [hit.point];
      this.#changed();
    } else {
      void this.#update([...this.#near, hit.free]);
    }
  }

  setTool(tool: RoomTool): void {
    this.tool = tool;
    this.#changed();
  }

  setRadius(radiusM: number): Promise<void> {
    this.radiusM = radiusM;
    return this.#update(this.#near);
  }

  showReach(isShown: boolean): Promise<void> {
    this.isReachShown = isShown;
    return this.#update(this.#near);
  }

  removeStart(index: number): Promise<void> {
    return this.#update(this.#near.filter((_, at) => at !== index));
  }

  clearMeasured(): void {
    this.measured = [];
    this.#changed();
  }

  /** Asks about these places; the answer to an earlier question is dropped. */
  async #update(near: readonly Vec3[]): Promise<void> {
    const ask = this.#ask;
    this.#near = near;
    const number = ++this.#asked;
    if (ask === null) return;
    this.isAsking = true;
    this.#changed();
    try {
      const answer = await ask({ radiusM: this.radiusM, near });
      if (number !== this.#asked) return;
      this.answer = answer;
      this.problem = answer.problem;
      // From now on the bodies are there.
      this.#near = answer.starts;
      this.reach = this.isReachShown ? cellsOf(answer.runs, this.#cells) : null;
    } catch (error) {
      if (number !== this.#asked) return;
      this.problem = (error as Error).message;
      this.answer = null;
      this.reach = null;
    }
    this.isAsking = false;
    this.#changed();
  }
}

/** The distance of two points, and its parts along the axes; null without two points. */
export function distanceText(points: readonly Vec3[]): string | null {
  const [a, b] = points;
  if (a === undefined || b === undefined) return null;
  const parts = b.map((value, axis) => value - a[axis]!);
  const along = parts.map((part, axis) => `${"xyz"[axis]} ${part.toFixed(2)}`).join(", ");
  return `${Math.hypot(...parts).toFixed(2)} m (${along})`;
}
