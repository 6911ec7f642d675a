/**
 * `window.maes`: the interface for tests and for scripts that capture images.
 *
 * ```js
 * await window.maes.ready;            // a run is open and its first frame has been drawn
 * await window.maes.showAt(120);      // the image is that of 120 s, complete, at full resolution
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

/** State of the page as plain values. */
export interface HandleState {
  readonly timeS: number;
  readonly isPlaying: boolean;
  readonly isFollowing: boolean;
  readonly rate: number;
  readonly selected: number | null;
  /** State of the connection to a simulator; null: there is none. */
  readonly connection: ConnectionState | null;
  /** Texts of the visible banners, by subject. */
  readonly problems: Readonly<Record<string, string>>;
}

/**
 * What two pages that show recordings side by side have in common. The time may be one that is not
 * known yet.
 */
export type Playback = Pick<HandleState, "timeS" | "isPlaying" | "rate">;

/** Event of the window after the user has changed the playback. */
export const PLAYBACK_EVENT = "maes-playback";

export interface Handle {
  /** The open run; null: none. */
  readonly run: Run | null;
  /** Null without WebGL 2. */
  readonly scene: Scene | null;
  /** Resolves when the first frame of a run has been drawn, at the time given in the address. */
  readonly ready: Promise<void>;
  /**
   * Pauses at a time, and resolves when exactly that has been drawn in full. Waits until a
   * recording has been read that far.
   */
  showAt(timeS: number): Promise<void>;
  readonly playback: Playback;
  /** The time at the right end of the timeline of this run alone; 0: there is none. */
  readonly lineEndS: number;
  /** Makes the timeline at least as long. */
  scaleTo(endS: number): void;
  /** Takes over a playback, up to the end of the run, without an event. */
  follow(playback: Playback): void;
  readonly state: HandleState;
}

/** The handle while the page is being loaded, and from then on another name of the page's. */
export function pendingHandle(page: Promise<Handle>): Handle {
  let loaded: Handle | null = null;
  page.then(
    (handle) => (loaded = handle),
    () => undefined,
  );
  const playback: Playback = { timeS: 0, isPlaying: false, rate: 1 };
  const state: HandleState = {
    ...playback,
    isFollowing: false,
    selected: null,
    connection: null,
    problems: {},
  };
  return {
    get run() {
      return loaded?.run ?? null;
    },
    get scene() {
      return loaded?.scene ?? null;
    },
    ready: page.then((handle) => handle.ready),
    showAt: async (timeS) => (await page).showAt(timeS),
    get playback() {
      return loaded?.playback ?? playback;
    },
    get lineEndS() {
      return loaded?.lineEndS ?? 0;
    },
    scaleTo: (endS) => loaded?.scaleTo(endS),
    follow: (followed) => void page.then((handle) => handle.follow(followed)),
    get state() {
      return loaded?.state ?? state;
    },
  };
}

declare global {
  interface Window {
    maes?: Handle;
  }
}
