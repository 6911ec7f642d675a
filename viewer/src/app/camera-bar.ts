/**
 * The toolbar at the lower left of the image: the agent that the camera follows, or the whole cave,
 * and the visibility of unexplored cells.
 */
import { agentColour } from "../scene/colours.ts";
import { el, fill, icon, iconButton, toggle } from "./dom.ts";

export interface CameraActions {
  /** Selects the previous (-1) or next (1) agent; the whole cave is one of the positions. */
  step(step: 1 | -1): void;
  cave(): void;
  setUnexplored(isShown: boolean): void;
}

export class CameraBar {
  readonly root: HTMLElement;
  readonly #cave: HTMLButtonElement;
  readonly #unexplored: HTMLInputElement;
  #shown: number | null | undefined = undefined;

  constructor(actions: CameraActions, isUnexploredShown: boolean) {
    this.#cave = el("button", {
      type: "button",
      class: "button camera-cave",
      title: "The whole cave (Escape)",
      testid: "camera-cave",
      onclick: actions.cave,
    });
    const unexplored = toggle("Show unexplored", "show-unexplored", isUnexploredShown, actions.setUnexplored);
    this.#unexplored = unexplored.input;
    this.#unexplored.title = "Show unexplored (U)";
    this.root = el(
      "div",
      { class: "camera-bar float", testid: "camera-bar", role: "toolbar", "aria-label": "Camera" },
      iconButton("previous", "Previous agent ([)", {
        testid: "camera-prev",
        onclick: () => actions.step(-1),
      }),
      this.#cave,
      iconButton("next", "Next agent (])", { testid: "camera-next", onclick: () => actions.step(1) }),
      unexplored.root,
    );
  }

  update(selected: number | null, isUnexploredShown: boolean): void {
    this.#unexplored.checked = isUnexploredShown;
    if (selected === this.#shown) return;
    this.#shown = selected;
    this.#cave.classList.toggle("is-on", selected === null);
    if (selected === null) fill(this.#cave, "Cave");
    else {
      fill(
        this.#cave,
        el("span", { class: "swatch", style: `--agent: ${agentColour(selected)}` }),
        `Agent ${selected}`,
        icon("close"),
      );
    }
  }
}
