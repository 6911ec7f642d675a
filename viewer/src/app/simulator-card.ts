/**
 * The card that controls a simulator: pause, steps, speed, restart, stop, changes of the map, and
 * new runs; and where its wall time goes.
 */
import { FactList } from "./cards.ts";
import { confirmed } from "./dialogs.ts";
import { el, icon, iconButton, setHidden, setIcon, slider, textButton } from "./dom.ts";
import type { Slider } from "./dom.ts";
import { percent, speedFactor } from "./format.ts";
import type { LiveConnection } from "./live.ts";
import { MapEditPanel } from "./map-edit-panel.ts";
import type { MapEdit } from "./map-edit.ts";
import { nearestStep, RUN_RATES } from "./rates.ts";
import { STATE } from "./services.ts";

const STEPS = [1, 10, 50] as const;

export interface SimulatorActions {
  readonly mapEdit: MapEdit;
  /** Sends a command to the simulator; errors are shown as a banner. */
  control(what: (live: LiveConnection) => Promise<void> | void): void;
  newRun(): void;
}

export class SimulatorCard {
  readonly root: HTMLElement;
  readonly #play: HTMLButtonElement;
  readonly #steps: HTMLButtonElement[];
  readonly #restart: HTMLButtonElement;
  readonly #stop: HTMLButtonElement;
  readonly #new: HTMLButtonElement;
  readonly #speed: Slider;
  /** The shares of the wall time by phase of the simulator's loop, folded at first. */
  readonly #profile: HTMLDetailsElement;
  readonly #phases = new FactList();
  readonly #mapEdit: MapEditPanel;
  #isPlaying = false;
  #hasEnded = false;
  /** The real-time factor of the simulator; null: not known. */
  #rtf: number | null = null;

  constructor(actions: SimulatorActions) {
    this.#play = iconButton("pause", "Pause the simulation", {
      class: "icon-button primary",
      testid: "sim-play",
      onclick: () => actions.control((live) => (this.#isPlaying ? live.pause() : live.play())),
    });
    this.#steps = STEPS.map((ticks) => {
      const label = ticks === 1 ? "+1 tick" : `+${ticks} ticks`;
      const button = textButton(`+${ticks}`, {
        title: `${label} of 0.02 s`,
        "aria-label": label,
        testid: `sim-step-${ticks}`,
        onclick: () => actions.control((live) => live.step(ticks)),
      });
      return button;
    });
    this.#restart = iconButton("restart", "Restart the run", {
      class: "icon-button framed",
      testid: "sim-restart",
      onclick: async () => {
        // Of a run that has ended nothing is lost.
        const isLost = !this.#hasEnded;
        if (isLost && !(await confirmed("Restart this run?", "Its progress so far is discarded.", "Restart")))
          return;
        actions.control((live) => live.restart());
      },
    });
    this.#stop = textButton("Stop", {
      class: "button danger",
      testid: "sim-stop",
      title: "End the run",
      onclick: async () => {
        if (
          !(await confirmed(
            "End this run?",
            "It ends now, with a result, and cannot be resumed.",
            "Stop the run",
          ))
        )
          return;
        actions.control((live) => live.stop());
      },
    });
    this.#new = textButton("New run", {
      class: "button primary",
      testid: "sim-new",
      onclick: () => actions.newRun(),
    });
    this.#new.prepend(icon("add"));
    this.#speed = slider(
      "Speed",
      "sim-speed",
      {
        min: 0,
        max: RUN_RATES.length - 1,
        step: 1,
        value: 0,
        format: () => (this.#rtf === null ? "" : speedFactor(this.#rtf)),
      },
      (index) => {
        this.#setSpeed(RUN_RATES[index]!);
        actions.control((live) => live.setRtf(RUN_RATES[index]!));
      },
    );
    this.#profile = el(
      "details",
      { class: "phases", testid: "sim-profile" },
      el("summary", { title: "Shares of the last two seconds of wall time" }, "Where its time goes"),
      this.#phases.root,
    );
    this.#mapEdit = new MapEditPanel(actions);
    this.root = el(
      "section",
      { class: "card", testid: "simulator-card" },
      el("h2", { class: "card-title" }, "Simulator"),
      el(
        "div",
        { class: "row" },
        this.#play,
        el("div", { class: "joined" }, ...this.#steps),
        this.#restart,
        this.#stop,
      ),
      this.#speed.root,
      this.#mapEdit.root,
      this.#profile,
      this.#new,
    );
  }

  update(live: LiveConnection | null): void {
    setHidden(this.root, live === null || live.state === "closed");
    if (!live) return;
    const { canControl, simulationState } = live;
    this.#isPlaying = simulationState === STATE.playing;
    this.#hasEnded = live.hasEnded;
    if (this.#isPlaying) setIcon(this.#play, "pause", "Pause the simulation");
    else setIcon(this.#play, "play", "Resume the simulation");
    this.#play.disabled = !canControl;
    this.#restart.disabled = !canControl && !live.canRestart;
    this.#stop.disabled = !canControl;
    for (const step of this.#steps) step.disabled = !canControl || this.#isPlaying;
    this.#speed.input.disabled = !canControl;
    this.#setSpeed(live.rtf);
    this.#mapEdit.update(live);
    setHidden(this.#profile, !canControl);
    live.loop.setEnabled(canControl && this.#profile.open);
    const { shares } = live.loop;
    setHidden(this.#phases.root, shares.length === 0);
    for (const { name, share } of shares) this.#phases.set(name, percent(share));
    setHidden(this.#new, !live.isIdleServer);
    this.#new.disabled = !live.canStart;
    this.#new.title = live.canStart ? "" : "The current run has to end first";
  }

  /** Shows the factor itself, which may lie between two steps. */
  #setSpeed(rtf: number | null): void {
    if (rtf === this.#rtf) return;
    this.#rtf = rtf;
    this.#speed.set(rtf === null ? 0 : nearestStep(RUN_RATES, rtf));
  }
}
