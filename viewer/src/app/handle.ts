/**
 * `window.maes`: what tests and scripts that make pictures may ask of the page.
 *
 * ```js
 * await window.maes.ready;            // a run is there and its first picture has been drawn
 * await window.maes.showAt(120);      // the picture is that of 120 s, complete, with all pixels
 * window.maes.scene.view.layers.heat = true;
 * window.maes.scene.viewChanged();
 * await window.maes.showAt(120);
 * ```
 *
 * With `?picture=1` in the address there are no panels, only a caption.
 */
import type { Run } from "../data/run.ts";
import type { Scene } from "../scene/scene.ts";
import type { ConnectionState } from "./live.ts";

/** What the page does, as plain values. */
export interface HandleState {
  readonly timeS: number;
  readonly isPlaying: boolean;
  readonly isFollowing: boolean;
  readonly rate: number;
  readonly selected: number | null;
  /** Of the connection with a simulator; null: there is none. */
  readonly connection: ConnectionState | null;
  /** Texts of the banners shown, by subject. */
  readonly problems: Readonly<Record<string, string>>;
}

export interface Handle {
  /** The run that is shown; null: none. */
  readonly run: Run | null;
  /** Null where there is no WebGL 2. */
  readonly scene: Scene | null;
  /** Resolves when the first picture of a run has been drawn, at the time that the address asks for. */
  readonly ready: Promise<void>;
  /** Holds the picture at a time, and resolves when exactly that has been drawn, with all it needs. Waits until so much of a
   *  recording has been read. */
  showAt(timeS: number): Promise<void>;
  readonly state: HandleState;
}

declare global {
  interface Window {
    maes?: Handle;
  }
}
