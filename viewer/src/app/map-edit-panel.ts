/** The part of the simulator's card that makes cells of the map wall or free during a run. */
import { el, fill, setText, textButton } from "./dom.ts";
import type { LiveConnection } from "./live.ts";
import type { MapEdit } from "./map-edit.ts";
import type { SimulatorActions } from "./simulator-card.ts";

const CORNERS = ["From, m", "To, m"] as const;
const AXES = ["x", "y", "z"] as const;

export class MapEditPanel {
  readonly root: HTMLDetailsElement;
  readonly #edit: MapEdit;
  readonly #fields: HTMLInputElement[][];
  readonly #wall: HTMLButtonElement;
  readonly #free: HTMLButtonElement;
  readonly #outcome = el("p", { class: "note", testid: "edit-outcome", "aria-live": "polite" });

  constructor(actions: SimulatorActions) {
    this.#edit = actions.mapEdit;
    this.#fields = CORNERS.map((label, corner) =>
      AXES.map((axis, index) => {
        const title = `${label.replace(", m", "")} ${axis}, m`;
        const field = el("input", {
          type: "number",
          step: "any",
          title,
          "aria-label": title,
          testid: `edit-${corner}-${axis}`,
        });
        field.addEventListener("change", () =>
          this.#edit.setCoordinate(corner as 0 | 1, index, field.valueAsNumber),
        );
        return field;
      }),
    );
    const button = (label: string, testid: string, isWall: boolean) =>
      textButton(label, {
        class: "button",
        testid,
        onclick: () => actions.control((live) => this.#change(live, isWall)),
      });
    this.#wall = button("Make wall", "edit-wall", true);
    this.#free = button("Make free", "edit-free", false);
    this.root = el(
      "details",
      { class: "phases map-edit", testid: "sim-map" },
      el("summary", { title: "Make cells wall or free; the change is part of the run" }, "Change the map"),
      el("p", { class: "note" }, "Click two opposite corners of a box in the image, or type them."),
      ...this.#fields.map((fields, corner) =>
        el("div", { class: "edit-corner" }, el("span", {}, CORNERS[corner]!), ...fields),
      ),
      el("div", { class: "row" }, this.#wall, this.#free),
      this.#outcome,
    );
    this.root.addEventListener("toggle", () => {
      fill(this.#outcome);
      this.#edit.setOn(this.root.open);
    });
  }

  update(live: LiveConnection): void {
    this.root.hidden = !live.canChangeMap;
    if (!live.canChangeMap) this.#edit.setOn(false);
    const { box, corners } = this.#edit;
    const shown = box ? [box.low, box.high] : corners;
    this.#fields.forEach((fields, corner) =>
      fields.forEach((field, axis) => {
        const value = shown[corner]?.[axis];
        if (document.activeElement !== field)
          field.value = value === undefined ? "" : String(Number(value.toFixed(3)));
      }),
    );
    this.#wall.disabled = box === null;
    this.#free.disabled = box === null;
  }

  async #change(live: LiveConnection, isWall: boolean): Promise<void> {
    const { box } = this.#edit;
    if (box === null) return;
    const changed = await live.changeMap(isWall, box);
    const cells = changed === 1 ? "1 cell has" : `${changed} cells have`;
    setText(this.#outcome, `${cells} become ${isWall ? "wall" : "free"}.`);
  }
}
