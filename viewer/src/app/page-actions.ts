/** The actions that the parts of the page may request; implemented by `App`. */

import type { LiveConnection } from "./live.ts";
import type { MapEdit } from "./map-edit.ts";

/** A part of the page that can be opened and closed. */
export type PagePart = "isPanelOpen" | "isLayersOpen" | "areStatsOpen";

export interface PageActions {
  /** The box of a change of the map of a live run. */
  readonly mapEdit: MapEdit;
  openFile(file: File): Promise<void>;
  openUrl(url: string): Promise<void>;
  /** Connects to the simulator at an address. */
  connect(address: string): void;
  /** Cancels the opening in progress. */
  cancel(): void;
  /** Starts a run on an idle simulator; resolves to the error in the scenario, or null. */
  startRun(scenario: string, isRecorded: boolean): Promise<string | null>;
  /** Sends a command to the simulator; errors are shown as a banner. */
  control(action: (live: LiveConnection) => Promise<void> | void): void;
  togglePlay(): void;
  seek(timeS: number): void;
  setRate(rate: number): void;
  goLive(): void;
  /** Selects an agent; null selects the whole cave. */
  select(agent: number | null): void;
  /** Selects the next (1) or previous (-1) agent. */
  selectNeighbour(step: 1 | -1): void;
  setUnexplored(isShown: boolean): void;
  /** Redraws after the scene's view options were changed. */
  viewChanged(): void;
  togglePart(part: PagePart): void;
  /** Copies the address of what is shown. */
  copyLink(): Promise<void>;
  /** Saves the image as a file. */
  savePicture(): Promise<void>;
  /** Begins to capture a movie of the image, or ends and saves it. */
  toggleMovie(): Promise<void>;
}
