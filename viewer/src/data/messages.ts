/**
 * Decoders of the messages of a recording that the page uses.
 *
 * Message types are those of `msgs/msg`; fields that the page does not use are skipped. Throws a
 * RangeError if the bytes are not a message of the type.
 */

import { CdrReader, type Runs } from "./cdr.ts";
import { TICK_S, type MapChange, type Progress, type Result, type Vec3 } from "./run.ts";

/** Protocol version of these messages. */
export const PROTOCOL = 3;

/** Ids of contacts and senders from here on are those of relays. */
export const FIRST_RELAY = 0x80000000;

/** Kind of agent messages that contain maps. */
export const MAP_MESSAGE_KIND = 1;

/** Task kinds by number. */
export const TaskKind = { Keep: 0, Stop: 1, Move: 2, Turn: 3, Path: 4, Velocity: 5 } as const;

export interface AgentMessage {
  readonly kind: number;
  readonly data: Uint8Array;
}

/** A fragment of an observation. */
export interface Observation {
  readonly tick: number;
  readonly part: number;
  readonly parts: number;
  readonly position: Vec3;
  readonly yawRad: number;
  readonly isIdle: boolean;
  readonly collision: number;
  /** Ids of agents and relays in radio contact. */
  readonly contacts: readonly number[];
  readonly received: readonly AgentMessage[];
  /** NaN if there was no scan. */
  readonly scanTick: number;
  readonly seenFree: Runs;
  readonly seenWall: Runs;
}

export interface Command {
  readonly tick: number;
  /** See `TaskKind`. */
  readonly kind: number;
  readonly pitchRad: number;
  readonly distanceM: number;
  /** x, y, z of each waypoint. */
  readonly path: readonly number[];
  readonly sent: readonly AgentMessage[];
  readonly info: string;
  readonly knownFree: number;
}

export interface Scenario {
  readonly durationTicks: number;
  readonly size: Vec3;
  readonly cellM: number;
  readonly agents: number;
  readonly controller: string;
  readonly radiusM: readonly number[];
  readonly rays: number;
  readonly rangeM: number;
  readonly fovRad: number;
  readonly communicationRangeM: number;
}

export interface Pose {
  readonly agent: number;
  readonly position: Vec3;
  readonly yawRad: number;
}

export interface Intervention {
  readonly tick: number;
  readonly isPlaced: boolean;
  readonly agent: number;
  readonly position: Vec3;
  readonly yawRad: number;
}

/** The centre of a moving obstacle. */
export interface ObstaclePose {
  readonly obstacle: number;
  readonly position: Vec3;
}

/** Points of a scan in the body frame, x, y, z each, and the time of the scan. */
export interface PointCloud {
  readonly timeS: number;
  readonly points: Float32Array;
}

function vector(reader: CdrReader): Vec3 {
  return [reader.f64(), reader.f64(), reader.f64()];
}

/** Skips a header and returns its stamp in seconds. */
function header(reader: CdrReader): number {
  const seconds = reader.i32();
  const nanoseconds = reader.u32();
  reader.bytes();
  return seconds + nanoseconds * 1e-9;
}

function agentMessages(reader: CdrReader): AgentMessage[] {
  return Array.from({ length: reader.count(9) }, () => {
    reader.u32();
    return { kind: reader.u8(), data: reader.bytes() };
  });
}

export function observation(bytes: Uint8Array): Observation {
  const reader = new CdrReader(bytes);
  header(reader);
  const tick = reader.u64();
  reader.u64();
  reader.u32();
  const part = reader.u16();
  const parts = reader.u16();
  reader.u8();
  const position = vector(reader);
  const yawRad = reader.f64();
  reader.skip(4, 8);
  const isIdle = reader.u8() === 0;
  const collision = reader.u8();
  reader.skip(2, 1);
  const contacts = Array.from({ length: reader.count(28) }, () => {
    const agent = reader.u32();
    reader.skip(3, 8);
    return agent;
  });
  const received = agentMessages(reader);
  const scan = reader.u64();
  return {
    tick,
    part,
    parts,
    position,
    yawRad,
    isIdle,
    collision,
    contacts,
    received,
    scanTick: scan <= tick ? scan : NaN,
    seenFree: reader.runs(),
    seenWall: reader.runs(),
  };
}

export function command(bytes: Uint8Array): Command {
  const reader = new CdrReader(bytes);
  const tick = reader.u64();
  reader.u64();
  reader.u32();
  const kind = reader.u8();
  if (kind > TaskKind.Velocity) {
    throw new RangeError(`unknown task kind ${kind}`);
  }
  const pitchRad = reader.f64();
  const distanceM = reader.f64();
  reader.f64();
  const points = reader.count(24);
  const path = Array.from({ length: 3 * points }, () => reader.f64());
  reader.skip(4, 8);
  // LiDAR request and whether the belief map is wanted.
  reader.u8();
  reader.u32();
  reader.u8();
  const sent = agentMessages(reader);
  reader.u64();
  reader.u8();
  const info = reader.string();
  return { tick, kind, pitchRad, distanceM, path, sent, info, knownFree: reader.u32() };
}

/** The protocol version of a scenario, which is its first field in every version. */
export function protocolOf(bytes: Uint8Array): number {
  return new CdrReader(bytes).u32();
}

export function scenario(bytes: Uint8Array): Scenario {
  const reader = new CdrReader(bytes);
  reader.u32();
  reader.skip(3, 8);
  const durationTicks = reader.u64();
  const size: Vec3 = [reader.u32(), reader.u32(), reader.u32()];
  const cellM = reader.f64();
  const agents = reader.u32();
  reader.u64();
  const controller = reader.string();
  for (let settings = reader.count(4); settings > 0; settings--) {
    reader.bytes();
  }
  const radii = Array.from({ length: reader.count(57) }, () => {
    reader.u8();
    const radiusM = reader.f64();
    reader.skip(6, 8);
    return radiusM;
  });
  const bodyOf = reader.bytes();
  const rays = reader.u32();
  const rangeM = reader.f64();
  const fovRad = reader.f64();
  reader.u32();
  const communicationRangeM = reader.f64();
  if (bodyOf.length !== agents || bodyOf.some((body) => body >= radii.length)) {
    throw new RangeError(`${agents} agents with ${bodyOf.length} bodies`);
  }
  return {
    durationTicks,
    size,
    cellM,
    agents,
    controller,
    radiusM: Array.from(bodyOf, (body) => radii[body]!),
    rays,
    rangeM,
    fovRad,
    communicationRangeM,
  };
}

/** The controller in a join message. */
export function controllerOfJoin(bytes: Uint8Array): string {
  const reader = new CdrReader(bytes);
  reader.u64();
  reader.u32();
  reader.u64();
  reader.u32();
  return reader.string();
}

/**
 * The poses of agents and of moving obstacles in a message on `/tf`: of each agent one transform, or
 * those by way of its map and its odometry, one after another.
 */
export function poses(
  bytes: Uint8Array,
  tick: number,
): { readonly agents: readonly Pose[]; readonly obstacles: readonly ObstaclePose[] } {
  const reader = new CdrReader(bytes);
  const found: Pose[] = [];
  const obstacles: ObstaclePose[] = [];
  for (let frames = reader.count(64); frames > 0; frames--) {
    const stampTick = Math.round(header(reader) / TICK_S);
    const frame = reader.bytes();
    const agent = numberIn(frame, "agent_", "/");
    const position = vector(reader);
    const [x, y, z, w] = [reader.f64(), reader.f64(), reader.f64(), reader.f64()];
    const yawRad = Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z));
    if (stampTick !== tick) continue;
    if (agent < 0) {
      const obstacle = numberIn(frame, "obstacle_", "\0");
      if (obstacle >= 0) obstacles.push({ obstacle, position });
      continue;
    }
    const parent = found.at(-1);
    if (parent?.agent === agent) {
      found[found.length - 1] = composed(parent, { agent, position, yawRad });
    } else {
      found.push({ agent, position, yawRad });
    }
  }
  return { agents: found, obstacles };
}

/** A pose in the frame of another one, in the frame of that one. */
function composed(parent: Pose, { agent, position: [x, y, z], yawRad }: Pose): Pose {
  const [cos, sin] = [Math.cos(parent.yawRad), Math.sin(parent.yawRad)];
  const [originX, originY, originZ] = parent.position;
  return {
    agent,
    position: [originX + cos * x - sin * y, originY + sin * x + cos * y, originZ + z],
    yawRad: parent.yawRad + yawRad,
  };
}

/**
 * The number between a prefix and `end` in the name of a frame, which ends with a zero, or -1.
 * Parsed from bytes, because every pose has a frame name.
 */
function numberIn(bytes: Uint8Array, prefix: string, end: "/" | "\0"): number {
  for (let at = 0; at < prefix.length; at++) {
    if (bytes[at] !== prefix.charCodeAt(at)) {
      return -1;
    }
  }
  let number = 0;
  let at = prefix.length;
  for (; at < bytes.length; at++) {
    const digit = bytes[at]! - 0x30;
    if (digit < 0 || digit > 9) {
      break;
    }
    number = 10 * number + digit;
  }
  return at > prefix.length && bytes[at] === end.charCodeAt(0) ? number : -1;
}

export function progress(bytes: Uint8Array): Progress {
  const reader = new CdrReader(bytes);
  header(reader);
  const timeS = reader.u64() * TICK_S;
  const shares = sharesOf(reader);
  return { timeS, ...shares, pairsInContact: reader.u32(), messageBytes: reader.u64() };
}

function sharesOf(reader: CdrReader) {
  return {
    explored: reader.f64(),
    covered: reader.f64(),
    exploredBy: reader.f64s(),
    coveredBy: reader.f64s(),
    distanceM: reader.f64s(),
    believedBy: reader.f64s(),
  };
}

/** The result; fields that only progress messages have are taken from the last of them. */
export function result(bytes: Uint8Array, last: Progress | undefined): Result {
  const reader = new CdrReader(bytes);
  header(reader);
  const tick = reader.u64();
  const reason = reader.string();
  const shares = sharesOf(reader);
  const counters = new Map<string, number>();
  for (let left = reader.count(13); left > 0; left--) {
    // Builds with protocol 6 or earlier called messages of agents parcels.
    const name = reader.string().replace(/^parcel/, "message");
    counters.set(name, reader.u64());
  }
  const digest = Array.from({ length: 32 }, () => reader.u8().toString(16).padStart(2, "0")).join("");
  return {
    timeS: tick * TICK_S,
    tick,
    reason,
    ...shares,
    pairsInContact: last?.pairsInContact ?? 0,
    messageBytes: counters.get("message_bytes_delivered") ?? last?.messageBytes ?? 0,
    counters,
    digest,
  };
}

/** Kinds of interventions that put a body at a pose. */
const PLACE = 0;
const JOIN = 3;

/** An external change of an agent: it was placed, or something else happened to it. */
export function intervention(bytes: Uint8Array): Intervention {
  const reader = new CdrReader(bytes);
  header(reader);
  const tick = reader.u64();
  const kind = reader.u8();
  const isPlaced = kind === PLACE || kind === JOIN;
  return { tick, isPlaced, agent: reader.u32(), position: vector(reader), yawRad: reader.f64() };
}

/** Kinds of changes in which cells become wall: by an event, and by a request. */
const WALLS = new Set([1, 3]);

/** A change of the map: the cells of a box have become free or wall. */
export function mapChange(bytes: Uint8Array): MapChange {
  const reader = new CdrReader(bytes);
  header(reader);
  const tick = reader.u64();
  const isWall = WALLS.has(reader.u8());
  const cell = (): Vec3 => [reader.u32(), reader.u32(), reader.u32()];
  return { tick, isWall, low: cell(), high: cell() };
}

/** Bytes of x, y and z of a point. */
const COORDINATES_BYTES = 12;

/** The coordinates of a point cloud, whose points begin with them, as three 32-bit floats. */
export function pointCloud(bytes: Uint8Array): PointCloud {
  const reader = new CdrReader(bytes);
  const timeS = header(reader);
  reader.skip(2, 4);
  for (let fields = reader.count(13); fields > 0; fields--) {
    reader.bytes();
    reader.u32();
    reader.u8();
    reader.u32();
  }
  reader.u8();
  const step = reader.u32();
  reader.u32();
  const data = reader.bytes();
  if (step < COORDINATES_BYTES || data.length % step !== 0) {
    throw new RangeError(`points of ${step} bytes in ${data.length}`);
  }
  // Copied, because the bytes may be unaligned, and without the fields behind the coordinates.
  const coordinates = new Uint8Array((data.length / step) * COORDINATES_BYTES);
  for (let point = 0; point * step < data.length; point++) {
    const start = point * step;
    coordinates.set(data.subarray(start, start + COORDINATES_BYTES), point * COORDINATES_BYTES);
  }
  return { timeS, points: new Float32Array(coordinates.buffer) };
}
