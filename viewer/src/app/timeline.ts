/**
 * The timeline: the known part of a run, the time shown, and exploration milestones. It can be
 * dragged, and has the keys of a slider.
 */
import type { Run } from "../data/run.ts";
import { labels, milestones, shareOf, timeAt, recordedMilestones } from "./timeline-axis.ts";
import { el, fill, setText } from "./dom.ts";
import { clockTime, finePercent, percent } from "./format.ts";
import { sharesAt } from "./panel-state.ts";

/** Seek steps of the slider keys, seconds. */
const KEY_STEPS_S: Record<string, number> = {
  ArrowLeft: -1,
  ArrowDown: -1,
  ArrowRight: 1,
  ArrowUp: 1,
  PageDown: -60,
  PageUp: 60,
};

/** Width of a label, pixels. */
const LABEL_PX = 72;
/** Width of the label of a milestone, pixels; one without room has its text as a tooltip only. */
const MARK_LABEL_PX = 40;

export class Timeline {
  readonly root: HTMLElement;
  readonly #known = el("div", { class: "tl-known" });
  readonly #played = el("div", { class: "tl-played" });
  readonly #handle = el("div", { class: "tl-handle" });
  readonly #marks = el("div", { class: "tl-marks" });
  readonly #labels = el("div", { class: "tl-labels", "aria-hidden": "true" });
  readonly #hint = el("div", { class: "tl-hint", hidden: true });
  readonly #track: HTMLElement;
  /** The track, and the marks over it. */
  readonly #line: HTMLElement;
  readonly #seek: (timeS: number) => void;
  #run: Run | null = null;
  #timeS = 0;
  #lineEndS = 1;
  #marked = "";
  #labelled = "";

  constructor(seek: (timeS: number) => void) {
    this.#seek = seek;
    this.#track = el(
      "div",
      {
        class: "tl-track",
        role: "slider",
        tabindex: 0,
        "aria-label": "Time",
        "aria-valuemin": 0,
        testid: "timeline",
      },
      el("div", { class: "tl-rail" }, this.#known, this.#played),
      this.#handle,
      this.#hint,
    );
    this.#line = el("div", { class: "tl-line" }, this.#track, this.#marks);
    this.root = el("div", { class: "tl" }, this.#line, this.#labels);
    this.#listen();
  }

  /** `lineEndS`: the time at the right end. */
  update(run: Run, timeS: number, lineEndS: number): void {
    this.#run = run;
    this.#timeS = timeS;
    this.#lineEndS = lineEndS;
    const share = shareOf(timeS, this.#lineEndS);
    this.#known.style.transform = `scaleX(${shareOf(run.endS, this.#lineEndS)})`;
    this.#played.style.transform = `scaleX(${share})`;
    this.#handle.style.left = `${share * 100}%`;
    this.#track.setAttribute("aria-valuemax", run.endS.toFixed(0));
    this.#track.setAttribute("aria-valuenow", timeS.toFixed(0));
    this.#track.setAttribute("aria-valuetext", `${clockTime(timeS)} of ${clockTime(run.endS)}`);
    this.#mark(run);
    this.#label();
  }

  #mark(run: Run): void {
    // Milestones only change when more of the run is known.
    const key = `${run.id} ${run.endS} ${this.#lineEndS} ${run.result !== null} ${this.#track.clientWidth}`;
    if (key === this.#marked) return;
    this.#marked = key;
    const found =
      recordedMilestones(run.result) ??
      milestones((timeS) => run.seenAt(timeS), run.terrain.freeCells, run.endS);
    const width = this.#track.clientWidth;
    let labelledToPx = -Infinity;
    const marks = found.map(({ share, timeS }) => {
      const percentage = `${Number((share * 100).toFixed(1))} %`;
      const name = `${percentage} explored at ${clockTime(timeS)}`;
      const atPx = shareOf(timeS, this.#lineEndS) * width;
      const hasLabel = atPx - labelledToPx >= MARK_LABEL_PX;
      if (hasLabel) labelledToPx = atPx;
      const label = hasLabel ? el("span", { class: "tl-mark-label" }, percentage) : null;
      const mark = el("button", {
        type: "button",
        class: "tl-mark",
        title: name,
        "aria-label": name,
        testid: `milestone-${Number((share * 100).toFixed(1))}`,
        style: `left: ${shareOf(timeS, this.#lineEndS) * 100}%; --weight: ${share}`,
        onclick: () => this.#seek(timeS),
      });
      if (label) mark.append(label);
      return mark;
    });
    fill(this.#marks, ...marks);
  }

  #label(): void {
    const width = this.#track.clientWidth;
    const maxCount = Math.max(1, Math.floor(width / LABEL_PX));
    const key = `${this.#lineEndS} ${maxCount}`;
    if (key === this.#labelled) return;
    this.#labelled = key;
    const texts = labels(this.#lineEndS, maxCount).map((timeS) => {
      const share = shareOf(timeS, this.#lineEndS);
      const edge = share === 0 ? "is-first" : share > 0.96 ? "is-last" : undefined;
      return el("span", { class: edge, style: `left: ${share * 100}%` }, clockTime(timeS));
    });
    fill(this.#labels, ...texts);
  }

  #listen(): void {
    const line = this.#line;
    const at = (event: PointerEvent) => {
      const box = line.getBoundingClientRect();
      return timeAt(event.clientX - box.left, box.width, this.#lineEndS);
    };
    line.addEventListener("pointerdown", (event) => {
      if (event.button !== 0 || (event.target as HTMLElement).closest(".tl-mark")) return;
      line.setPointerCapture(event.pointerId);
      this.#seek(at(event));
    });
    line.addEventListener("pointermove", (event) => {
      this.#showHint(at(event));
      if (line.hasPointerCapture(event.pointerId)) this.#seek(at(event));
    });
    line.addEventListener("pointerleave", () => (this.#hint.hidden = true));
    this.#track.addEventListener("keydown", (event) => {
      const stepS = KEY_STEPS_S[event.key];
      if (stepS === undefined) return;
      event.preventDefault();
      event.stopPropagation();
      this.#seek(this.#timeS + stepS * (event.shiftKey ? 10 : 1));
    });
  }

  #showHint(timeS: number): void {
    const run = this.#run;
    if (!run) return;
    this.#hint.hidden = false;
    this.#hint.style.left = `${shareOf(timeS, this.#lineEndS) * 100}%`;
    const known = timeS <= run.endS;
    const { explored } = sharesAt(run, timeS);
    const share = explored >= 0.99 ? finePercent(explored) : percent(explored);
    setText(
      this.#hint,
      known
        ? `${clockTime(timeS)}, ${share} explored`
        : `${clockTime(timeS)}, ${run.isComplete ? "after the end" : "not received yet"}`,
    );
  }
}
