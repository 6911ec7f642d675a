/**
 * Reads a recording, or a run under way, into batches of what it tells.
 *
 * This is what the worker does, without the worker: bytes go in, and come out as the opening (map and terms of the run), batches, and
 * answers to questions that only the one who has read the bytes can answer. No clock is looked at.
 *
 * Invariants: what is given out does not depend on how the bytes are cut into pieces; nothing behind a damage is given out; what is no
 * recording of this simulator throws an UnreadableError, and nothing else is ever thrown.
 */

import { cast, type Lidar } from "./lidar.ts";
import { Growable, rowsUpTo } from "./growable.ts";
import { Follower, Lore } from "./lore.ts";
import { readMap, type CellMap } from "./maps.ts";
import { chunkContent, McapScanner, messageIn, type McapEnd, type Place } from "./mcap.ts";
import * as messages from "./messages.ts";
import { areToldPosesTrue, lidarOf, openingOf, type Opening } from "./opening.ts";
import { ParcelReader } from "./parcels.ts";
import type { Batch, FoundHits, ScanPose } from "./protocol.ts";
import { Recorder } from "./recorder.ts";
import { TICK_S, UnreadableError } from "./run.ts";
import type { Zstd } from "./zstd.ts";

const SCENARIO_ATTACHMENT = "scenario.toml";
const MAP_ATTACHMENT = /^map\.(m3dm|txt)$/;
const TICK_NS = 20_000_000n;
/** Columns of a row for each cloud of points: tick, and where its record stands. */
const CLOUD = { tick: 0, start: 1, length: 2, channel: 3, columns: 4 } as const;

interface Channel {
  readonly topic: string;
  /** What the topic is about. */
  readonly kind: string;
  /** Whom it belongs to, or -1. */
  readonly agent: number;
}

/** Gives out bytes of the file from a place on, if they can be had again. */
export type FetchBytes = (start: number, length: number) => Promise<Uint8Array>;

export class Reading {
  readonly #title: string;
  readonly #zstd: Zstd;
  readonly #fetchBytes: FetchBytes | null;
  readonly #scanner: McapScanner;
  readonly #channels = new Map<number, Channel>();
  readonly #controllers = new Map<number, string>();
  readonly #clouds = new Map<number, Growable<Float64Array>>();
  #toml: string | null = null;
  #map: CellMap | null = null;
  #opening: Opening | null = null;
  #isOpen = false;
  #recorder: Recorder | null = null;
  #lores: Lore[] = [];
  #parcels: ParcelReader | null = null;
  #follower: Follower | null = null;
  #lidar: Lidar | null = null;
  #refusal: UnreadableError | null = null;
  #lastTick = 0;
  #chunk: { readonly start: number; readonly content: Uint8Array } | null = null;

  /** `title` is what errors call it. */
  constructor(title: string, zstd: Zstd, fetchBytes: FetchBytes | null) {
    this.#title = title;
    this.#zstd = zstd;
    this.#fetchBytes = fetchBytes;
    this.#scanner = new McapScanner(
      {
        attachment: (name, bytes) => this.#attachment(name, bytes),
        channel: (id, topic) => this.#channels.set(id, channelOf(topic)),
        message: (id, timeNs, bytes, place) => this.#message(id, timeNs, bytes, place),
      },
      zstd,
    );
  }

  /** What is set before the run begins, once there is something to look at. */
  get opening(): Opening | null {
    return this.#isOpen ? this.#opening : null;
  }

  /** Whether more bytes are of no use. */
  get isAtEnd(): boolean {
    return this.#scanner.end !== null;
  }

  /** Takes in the next bytes; they are not kept. */
  push(bytes: Uint8Array): void {
    this.#scanner.push(bytes);
    if (this.#refusal) {
      throw this.#refusal;
    }
    if (this.#scanner.end) {
      this.finish();
    }
  }

  /** No more bytes will come. */
  finish(): void {
    const end = this.#scanner.finish();
    if (this.#refusal) {
      throw this.#refusal;
    }
    if (end.kind === "not mcap") {
      throw new UnreadableError(
        `${this.#title} is no recording: expected is an MCAP file, which begins with the bytes 89 4d 43 41 50, found is ${end.found}`,
      );
    }
    const recorder = this.#recorder;
    if (recorder === null) {
      const problem = problemOf(end);
      if (problem) {
        throw new UnreadableError(`${this.#title} cannot be read: it is ${problem}, before its run begins`);
      }
      this.#checkDocuments();
      throw new UnreadableError(
        `${this.#title} is a recording without a run: it has no message on /sim/scenario`,
      );
    }
    this.#isOpen = true;
    recorder.finish(this.#lastTick, this.#inWords(problemOf(end)));
  }

  /** The bytes that are left cannot be had. */
  abort(reason: string): void {
    this.#recorder?.finish(this.#lastTick, this.#inWords(`read in part: ${reason}`));
  }

  #inWords(problem: string | null): string | null {
    const shownS = (this.#lastTick * TICK_S).toFixed(1);
    return problem && `${this.#title} is ${problem}. What could be read is shown, up to ${shownS} s.`;
  }

  /** What has been read since the last batch; null if that is nothing. */
  takeBatch(): Batch | null {
    const learnt = this.#follower && { request: this.#follower.request, cells: this.#follower.news() };
    return this.#recorder?.takeBatch(learnt) ?? null;
  }

  /** Begins to follow what an agent knows: tick in which it learned of each cell. Null ends it. */
  follow(request: number, agent: number | null): Uint32Array | null {
    const lore = agent === null ? undefined : this.#lores[agent];
    if (!lore || !this.#opening || !this.#parcels) {
      this.#follower = null;
      return null;
    }
    this.#follower = new Follower(request, lore, this.#parcels, this.#opening.terrain.walls.length);
    return this.#follower.all();
  }

  /** The hits of an agent's last scan, as the recording has them, else cast from where the scan was. */
  async hits(agent: number, untilTick: number, scan: ScanPose | null): Promise<FoundHits | null> {
    const recorded = await this.#recordedHits(agent, untilTick);
    const [opening, lidar] = [this.#opening, this.#lidar];
    if (recorded || !scan || !opening || !lidar) {
      return recorded;
    }
    const points = cast(lidar, opening.terrain, scan.position, scan.yawRad);
    return { timeS: scan.tick * TICK_S, points, isOfBody: false };
  }

  async #recordedHits(agent: number, untilTick: number): Promise<FoundHits | null> {
    const clouds = this.#clouds.get(agent);
    const count = clouds ? rowsUpTo(clouds.array, clouds.count / CLOUD.columns, CLOUD.columns, untilTick) : 0;
    if (!clouds || count === 0 || !this.#fetchBytes) {
      return null;
    }
    const row = clouds.array.subarray((count - 1) * CLOUD.columns, count * CLOUD.columns);
    const start = row[CLOUD.start]!;
    const timeNs = BigInt(row[CLOUD.tick]!) * TICK_NS;
    try {
      if (this.#chunk?.start !== start) {
        const record = await this.#fetchBytes(start, row[CLOUD.length]!);
        this.#chunk = { start, content: chunkContent(record, this.#zstd) };
      }
      const bytes = messageIn(this.#chunk.content, row[CLOUD.channel]!, timeNs);
      return bytes && { ...messages.cloud(bytes), isOfBody: true };
    } catch {
      // The file has gone, or has changed since it was read; then hits are cast.
      return null;
    }
  }

  #attachment(name: string, bytes: Uint8Array): void {
    if (name === SCENARIO_ATTACHMENT) {
      this.#toml = new TextDecoder().decode(bytes);
    } else if (MAP_ATTACHMENT.test(name) && this.#map === null) {
      try {
        this.#map = readMap(name, bytes);
      } catch (error) {
        this.#refuse(`${this.#title}: its attachment ${name} is no map: ${reasonOf(error)}`);
      }
    }
  }

  #refuse(message: string): never {
    this.#refusal ??= new UnreadableError(message);
    throw this.#refusal;
  }

  /** A recording has its documents before everything that is said. */
  #checkDocuments(): void {
    if (this.#toml === null || this.#map === null) {
      const missing = this.#toml === null ? SCENARIO_ATTACHMENT : "map.m3dm";
      const topics = Array.from(this.#channels.values(), ({ topic }) => topic);
      const found = topics.length === 0 ? "no topics" : `the topics ${topics.slice(0, 5).join(", ")}`;
      this.#refuse(
        `${this.#title} is an MCAP file, but no recording of this simulator: it has ${found}, ` +
          `and no attachment ${missing} before them`,
      );
    }
  }

  #message(id: number, timeNs: bigint, bytes: Uint8Array, place: Place): void {
    this.#checkDocuments();
    const channel = this.#channels.get(id);
    if (!channel || channel.kind === "") {
      return;
    }
    const tick = Number(timeNs / TICK_NS);
    if (tick < this.#lastTick) {
      throw new RangeError(`${channel.topic} of tick ${tick} stands behind tick ${this.#lastTick}`);
    }
    try {
      this.#understand(channel, tick, bytes, id, place);
    } catch (error) {
      if (error instanceof UnreadableError) {
        throw error;
      }
      throw new RangeError(`${channel.topic} of tick ${tick} cannot be read: ${reasonOf(error)}`, {
        cause: error,
      });
    }
    this.#lastTick = tick;
    this.#recorder?.reach(tick);
  }

  #understand(channel: Channel, tick: number, bytes: Uint8Array, id: number, place: Place): void {
    const { kind, agent } = channel;
    if (kind === "scenario") {
      this.#scenario(bytes);
      return;
    }
    const recorder = this.#recorder;
    const opening = this.#opening;
    if (!recorder || !opening || agent >= opening.setup.agents) {
      return;
    }
    if (kind === "join") {
      this.#controllers.set(agent, messages.joinedController(bytes));
    }
    // Agents that are driven by others do not join; then it is the clock that tells that all are there.
    if (!this.#isOpen && (kind !== "join" || this.#controllers.size === opening.setup.agents)) {
      this.#open(opening);
    }
    switch (kind) {
      case "observation": {
        const observation = messages.observation(bytes);
        recorder.observation(agent, observation);
        const told = observation.parcels.filter((parcel) => parcel.kind === messages.MAP_PARCEL);
        const runs = [observation.seenFree, observation.seenWall];
        this.#lores[agent]!.add(
          observation.tick,
          runs,
          told.map((parcel) => parcel.data),
        );
        break;
      }
      case "command":
        recorder.command(agent, messages.command(bytes));
        break;
      case "tf":
        recorder.poses(tick, messages.poses(bytes));
        break;
      case "progress":
        recorder.progress(messages.progress(bytes));
        break;
      case "result":
        recorder.result(bytes);
        break;
      case "intervention":
        recorder.intervention(messages.intervention(bytes));
        break;
      case "points":
        this.#cloudRows(agent).append([tick, place.start, place.length, id]);
        break;
    }
  }

  #cloudRows(agent: number): Growable<Float64Array> {
    const rows = this.#clouds.get(agent) ?? new Growable(new Float64Array(0));
    this.#clouds.set(agent, rows);
    return rows;
  }

  /** All who take part are known. */
  #open(opening: Opening): void {
    const { setup } = opening;
    const controllers = setup.controllers.map((usual, agent) => this.#controllers.get(agent) ?? usual);
    this.#opening = { ...opening, setup: { ...setup, controllers } };
    this.#isOpen = true;
  }

  #scenario(bytes: Uint8Array): void {
    const protocol = messages.protocolOf(bytes);
    if (protocol !== messages.PROTOCOL) {
      this.#refuse(
        `${this.#title} is a recording of version ${protocol} of the protocol; this page reads version ${messages.PROTOCOL}`,
      );
    }
    if (this.#recorder) {
      throw new RangeError("a second scenario");
    }
    const told = messages.scenario(bytes);
    const toml = this.#toml!;
    const opening = openingOf(told, toml, this.#map!);
    const { agents } = opening.setup;
    this.#opening = opening;
    this.#lidar = lidarOf(told, toml);
    this.#lores = Array.from({ length: agents }, () => new Lore());
    this.#parcels = new ParcelReader(opening.terrain.size, agents);
    this.#recorder = new Recorder(opening.terrain, agents, told.durationTicks, areToldPosesTrue(toml));
  }
}

/** What a topic is about, as far as that is of use here. */
function channelOf(topic: string): Channel {
  const ofAgent = /^\/agent_(\d{1,9})\/(join|observation|command|points)$/.exec(topic);
  if (ofAgent) {
    return { topic, kind: ofAgent[2]!, agent: Number(ofAgent[1]) };
  }
  const ofRun = /^(?:\/sim\/(scenario|progress|result|intervention)|\/(tf))$/.exec(topic);
  return { topic, kind: ofRun?.[1] ?? ofRun?.[2] ?? "", agent: -1 };
}

function problemOf(end: McapEnd): string | null {
  switch (end.kind) {
    case "whole":
    case "not mcap":
      return null;
    case "missing":
      return "without an end: its server was killed, or is still at work";
    case "cut off":
      return `cut off behind byte ${end.bytes}`;
    case "damaged":
      return `damaged at byte ${end.byte}: ${end.reason}`;
  }
}

function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
