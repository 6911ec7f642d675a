/**
 * Keyboard shortcuts of the page. Keys that the focused element or a dialog handles are left to it.
 */
import type { CameraMove } from "../scene/camera-rig.ts";
import { panned, turned, zoomed } from "../scene/orbit.ts";
import { ownsKey } from "./dom.ts";

export interface KeyActions {
  togglePlay(): void;
  /** Relative seek, seconds. */
  seekBy(stepS: number): void;
  seekTo(end: "start" | "end"): void;
  changeRate(steps: number): void;
  goLive(): void;
  digit(digit: number): void;
  step(step: 1 | -1): void;
  cave(): void;
  moveCamera(change: CameraMove): void;
  toggleUnexplored(): void;
  toggleLayers(): void;
  togglePanel(): void;
  toggleStats(): void;
  help(): void;
}

const TICK_STEP_S = 0.02;

/** Step of the keys that rotate and pan the view, share of the image height. */
const VIEW_STEP = 0.05;
/** Factor of the distance of the keys that zoom. */
const ZOOM_STEP = 1.2;

/**
 * Where the camera goes. It is as if the image was dragged in the opposite direction: right and
 * down.
 */
const DIRECTIONS: Readonly<Record<string, readonly [number, number]>> = {
  w: [0, VIEW_STEP],
  a: [VIEW_STEP, 0],
  s: [0, -VIEW_STEP],
  d: [-VIEW_STEP, 0],
};

export function listenToKeys(actions: KeyActions): void {
  const zoom = (factor: number) => actions.moveCamera((orbit, limits) => zoomed(orbit, factor, limits));
  const simple: Record<string, () => void> = {
    " ": actions.togglePlay,
    Home: () => actions.seekTo("start"),
    End: () => actions.seekTo("end"),
    ",": () => actions.seekBy(-TICK_STEP_S),
    ".": () => actions.seekBy(TICK_STEP_S),
    "<": () => actions.changeRate(-1),
    ">": () => actions.changeRate(1),
    "-": () => zoom(ZOOM_STEP),
    "+": () => zoom(1 / ZOOM_STEP),
    "=": () => zoom(1 / ZOOM_STEP),
    g: actions.goLive,
    "[": () => actions.step(-1),
    "]": () => actions.step(1),
    Escape: actions.cave,
    u: actions.toggleUnexplored,
    l: actions.toggleLayers,
    p: actions.togglePanel,
    f: actions.toggleStats,
    "?": actions.help,
  };
  window.addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey) return;
    if (ownsKey(event.target, event.key) || document.querySelector("dialog[open]")) return;
    const direction = DIRECTIONS[event.key.toLowerCase()];
    if (direction) {
      const move = event.shiftKey ? panned : turned;
      actions.moveCamera((orbit) => move(orbit, ...direction));
    } else if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      actions.seekBy((event.key === "ArrowLeft" ? -1 : 1) * (event.shiftKey ? 10 : 1));
    } else if (/^[0-9]$/.test(event.key)) {
      actions.digit(Number(event.key));
    } else {
      const action = simple[event.key.length === 1 ? event.key.toLowerCase() : event.key];
      if (!action) return;
      action();
    }
    event.preventDefault();
  });
  // A clicked control gives up the focus, so that the space bar toggles playback instead of
  // pressing the control again.
  window.addEventListener("click", ({ detail, target }) => {
    if (detail === 0 || !(target instanceof HTMLElement) || target.closest("dialog")) return;
    if (document.activeElement?.matches("button, summary, input[type=checkbox]")) {
      (document.activeElement as HTMLElement).blur();
    }
  });
}
