/**
 * Builds small recordings for tests, message by message.
 *
 * Messages are written with `@foxglove/cdr` and files with `@mcap/core`, so that the readers are
 * tested against independent writers.
 */

import { CdrWriter } from "@foxglove/cdr";
import { McapStreamReader, McapWriter, TempBuffer } from "@mcap/core";
import type { Vec3 } from "./run.ts";
import type { Zstd } from "./zstd.ts";

const TICK_NS = 20_000_000n;

/** A room of 6 x 4 x 2 free cells in a map of 8 x 6 x 4, as plain M3DM. */
export const ROOM: Vec3 = [8, 6, 4];

export interface RecordedMessage {
  readonly topic: string;
  readonly tick: number;
  readonly bytes: Uint8Array;
}

export interface RecordingOptions {
  /** Chunks have a CRC; the stream of a live run has no chunks. */
  readonly hasChunks?: boolean;
  /** By name; by default the scenario and the map of the room. */
  readonly attachments?: Readonly<Record<string, Uint8Array>>;
  /** Whether they come behind the messages, as some programs write them. */
  readonly areAttachmentsLast?: boolean;
}

export const SCENARIO_TOML = `duration_s = 20.0\n\n[lidar]\npattern = "lattice"\n\n[recording]\nposes_period_ticks = 10\n`;

/** A recording of messages. */
export async function recordingOf(
  messages: readonly RecordedMessage[],
  form: RecordingOptions = {},
): Promise<Uint8Array> {
  const file = new TempBuffer();
  const writer = new McapWriter({ writable: file, useChunks: form.hasChunks ?? true });
  await writer.start({ profile: "ros2", library: "" });
  const attachments = form.attachments ?? {
    "scenario.toml": new TextEncoder().encode(SCENARIO_TOML),
    "map.m3dm": roomMap(),
  };
  const attach = async () => {
    for (const [name, data] of Object.entries(attachments)) {
      await writer.addAttachment({ name, logTime: 0n, createTime: 0n, mediaType: "", data });
    }
  };
  if (form.areAttachmentsLast !== true) await attach();
  const channels = new Map<string, number>();
  for (const [sequence, { topic, tick, bytes }] of messages.entries()) {
    let channelId = channels.get(topic);
    if (channelId === undefined) {
      channelId = await writer.registerChannel({
        topic,
        schemaId: 0,
        messageEncoding: "cdr",
        metadata: new Map(),
      });
      channels.set(topic, channelId);
    }
    const logTime = BigInt(tick) * TICK_NS;
    await writer.addMessage({ channelId, sequence, logTime, publishTime: logTime, data: bytes });
  }
  if (form.areAttachmentsLast === true) await attach();
  await writer.end();
  return file.get();
}

/** The same recording as the stream of a live run: without chunks. */
export async function asStream(recording: Uint8Array, zstd: Zstd): Promise<Uint8Array> {
  return rewritten(recording, zstd, { hasChunks: false });
}

/** The same recording as another program writes it again; by default with the same attachments. */
export async function rewritten(
  recording: Uint8Array,
  zstd: Zstd,
  form: RecordingOptions,
): Promise<Uint8Array> {
  const reader = new McapStreamReader({
    decompressHandlers: { zstd: (bytes, length) => zstd(bytes, Number(length)) },
  });
  reader.append(recording);
  const messages: RecordedMessage[] = [];
  const attachments: Record<string, Uint8Array> = {};
  const topics = new Map<number, string>();
  for (let record = reader.nextRecord(); record !== undefined; record = reader.nextRecord()) {
    if (record.type === "Attachment") {
      attachments[record.name] = record.data.slice();
    } else if (record.type === "Channel") {
      topics.set(record.id, record.topic);
    } else if (record.type === "Message") {
      const tick = Number(record.logTime / TICK_NS);
      messages.push({ topic: topics.get(record.channelId)!, tick, bytes: record.data.slice() });
    }
  }
  return recordingOf(messages, { attachments, ...form });
}

export function roomMap(): Uint8Array {
  const [sizeX, sizeY, sizeZ] = ROOM;
  const bytes = new Uint8Array(3 + (sizeX * sizeY * sizeZ) / 8);
  bytes.set([(sizeX << 1) | (sizeZ >> 6), ((sizeZ & 63) << 2) | (sizeY >> 5), (sizeY & 31) << 3]);
  let bit = 24;
  for (let x = 0; x < sizeX; x++) {
    for (let z = 0; z < sizeZ; z++) {
      for (let y = 0; y < sizeY; y++, bit++) {
        const isInside = x > 0 && x < sizeX - 1 && y > 0 && y < sizeY - 1 && z > 0 && z < sizeZ - 1;
        bytes[bit >> 3]! |= isInside ? 0 : 0x80 >> (bit & 7);
      }
    }
  }
  return bytes;
}

export function roomCell(x: number, y: number, z: number): number {
  return (z * ROOM[1] + y) * ROOM[0] + x;
}

function header(writer: CdrWriter, tick: number): CdrWriter {
  return writer
    .int32(Math.floor(tick / 50))
    .uint32((tick % 50) * 20_000_000)
    .string("map");
}

function vector(writer: CdrWriter, [x, y, z]: Vec3): CdrWriter {
  return writer.float64(x).float64(y).float64(z);
}

function messages(
  writer: CdrWriter,
  list: readonly { readonly kind: number; readonly data: Uint8Array }[],
): void {
  writer.sequenceLength(list.length);
  for (const { kind, data } of list) {
    writer.uint32(0).uint8(kind).uint8Array(data, true);
  }
}

function runs(writer: CdrWriter, list: readonly (readonly [start: number, length: number])[]): void {
  writer.uint32Array(
    list.map(([start]) => start),
    true,
  );
  writer.uint16Array(
    list.map(([, length]) => length),
    true,
  );
}

export function scenario(agents: number, protocol = 3): RecordedMessage {
  const writer = new CdrWriter();
  writer.uint32(protocol).uint64(0n).uint64(0n).uint64(20_000_000n).uint64(1000n);
  ROOM.forEach((cells) => writer.uint32(cells));
  writer.float64(1).uint32(agents).uint64(7n).string("usual");
  writer.sequenceLength(1).string("key=value");
  writer.sequenceLength(1).uint8(0).float64(0.4);
  for (let number = 0; number < 6; number++) {
    writer.float64(1);
  }
  writer.uint8Array(new Uint8Array(agents), true);
  writer
    .uint32(100)
    .float64(Infinity)
    .float64(2 * Math.PI)
    .uint32(10)
    .float64(25);
  return { topic: "/sim/scenario", tick: 0, bytes: writer.data };
}

export function join(agent: number, controller: string): RecordedMessage {
  const writer = new CdrWriter().uint64(0n).uint32(agent).uint64(0n).uint32(3).string(controller).uint64(0n);
  return { topic: `/agent_${agent}/join`, tick: 0, bytes: writer.data };
}

export interface ObservationOf {
  readonly part?: number;
  readonly parts?: number;
  readonly position?: Vec3;
  readonly yawRad?: number;
  readonly isActive?: boolean;
  readonly collision?: number;
  readonly contacts?: readonly number[];
  readonly messages?: readonly { readonly kind: number; readonly data: Uint8Array }[];
  readonly scanTick?: bigint;
  readonly free?: readonly (readonly [number, number])[];
  readonly wall?: readonly (readonly [number, number])[];
}

export function observation(agent: number, tick: number, of: ObservationOf = {}): RecordedMessage {
  const writer = header(new CdrWriter(), tick);
  writer.uint64(BigInt(tick)).uint64(0n).uint32(agent);
  writer
    .uint16(of.part ?? 0)
    .uint16(of.parts ?? 1)
    .uint8(0);
  vector(writer, of.position ?? [1.5, 1.5, 1.5]).float64(of.yawRad ?? 0);
  vector(writer, [0, 0, 0]).float64(0);
  writer
    .uint8(of.isActive ? 1 : 0)
    .uint8(of.collision ?? 0)
    .uint8(0)
    .uint8(0);
  writer.sequenceLength(of.contacts?.length ?? 0);
  of.contacts?.forEach((other) => vector(writer.uint32(other), [0, 0, 0]));
  messages(writer, of.messages ?? []);
  writer.uint64(of.scanTick ?? 0xffffffffffffffffn);
  runs(writer, of.free ?? []);
  runs(writer, of.wall ?? []);
  writer.uint8(0);
  runs(writer, []);
  runs(writer, []);
  return { topic: `/agent_${agent}/observation`, tick, bytes: writer.data };
}

export interface CommandOf {
  readonly kind?: number;
  readonly pitchRad?: number;
  readonly distanceM?: number;
  readonly path?: readonly Vec3[];
  readonly messages?: readonly { readonly kind: number; readonly data: Uint8Array }[];
  readonly info?: string;
}

export function command(agent: number, tick: number, of: CommandOf = {}): RecordedMessage {
  const writer = new CdrWriter().uint64(BigInt(tick)).uint64(0n).uint32(agent);
  writer
    .uint8(of.kind ?? 0)
    .float64(of.pitchRad ?? 0)
    .float64(of.distanceM ?? 0)
    .float64(0);
  writer.sequenceLength(of.path?.length ?? 0);
  of.path?.forEach((point) => vector(writer, point));
  vector(writer, [0, 0, 0]).float64(0).uint8(0).uint32(0).uint8(0);
  messages(writer, of.messages ?? []);
  writer
    .uint64(0n)
    .uint8(0)
    .string(of.info ?? "")
    .uint32(0)
    .uint32(0)
    .uint8(0);
  return { topic: `/agent_${agent}/command`, tick, bytes: writer.data };
}

export function poses(tick: number, positions: readonly Vec3[], yawRad = 0): RecordedMessage {
  const writer = new CdrWriter().sequenceLength(positions.length);
  positions.forEach((position, agent) => {
    vector(header(writer, tick).string(`agent_${agent}/base_link`), position);
    writer
      .float64(0)
      .float64(0)
      .float64(Math.sin(yawRad / 2))
      .float64(Math.cos(yawRad / 2));
  });
  return { topic: "/tf", tick, bytes: writer.data };
}

/** The poses of an agent and of moving obstacles, by the names of their frames. */
export function namedPoses(tick: number, frames: Readonly<Record<string, Vec3>>): RecordedMessage {
  const writer = new CdrWriter().sequenceLength(Object.keys(frames).length);
  for (const [name, position] of Object.entries(frames)) {
    vector(header(writer, tick).string(name), position).float64(0).float64(0).float64(0).float64(1);
  }
  return { topic: "/tf", tick, bytes: writer.data };
}

/** The pose of agent 0 by way of the frames between: each is in the one before it. */
export function chainedPose(tick: number, frames: readonly (readonly [Vec3, number])[]): RecordedMessage {
  const writer = new CdrWriter().sequenceLength(frames.length);
  frames.forEach(([position, yawRad], number) => {
    vector(header(writer, tick).string(`agent_0/frame_${number}`), position);
    writer
      .float64(0)
      .float64(0)
      .float64(Math.sin(yawRad / 2))
      .float64(Math.cos(yawRad / 2));
  });
  return { topic: "/tf", tick, bytes: writer.data };
}

export function placed(agent: number, tick: number, position: Vec3): RecordedMessage {
  const writer = header(new CdrWriter(), tick).uint64(BigInt(tick)).uint8(0).uint32(agent);
  vector(writer, position).float64(0);
  return { topic: "/sim/intervention", tick, bytes: writer.data };
}

export function mapChange(tick: number, isWall: boolean, low: Vec3, high: Vec3): RecordedMessage {
  const writer = header(new CdrWriter(), tick)
    .uint64(BigInt(tick))
    .uint8(isWall ? 1 : 0);
  for (const along of [...low, ...high]) writer.uint32(along);
  return { topic: "/sim/map_change", tick, bytes: writer.data };
}

/** A point cloud in the body frame, with these further fields of 32 bits. */
export function points(
  agent: number,
  tick: number,
  list: readonly Vec3[],
  fields: readonly string[] = [],
): RecordedMessage {
  const names = ["x", "y", "z", ...fields];
  const writer = header(new CdrWriter(), tick).uint32(1).uint32(list.length).sequenceLength(names.length);
  names.forEach((name, number) =>
    writer
      .string(name)
      .uint32(4 * number)
      .uint8(7)
      .uint32(1),
  );
  const data = new Uint8Array(
    Float32Array.from(list.flatMap((point) => [...point, ...fields.map(() => 9)])).buffer,
  );
  writer
    .uint8(0)
    .uint32(4 * names.length)
    .uint32(data.length)
    .uint8Array(data, true)
    .uint8(1);
  return { topic: `/agent_${agent}/points`, tick, bytes: writer.data };
}

function shares(writer: CdrWriter, agents: number): CdrWriter {
  writer.float64(0.5).float64(0.25);
  for (let list = 0; list < 4; list++) {
    writer.float64Array(new Float64Array(agents), true);
  }
  return writer;
}

export function progress(tick: number, agents: number): RecordedMessage {
  const writer = shares(header(new CdrWriter(), tick).uint64(BigInt(tick)), agents)
    .uint32(1)
    .uint64(12n);
  return { topic: "/sim/progress", tick, bytes: writer.data };
}

export function result(tick: number, agents: number, reason: string): RecordedMessage {
  const writer = header(new CdrWriter(), tick).uint64(BigInt(tick)).string(reason);
  shares(writer, agents).sequenceLength(1).string("scans").uint64(5n);
  writer.uint8Array(new Uint8Array(32).fill(0xab));
  return { topic: "/sim/result", tick, bytes: writer.data };
}
