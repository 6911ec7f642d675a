/**
 * Reads a recording, or the stream of a live run, into batches.
 *
 * This is the worker's logic without the worker: bytes go in; the header of the run, batches, and
 * answers to queries that need the bytes again come out. It reads no clock.
 *
 * Invariants: the output does not depend on how the bytes are split; nothing behind a damaged
 * record is used; input that is not a recording of this simulator throws an UnreadableError, and
 * nothing else is ever thrown.
 */

import { MAP_ATTACHMENT, SCENARIO_ATTACHMENT, type Attachments } from "./attachment-search.ts";
import { cast, type Lidar } from "./lidar.ts";
import { Growable, rowsUpTo } from "./growable.ts";
import { BeliefTracker, BeliefLog } from "./belief-log.ts";
import type { CellMap } from "./cell-map.ts";
import { readMap } from "./maps.ts";
import { chunkContent, McapScanner, messageIn, type McapEnd, type RecordLocation } from "./mcap.ts";
import * as messages from "./messages.ts";
import { areObservedPosesTrue, lidarOf, runHeaderOf, type RunHeader } from "./run-header.ts";
import { MapMessageReader } from "./map-message.ts";
import type { Batch, ScanHits, ScanPose } from "./protocol.ts";
import { recordedScenario } from "./recorded-scenario.ts";
import { BatchBuilder } from "./batch-builder.ts";
import { TICK_S, UnreadableError } from "./run.ts";
import type { Zstd } from "./zstd.ts";

const TICK_NS = 20_000_000n;
/** Columns of a row for each point cloud: tick, and the location of its record. */
const CLOUD = { tick: 0, start: 1, length: 2, channel: 3, columns: 4 } as const;

interface Channel {
  readonly topic: string;
  /** The last part of the topic name; empty if the topic is not used. */
  readonly kind: string;
  /** Id of the agent, or -1. */
  readonly agent: number;
}

/** Reads a byte range of the file again, if the source allows it. */
export type FetchBytes = (start: number, length: number) => Promise<Uint8Array>;

/** A file without the attachments of a recording before its first message. */
export class MissingAttachmentError extends UnreadableError {}

export class RecordingReader {
  readonly #title: string;
  readonly #zstd: Zstd;
  readonly #fetchBytes: FetchBytes | null;
  readonly #scanner: McapScanner;
  readonly #channels = new Map<number, Channel>();
  readonly #controllers = new Map<number, string>();
  readonly #pointClouds = new Map<number, Growable<Float64Array>>();
  #toml: string | null = null;
  #map: CellMap | null = null;
  #header: RunHeader | null = null;
  #isOpen = false;
  #builder: BatchBuilder | null = null;
  #beliefLogs: BeliefLog[] = [];
  #mapMessages: MapMessageReader | null = null;
  #beliefTracker: BeliefTracker | null = null;
  #lidar: Lidar | null = null;
  /** What to say about attachments that are lost. */
  #note: string | null = null;
  #rejection: UnreadableError | null = null;
  #lastTick = 0;
  #chunk: { readonly start: number; readonly content: Uint8Array } | null = null;

  /** `title` names the recording in error messages; `found` is what it lacks. */
  constructor(title: string, zstd: Zstd, fetchBytes: FetchBytes | null, found: Attachments | null = null) {
    this.#title = title;
    this.#zstd = zstd;
    this.#fetchBytes = fetchBytes;
    this.#toml = found?.toml ?? null;
    this.#map = found?.map ?? null;
    this.#note = found?.note ?? null;
    this.#scanner = new McapScanner(
      {
        attachment: (name, bytes) => this.#attachment(name, bytes),
        channel: (id, topic) => this.#channels.set(id, channelOf(topic)),
        message: (id, timeNs, bytes, location) => this.#message(id, timeNs, bytes, location),
      },
      zstd,
    );
  }

  /** The header of the run, once it is complete. */
  get header(): RunHeader | null {
    return this.#isOpen ? this.#header : null;
  }

  /** Whether the first moment of the run is known: its header and all that its tick 0 has. */
  get hasStart(): boolean {
    return this.#isOpen && this.#lastTick > 0;
  }

  /** Whether further bytes are ignored. */
  get isAtEnd(): boolean {
    return this.#scanner.end !== null;
  }

  /** Reads the next bytes; they are not kept. */
  push(bytes: Uint8Array): void {
    this.#scanner.push(bytes);
    if (this.#rejection) {
      throw this.#rejection;
    }
    if (this.#scanner.end) {
      this.finish();
    }
  }

  /** Ends the input. */
  finish(): void {
    const end = this.#scanner.finish();
    if (this.#rejection) {
      throw this.#rejection;
    }
    if (end.kind === "not mcap") {
      throw new UnreadableError(
        `${this.#title} is not a recording: expected an MCAP file, which begins with the bytes 89 4d 43 41 50; ` +
          `found ${end.found}`,
      );
    }
    const builder = this.#builder;
    if (builder === null) {
      const problem = problemOf(end);
      if (problem) {
        throw new UnreadableError(
          `${this.#title} cannot be read: it is ${problem}, before the start of its run`,
        );
      }
      this.#checkAttachments();
      throw new UnreadableError(
        `${this.#title} is a recording without a run: it has no message on /sim/scenario`,
      );
    }
    this.#isOpen = true;
    builder.finish(this.#lastTick, this.#problemText(problemOf(end)));
  }

  /** Ends the input because the remaining bytes are unavailable. */
  abort(reason: string): void {
    this.#builder?.finish(this.#lastTick, this.#problemText(`incomplete: ${reason}`));
  }

  #problemText(problem: string | null): string | null {
    const shownS = (this.#lastTick * TICK_S).toFixed(1);
    const damage = problem && `${this.#title} is ${problem}. It is shown up to ${shownS} s.`;
    const note = this.#note && `${this.#title}: ${this.#note}`;
    return [note, damage].filter(Boolean).join(" ") || null;
  }

  /** What has been read since the previous batch; null if that is nothing. */
  takeBatch(): Batch | null {
    const learned = this.#beliefTracker && {
      request: this.#beliefTracker.request,
      cells: this.#beliefTracker.takeNew(),
    };
    return this.#builder?.takeBatch(learned) ?? null;
  }

  /**
   * Begins to follow an agent's belief and returns tick and cell of all that it has learned. Null
   * ends following.
   */
  follow(request: number, agent: number | null): Uint32Array | null {
    const log = agent === null ? undefined : this.#beliefLogs[agent];
    if (!log || !this.#header || !this.#mapMessages) {
      this.#beliefTracker = null;
      return null;
    }
    this.#beliefTracker = new BeliefTracker(
      request,
      log,
      this.#mapMessages,
      this.#header.terrain.walls.length,
    );
    return this.#beliefTracker.takeNew();
  }

  /**
   * The hits of an agent's last scan: the recorded points, else ray-cast from the pose of the scan,
   * unless the rays are rows and columns.
   */
  async hits(agent: number, untilTick: number, scan: ScanPose | null): Promise<ScanHits | null> {
    const recorded = await this.#recordedHits(agent, untilTick);
    const [header, lidar] = [this.#header, this.#lidar];
    if (recorded || !scan || !header || !lidar) {
      return recorded;
    }
    const points = cast(lidar, header.terrain, scan.position, scan.yawRad);
    return { timeS: scan.tick * TICK_S, points, isInBodyFrame: false };
  }

  async #recordedHits(agent: number, untilTick: number): Promise<ScanHits | null> {
    const pointClouds = this.#pointClouds.get(agent);
    const count = pointClouds
      ? rowsUpTo(pointClouds.array, pointClouds.count / CLOUD.columns, CLOUD.columns, untilTick)
      : 0;
    if (!pointClouds || count === 0 || !this.#fetchBytes) {
      return null;
    }
    const rowAt = (number: number) =>
      pointClouds.array.subarray(number * CLOUD.columns, (number + 1) * CLOUD.columns);
    const tick = rowAt(count - 1)[CLOUD.tick]!;
    // A message of each LiDAR of the agent that has scanned in this tick.
    const rows = new Map<number, Float64Array>();
    for (let number = count - 1; number >= 0 && rowAt(number)[CLOUD.tick] === tick; number--) {
      const channel = rowAt(number)[CLOUD.channel]!;
      if (!rows.has(channel)) rows.set(channel, rowAt(number).slice());
    }
    try {
      const clouds = [];
      for (const row of rows.values()) {
        const bytes = await this.#pointCloudAt(row);
        if (bytes) clouds.push(messages.pointCloud(bytes));
      }
      const [first] = clouds;
      return first
        ? { timeS: first.timeS, points: joined(clouds.map(({ points }) => points)), isInBodyFrame: true }
        : null;
    } catch {
      // The file is gone or was changed since; hits are ray-cast instead.
      return null;
    }
  }

  /** The message at a row of the recorded point clouds. */
  async #pointCloudAt(row: Float64Array): Promise<Uint8Array | null> {
    const start = row[CLOUD.start]!;
    if (this.#chunk?.start !== start) {
      const record = await this.#fetchBytes!(start, row[CLOUD.length]!);
      this.#chunk = { start, content: chunkContent(record, this.#zstd) };
    }
    return messageIn(this.#chunk.content, row[CLOUD.channel]!, BigInt(row[CLOUD.tick]!) * TICK_NS);
  }

  #attachment(name: string, bytes: Uint8Array): void {
    if (name === SCENARIO_ATTACHMENT) {
      this.#toml = new TextDecoder().decode(bytes);
    } else if (MAP_ATTACHMENT.test(name) && this.#map === null) {
      try {
        this.#map = readMap(name, bytes);
      } catch (error) {
        this.#reject(`${this.#title}: its attachment ${name} cannot be read: ${reasonOf(error)}`);
      }
    }
  }

  #reject(message: string): never {
    this.#rejectWith(new UnreadableError(message));
  }

  #rejectWith(rejection: UnreadableError): never {
    this.#rejection ??= rejection;
    throw this.#rejection;
  }

  /** A recording has its attachments before its first message. */
  #checkAttachments(): void {
    if (this.#toml === null || this.#map === null) {
      const missing = this.#toml === null ? SCENARIO_ATTACHMENT : "map.m3dm";
      const topics = Array.from(this.#channels.values(), ({ topic }) => topic);
      const found = topics.length === 0 ? "no topics" : `the topics ${topics.slice(0, 5).join(", ")}`;
      this.#rejectWith(
        new MissingAttachmentError(
          `${this.#title} is an MCAP file, but not a recording of this simulator: it has ${found}, ` +
            `but no attachment ${missing} before them`,
        ),
      );
    }
  }

  #message(id: number, timeNs: bigint, bytes: Uint8Array, location: RecordLocation): void {
    this.#checkAttachments();
    const channel = this.#channels.get(id);
    if (!channel || channel.kind === "") {
      return;
    }
    const tick = Number(timeNs / TICK_NS);
    if (tick < this.#lastTick) {
      throw new RangeError(`${channel.topic} of tick ${tick} follows tick ${this.#lastTick}`);
    }
    try {
      this.#dispatch(channel, tick, bytes, id, location);
    } catch (error) {
      if (error instanceof UnreadableError) {
        throw error;
      }
      throw new RangeError(`${channel.topic} of tick ${tick} cannot be read: ${reasonOf(error)}`, {
        cause: error,
      });
    }
    this.#lastTick = tick;
    this.#builder?.reach(tick);
  }

  #dispatch(channel: Channel, tick: number, bytes: Uint8Array, id: number, location: RecordLocation): void {
    const { kind, agent } = channel;
    if (kind === "scenario") {
      this.#scenario(bytes);
      return;
    }
    const builder = this.#builder;
    const header = this.#header;
    if (!builder || !header || agent >= header.setup.agents) {
      return;
    }
    if (kind === "join") {
      this.#controllers.set(agent, messages.controllerOfJoin(bytes));
    }
    // Externally controlled agents do not join; then the first other message shows that the run has
    // begun.
    if (!this.#isOpen && (kind !== "join" || this.#controllers.size === header.setup.agents)) {
      this.#open(header);
    }
    switch (kind) {
      case "observation": {
        const observation = messages.observation(bytes);
        builder.observation(agent, observation);
        const maps = observation.received.filter(({ kind }) => kind === messages.MAP_MESSAGE_KIND);
        const runs = [observation.seenFree, observation.seenWall];
        this.#beliefLogs[agent]!.add(
          observation.tick,
          runs,
          maps.map(({ data }) => data),
        );
        break;
      }
      case "command":
        builder.command(agent, messages.command(bytes));
        break;
      case "tf": {
        const { agents, obstacles } = messages.poses(bytes, tick);
        builder.poses(tick, agents);
        builder.obstacles(tick, obstacles);
        break;
      }
      case "progress":
        builder.progress(messages.progress(bytes));
        break;
      case "result":
        builder.result(bytes);
        break;
      case "intervention":
        builder.intervention(messages.intervention(bytes));
        break;
      case "map_change":
        builder.mapChange(messages.mapChange(bytes));
        break;
      case "points":
        this.#pointCloudRows(agent).append([tick, location.start, location.length, id]);
        break;
    }
  }

  #pointCloudRows(agent: number): Growable<Float64Array> {
    const rows = this.#pointClouds.get(agent) ?? new Growable(new Float64Array(0));
    this.#pointClouds.set(agent, rows);
    return rows;
  }

  /** Completes the header with the controllers of the agents that joined. */
  #open(header: RunHeader): void {
    const { setup } = header;
    const controllers = setup.controllers.map((fallback, agent) => this.#controllers.get(agent) ?? fallback);
    this.#header = { ...header, setup: { ...setup, controllers } };
    this.#isOpen = true;
  }

  #scenario(bytes: Uint8Array): void {
    const protocol = messages.protocolOf(bytes);
    if (protocol !== messages.PROTOCOL) {
      this.#reject(
        `${this.#title} is a recording of protocol version ${protocol}; this page reads version ` +
          `${messages.PROTOCOL}`,
      );
    }
    if (this.#builder) {
      throw new RangeError("a second scenario");
    }
    const scenario = messages.scenario(bytes);
    const toml = this.#toml!;
    const recorded = recordedScenario(toml);
    const header = runHeaderOf(scenario, recorded, toml, this.#map!);
    const { agents } = header.setup;
    this.#header = header;
    this.#lidar = lidarOf(scenario, recorded);
    this.#beliefLogs = Array.from({ length: agents }, (_, agent) => new BeliefLog(agent));
    this.#mapMessages = new MapMessageReader(header.terrain.size, agents);
    this.#builder = new BatchBuilder(
      header.terrain,
      header.setup,
      scenario.durationTicks,
      areObservedPosesTrue(recorded),
    );
  }
}

/** Parses a topic name. */
function channelOf(topic: string): Channel {
  // LiDARs with a name have a part of their own in the topic.
  const ofAgent = /^\/agent_(\d{1,9})\/(?:(join|observation|command)|(?:[a-z0-9_]+\/)?(points))$/.exec(topic);
  if (ofAgent) {
    return { topic, kind: (ofAgent[2] ?? ofAgent[3])!, agent: Number(ofAgent[1]) };
  }
  const ofRun = /^(?:\/sim\/(scenario|progress|result|intervention|map_change)|\/(tf))$/.exec(topic);
  return { topic, kind: ofRun?.[1] ?? ofRun?.[2] ?? "", agent: -1 };
}

function joined(parts: readonly Float32Array[]): Float32Array {
  const whole = new Float32Array(parts.reduce((length, part) => length + part.length, 0));
  let at = 0;
  for (const part of parts) {
    whole.set(part, at);
    at += part.length;
  }
  return whole;
}

function problemOf(end: McapEnd): string | null {
  switch (end.kind) {
    case "whole":
    case "not mcap":
      return null;
    case "missing":
      return "incomplete: its server was killed, or is still recording";
    case "cut off":
      return `cut off after byte ${end.bytes}`;
    case "damaged":
      return `damaged at byte ${end.byte}: ${end.reason}`;
    case "unsupported":
      return `not read by this page from byte ${end.byte} on: ${end.reason}`;
  }
}

function reasonOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}
