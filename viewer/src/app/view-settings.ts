/**
 * Persistent view settings: layers, playback rate, open parts. They are stored in the browser,
 * except with `?picture=1`: captured images must be the same everywhere.
 */
import { DEFAULT_LAYERS } from "../scene/scene.ts";
import type { View } from "../scene/scene.ts";
import { load, save } from "./storage.ts";

const NAME = "look";

const DEFAULTS = {
  layers: { ...DEFAULT_LAYERS },
  wallOpacity: 0.1,
  cut: { axis: "z", share: 1 },
  rate: 10,
  isPanelOpen: true,
  isLayersOpen: false,
  areStatsOpen: false,
};

/** A stored cut, which may be of another version of the page. */
function cutOf({ axis, share }: { axis: string; share: number }): View["cut"] {
  return axis === "x" || axis === "y" || axis === "z" ? { axis, share } : { axis: "z", share: 1 };
}

export class ViewSettings {
  values: typeof DEFAULTS;
  readonly #isRemembered: boolean;

  constructor(isRemembered: boolean) {
    this.#isRemembered = isRemembered;
    this.values = isRemembered ? load(NAME, DEFAULTS) : DEFAULTS;
  }

  change(change: Partial<typeof DEFAULTS>): void {
    this.values = { ...this.values, ...change };
    if (this.#isRemembered) save(NAME, this.values);
  }

  applyTo(view: View): void {
    Object.assign(view.layers, this.values.layers);
    view.wallOpacity = this.values.wallOpacity;
    view.cut = cutOf(this.values.cut);
  }

  copyFrom(view: View): void {
    this.change({ layers: { ...view.layers }, wallOpacity: view.wallOpacity, cut: { ...view.cut } });
  }
}
