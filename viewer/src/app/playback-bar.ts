/**
 * The bar at the bottom: play button, time, playback rate, timeline, and the button that follows a
 * live run.
 */
import { el, iconButton, setHidden, setIcon, setText, textButton } from "./dom.ts";
import { clockTime, speedFactor } from "./format.ts";
import type { Clock } from "./clock.ts";
import type { PanelState } from "./panel-state.ts";
import { PLAY_RATES } from "./rates.ts";
import { STATE } from "./services.ts";
import { Timeline } from "./timeline.ts";

export interface PlaybackActions {
  togglePlay(): void;
  seek(timeS: number): void;
  setRate(rate: number): void;
  goLive(): void;
}

export class PlaybackBar {
  readonly root: HTMLElement;
  readonly #play: HTMLButtonElement;
  readonly #live: HTMLButtonElement;
  readonly #time = el("span", { class: "time-now", testid: "time-now" });
  readonly #end = el("span", { class: "time-end", testid: "time-end" });
  readonly #rate: HTMLSelectElement;
  readonly #line: Timeline;

  constructor(actions: PlaybackActions) {
    this.#play = iconButton("play", "Play", {
      class: "icon-button primary",
      testid: "play",
      onclick: actions.togglePlay,
    });
    this.#live = textButton("Live", {
      class: "button live-button",
      testid: "go-live",
      title: "Follow the live run (G)",
      onclick: actions.goLive,
    });
    this.#rate = el("select", {
      class: "rate",
      testid: "rate",
      "aria-label": "Playback speed",
    });
    for (const rate of PLAY_RATES) this.#rate.append(el("option", { value: rate }, speedFactor(rate)));
    this.#rate.addEventListener("change", () => actions.setRate(Number(this.#rate.value)));
    this.#line = new Timeline(actions.seek);
    this.root = el(
      "footer",
      { class: "playback-bar", testid: "playback-bar" },
      this.#play,
      el("div", { class: "time" }, this.#time, this.#end),
      this.#line.root,
      this.#rate,
      this.#live,
    );
  }

  update(panel: PanelState, clock: Clock): void {
    const { run, live, timeS } = panel;
    this.#line.update(run, timeS, panel.lineEndS);
    setText(this.#time, clockTime(timeS));
    setText(this.#end, ` / ${clockTime(run.endS)}`);
    const isLive = live !== null && !run.isComplete;
    setHidden(this.#live, !isLive);
    this.#live.classList.toggle("is-on", clock.isFollowing);
    this.#live.setAttribute("aria-pressed", String(clock.isFollowing));
    setHidden(this.#rate, isLive && clock.isFollowing);
    if (this.#rate.value !== String(clock.rate)) this.#rate.value = String(clock.rate);
    if (isLive && clock.isFollowing) {
      const isPlaying = live.simulationState === STATE.playing;
      if (isPlaying) setIcon(this.#play, "pause", "Pause the simulation (Space)");
      else setIcon(this.#play, "play", "Resume the simulation (Space)");
      this.#play.disabled = !live.canControl;
      return;
    }
    this.#play.disabled = false;
    if (clock.isPlaying) setIcon(this.#play, "pause", "Pause (Space)");
    else setIcon(this.#play, "play", "Play (Space)");
  }
}
