/**
 * Two recordings side by side, with linked time: the page twice, each in a frame of this one.
 *
 * Seeking, playing, pausing or changing the rate of one side applies to both. Both play by their own
 * clocks, so that the longer one continues when the shorter one has ended; the side that was touched
 * last leads, and the other is set right if it drifts. A side whose recording is still being read
 * catches up as soon as it can. Both timelines have the length of the longer one. Cameras, layers and
 * selections are not linked.
 */
import { el } from "./dom.ts";
import { PLAYBACK_EVENT, type Handle } from "./handle.ts";
import { besideOf } from "./shared-link.ts";

/** Drift after which the other side is set right, seconds of wall time. */
const DRIFT_S = 0.1;

/** Names of the sides, for screen readers. */
const NAMES = ["First recording", "Second recording"] as const;

export class Comparison {
  readonly #frames: readonly HTMLIFrameElement[];
  #leader = 0;

  /** `search` is the query of the page, with `recording` and `beside`. */
  constructor(root: HTMLElement, search: string) {
    this.#frames = [search, besideOf(search)].map((query, side) => {
      const address = new URLSearchParams(query);
      address.set("side", String(side + 1));
      const frame = el("iframe", { class: "side-by-side", title: NAMES[side]!, testid: `side-${side + 1}` });
      frame.src = `?${address.toString()}`;
      frame.addEventListener("load", () => this.#listen(side));
      return frame;
    });
    root.append(el("main", { class: "comparison" }, el("h1", {}, "Two recordings"), ...this.#frames));
    document.title = "Two recordings - MAES viewer";
    requestAnimationFrame(() => this.#correct());
  }

  #handle(side: number): Handle | undefined {
    return this.#frames[side]!.contentWindow?.maes;
  }

  #listen(side: number): void {
    this.#frames[side]!.contentWindow?.addEventListener(PLAYBACK_EVENT, () => {
      this.#leader = side;
      const leader = this.#handle(side);
      if (leader) this.#handle(1 - side)?.follow(leader.playback);
    });
    // Keys belong to the side that has the focus: the first one, until the other is touched.
    if (side === 0) this.#frames[0]!.contentWindow?.focus();
  }

  /** Sets the other side right while both play, and both timelines to one length. */
  #correct(): void {
    const sides = [this.#handle(0), this.#handle(1)];
    const endS = Math.max(...sides.map((side) => side?.lineEndS ?? 0));
    for (const side of sides) side?.scaleTo(endS);
    const other = this.#handle(1 - this.#leader);
    const [led, present] = [this.#handle(this.#leader)?.playback, other?.playback];
    if (led?.isPlaying === true && present?.isPlaying === true) {
      const drift = Math.abs(led.timeS - present.timeS);
      if (drift > DRIFT_S * led.rate) other!.follow(led);
    }
    requestAnimationFrame(() => this.#correct());
  }
}
