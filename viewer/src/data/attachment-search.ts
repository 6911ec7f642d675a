/**
 * The scenario and the map of a recording that another program has written again, found in a pass
 * over the whole file.
 *
 * Such a file may have its attachments behind the messages, or may have lost them. The observations
 * still have what the team has seen of a lost map; all other cells are taken for wall.
 */

import type { Runs } from "./cdr.ts";
import type { CellMap } from "./cell-map.ts";
import { CellSet } from "./cell-set.ts";
import { readMap } from "./maps.ts";
import { McapScanner } from "./mcap.ts";
import * as messages from "./messages.ts";
import type { Zstd } from "./zstd.ts";

export const SCENARIO_ATTACHMENT = "scenario.toml";
export const MAP_ATTACHMENT = /^map\.(m3dm|txt)$/;

/** Largest number of cells of a map that is put together. */
const CELLS_MAX = 2 ** 30;

/** What a recording needs besides its messages. */
export interface Attachments {
  readonly toml: string;
  readonly map: CellMap;
  /** What the page says about them; null if nothing is lost. */
  readonly note: string | null;
}

export class AttachmentSearch {
  readonly #scanner: McapScanner;
  readonly #observationChannels = new Set<number>();
  #scenarioChannel = -1;
  #toml: string | null = null;
  #map: CellMap | null = null;
  /** What the team has seen. */
  #seen: CellMap | null = null;

  constructor(zstd: Zstd) {
    this.#scanner = new McapScanner(
      {
        attachment: (name, bytes) => this.#attachment(name, bytes),
        channel: (id, topic) => this.#channel(id, topic),
        message: (id, _, bytes) => this.#message(id, bytes),
      },
      zstd,
    );
  }

  /** Whether further bytes are ignored. */
  get isAtEnd(): boolean {
    return this.#scanner.end !== null;
  }

  /** Reads the next bytes; they are not kept. */
  push(bytes: Uint8Array): void {
    this.#scanner.push(bytes);
  }

  /** What was found; null if it is not enough to show a run. */
  get found(): Attachments | null {
    const map = this.#map ?? this.#seen;
    if (map === null) {
      return null;
    }
    const lost = [this.#toml === null ? "scenario" : "", this.#map === null ? "map" : ""].filter(Boolean);
    const drawn = this.#map === null ? " What the team has not seen is drawn as rock." : "";
    const note =
      lost.length === 0
        ? null
        : `another program has written this recording again without its ${lost.join(" and its ")}.${drawn}`;
    return { toml: this.#toml ?? "", map, note };
  }

  #attachment(name: string, bytes: Uint8Array): void {
    if (name === SCENARIO_ATTACHMENT) {
      this.#toml = new TextDecoder().decode(bytes);
    } else if (MAP_ATTACHMENT.test(name)) {
      this.#map ??= readMap(name, bytes);
    }
  }

  #channel(id: number, topic: string): void {
    if (topic === "/sim/scenario") {
      this.#scenarioChannel = id;
    } else if (/^\/agent_\d+\/observation$/.test(topic)) {
      this.#observationChannels.add(id);
    }
  }

  #message(id: number, bytes: Uint8Array): void {
    if (id === this.#scenarioChannel && messages.protocolOf(bytes) === messages.PROTOCOL) {
      const { size } = messages.scenario(bytes);
      const cells = size[0] * size[1] * size[2];
      if (cells <= CELLS_MAX) {
        const walls = new CellSet(cells);
        walls.bytes.fill(0xff);
        for (let beyond = cells; beyond < walls.bytes.length * 8; beyond++) walls.delete(beyond);
        this.#seen ??= { size, cellM: null, walls };
      }
    } else if (this.#seen && this.#observationChannels.has(id)) {
      this.#free(this.#seen.walls, messages.observation(bytes).seenFree);
    }
  }

  #free(walls: CellSet, runs: Runs): void {
    for (let run = 0; run < runs.start.length; run++) {
      const end = Math.min(runs.start[run]! + runs.length[run]!, walls.length);
      for (let cell = runs.start[run]!; cell < end; cell++) walls.delete(cell);
    }
  }
}
