/** What the image shows in words: the caption of pictures, and its name for screen readers. */
import type { Run } from "../data/run.ts";
import { clockTime, finePercent } from "./format.ts";
import { sharesAt } from "./panel-state.ts";
import type { PanelState } from "./panel-state.ts";

/** Period of changes of the name while the time moves, milliseconds of wall time. */
const PERIOD_MS = 5000;

/** What the caption and the name depend on. */
type Shown = Pick<PanelState, "run" | "timeS" | "selected">;

/** The caption below a picture. */
export function captionOf(shown: Shown): string {
  return partsOf(shown).join("   ");
}

/** Names the canvas for screen readers, rarely while the time moves, and at once when it rests. */
export class SceneName {
  readonly #canvas: HTMLCanvasElement;
  #name = "";
  #namedMs = -Infinity;

  constructor(canvas: HTMLCanvasElement) {
    this.#canvas = canvas;
    canvas.setAttribute("role", "img");
    this.#set("The cave and its agents in three dimensions");
  }

  update(shown: Shown, isMoving: boolean, nowMs = performance.now()): void {
    if (isMoving && nowMs - this.#namedMs < PERIOD_MS) return;
    this.#namedMs = nowMs;
    const what = shown.run.setup.agents === 0 ? "The map" : "The cave and its agents";
    this.#set(`${what} in three dimensions: ${partsOf(shown).join(", ")}`);
  }

  #set(name: string): void {
    if (name === this.#name) return;
    this.#name = name;
    this.#canvas.setAttribute("aria-label", name);
  }
}

function partsOf({ run, timeS, selected }: Shown): string[] {
  if (run.setup.agents === 0) return mapParts(run);
  const { explored } = sharesAt(run, timeS);
  const whom = selected === null ? [] : [`agent ${selected}`];
  return [run.title, ...whom, clockTime(timeS), `${finePercent(explored)} explored`];
}

function mapParts({ title, terrain }: Run): string[] {
  const { size, cellM, freeCells, walls } = terrain;
  const free = `${((100 * freeCells) / walls.length).toFixed(1)} % free`;
  return [title.replace(/\.m3dm$/i, ""), `${size.join(" x ")} cells of ${cellM} m`, free];
}
