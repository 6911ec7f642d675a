/** The panel of view options: layers, opacity of near walls, and the cut plane. */
import type { Layers, View } from "../scene/scene.ts";
import { el, iconButton, slider, toggle } from "./dom.ts";
import type { Slider } from "./dom.ts";

type LayerName = keyof Layers;

/** Name, label and tooltip of each layer, in the order of the panel. */
const LAYERS: readonly (readonly [LayerName, string, string])[] = [
  ["walls", "Walls", "The walls of the cave"],
  ["unexplored", "Unexplored", "Free cells not yet seen by any agent"],
  ["covered", "Covered", "Cells that a body has entered"],
  ["heat", "First seen", "Walls coloured by the time they were first seen"],
  ["trails", "Trails", "Past positions of agents"],
  ["paths", "Paths", "Planned paths of agents and their targets"],
  ["contacts", "Contacts", "Lines between agents in radio contact"],
  ["hits", "Scan", "Hits of the selected agent's last scan"],
  ["belief", "Belief", "Belief map of the selected agent"],
  ["labels", "Labels", "Numbers of agents"],
];

/** Layers that need a selected agent. */
const OF_SELECTED: ReadonlySet<LayerName> = new Set(["hits", "belief"]);

export class LayersPanel {
  readonly root: HTMLElement;
  readonly #inputs = new Map<LayerName, HTMLInputElement>();
  readonly #toggles = new Map<LayerName, HTMLElement>();
  readonly #opacity: Slider;
  readonly #cut: Slider;
  readonly #axes: HTMLInputElement[];

  constructor(view: View, changed: () => void, close: () => void) {
    const toggles = LAYERS.map(([name, label, title]) => {
      const { root, input } = toggle(label, `layer-${name}`, view.layers[name], (isOn) => {
        view.layers[name] = isOn;
        changed();
      });
      root.title = title;
      this.#inputs.set(name, input);
      this.#toggles.set(name, root);
      return root;
    });
    const share = (value: number) => `${Math.round(value * 100)} %`;
    this.#opacity = slider(
      "Near walls",
      "wall-opacity",
      { min: 0, max: 1, step: 0.01, value: view.wallOpacity, format: share },
      (value) => {
        view.wallOpacity = value;
        changed();
      },
    );
    this.#cut = slider(
      "Cut",
      "cut-share",
      {
        min: 0,
        max: 1,
        step: 0.01,
        value: view.cut.share,
        format: (value) => (value === 1 ? "off" : share(value)),
      },
      (value) => {
        view.cut.share = value;
        changed();
      },
    );
    this.#axes = (["x", "y", "z"] as const).map((axis) => {
      const input = el("input", { type: "radio", name: "cut-axis", value: axis, testid: `cut-${axis}` });
      input.checked = view.cut.axis === axis;
      input.addEventListener("change", () => {
        view.cut.axis = axis;
        changed();
      });
      return input;
    });
    const axes = this.#axes.map((input) =>
      el("label", { class: "segment" }, input, el("span", {}, input.value)),
    );
    this.root = el(
      "section",
      { class: "layers-panel float", testid: "layers-panel", "aria-label": "Layers" },
      el(
        "div",
        { class: "card-head" },
        el("h2", { class: "card-title" }, "Layers"),
        iconButton("close", "Close (L)", { testid: "layers-close", onclick: close }),
      ),
      el("div", { class: "layer-list" }, ...toggles),
      this.#opacity.root,
      this.#cut.root,
      el("fieldset", { class: "segments" }, el("legend", {}, "Cut along"), ...axes),
    );
  }

  update(view: View, selected: number | null): void {
    for (const [name, input] of this.#inputs) {
      input.checked = view.layers[name];
      this.#toggles.get(name)!.classList.toggle("is-idle", OF_SELECTED.has(name) && selected === null);
    }
    this.#opacity.set(view.wallOpacity);
    this.#cut.set(view.cut.share);
    for (const input of this.#axes) input.checked = input.value === view.cut.axis;
  }
}
