/** The legend at the lower right of the image: what its colours mean, and a length in metres. */
import type { Layers, View } from "../scene/scene.ts";
import { el, setHidden, setText } from "./dom.ts";

/** Layers that need an explanation, with the swatch of `layout.css` and its words. */
const ENTRIES: readonly (readonly [keyof Layers, string, string])[] = [
  ["walls", "seen", "wall, seen"],
  ["walls", "unseen", "wall, not yet seen"],
  ["unexplored", "unexplored", "unexplored cell"],
  ["covered", "covered", "visited cell"],
  ["heat", "heat", "first seen: early to late"],
];

/** Swatch and words of moving obstacles, which have no layer. */
const OBSTACLE = ["obstacle", "moving obstacle"] as const;

/** Longest bar, CSS pixels. */
const BAR_PX = 120;

export class Legend {
  readonly root: HTMLElement;
  readonly #entries: { readonly layer: keyof Layers; readonly kind: string; readonly root: HTMLElement }[];
  readonly #obstacle = entryOf(...OBSTACLE);
  readonly #bar = el("div", { class: "scale-bar" });
  readonly #length = el("span", { testid: "scale" });

  constructor() {
    this.#entries = ENTRIES.map(([layer, kind, words]) => ({
      layer,
      kind,
      root: entryOf(kind, words),
    }));
    this.root = el(
      "div",
      { class: "legend float", testid: "legend", role: "group", "aria-label": "Legend" },
      ...this.#entries.map(({ root }) => root),
      this.#obstacle,
      el(
        "div",
        { class: "legend-scale", title: "Length at the middle of the image" },
        this.#bar,
        this.#length,
      ),
    );
  }

  /**
   * `pixelM`: size of a CSS pixel at the middle of the image, metres. A map without a run
   * (`isMap`) has one colour.
   */
  update(view: View, pixelM: number, isMap: boolean, hasObstacles: boolean): void {
    setHidden(this.#obstacle, !hasObstacles);
    for (const { layer, kind, root } of this.#entries) {
      // The heat map replaces the other colours of walls.
      const isReplaced = view.layers.heat && kind === "seen";
      setHidden(root, isMap || !view.layers[layer] || isReplaced || (layer === "heat" && !view.layers.walls));
    }
    const lengthM = scaleLengthM(pixelM * BAR_PX);
    this.#bar.style.width = `${lengthM / pixelM}px`;
    setText(this.#length, lengthM >= 1 ? `${lengthM} m` : `${Math.round(lengthM * 100)} cm`);
  }
}

function entryOf(kind: string, words: string): HTMLElement {
  return el("div", { class: "legend-entry" }, el("span", { class: `legend-swatch is-${kind}` }), words);
}

/** The greatest of 1, 2 and 5 times a power of ten that is at most `mostM`. */
export function scaleLengthM(mostM: number): number {
  if (!(mostM > 0) || !Number.isFinite(mostM)) return 1;
  const power = 10 ** Math.floor(Math.log10(mostM));
  const step = [5, 2, 1].find((factor) => factor * power <= mostM * (1 + 1e-9)) ?? 1;
  return Number((step * power).toPrecision(1));
}
