/**
 * Validation of capture requests: an image of one time, or a movie of an interval. Pure.
 *
 * Errors name the options of the commands that pass the request on. What depends on the recording
 * (its end, its agents, the layers of the page) is checked by `frameTimesOf` after it has been
 * read.
 */
import { isAbsolute } from "node:path";
import { InvalidRequest } from "./errors.mjs";

/** Limits of width and height, pixels; software renderers have no larger textures. */
const SIDE_MIN = 16;
const SIDE_MAX = 8192;
const FPS_MAX = 120;
/** GIF delays are hundredths of a second, and browsers slow down delays below two of them. */
const GIF_FPS_MAX = 50;
/**
 * A time may exceed the end by half a tick of 0.02 s, because ends are printed with two decimals.
 */
const SLACK_S = 0.01;

const CAMERAS = /** @type {const} */ (["corner", "top", "front", "side"]);
const BACKGROUNDS = /** @type {const} */ (["dark", "white"]);

/** Layers that show nothing without an agent. */
const LAYERS_OF_AGENT = ["hits", "belief"];

/**
 * @typedef {{ readonly axis: "x" | "y" | "z", readonly share: number }} Cut
 *
 * @typedef {object} CommonRequest
 * @property {string} url The page with the recording.
 * @property {string} out Output file, an absolute path.
 * @property {readonly [number, number]} size Width and height, pixels.
 * @property {number | null} agent The agent that the camera follows; null: the whole cave.
 * @property {readonly string[] | null} layers Visible layers; null: the defaults of the page.
 * @property {"corner" | "top" | "front" | "side"} camera From where the whole cave is seen.
 * @property {"dark" | "white"} background
 * @property {Cut | null} cut What lies beyond this share of the map along the axis is left out.
 *
 * @typedef {CommonRequest & { kind: "png", atS: number }} ImageRequest
 * @typedef {CommonRequest & { kind: "mp4" | "gif", fromS: number | null, toS: number | null,
 *   lengthS: number, fps: number }} MovieRequest
 * @typedef {ImageRequest | MovieRequest} CaptureRequest
 *
 * @typedef {object} RecordingFacts Facts of a recording that has been read completely.
 * @property {number} endS
 * @property {number} agents
 * @property {readonly string[]} layers All layers of the page.
 */

/**
 * Parses a request.
 * @param {string | undefined} text JSON.
 * @returns {CaptureRequest}
 */
export function parseRequest(text) {
  const fields = objectOf(text);
  const isPicture = fields["at"] !== undefined;
  const common = {
    url: urlOf(fields["url"]),
    out: pathOf(fields["out"]),
    size: sizeOf(fields["size"]),
    agent: agentOf(fields["agent"] ?? null),
    layers: layersOf(fields["layers"] ?? null),
    cut: cutOf(fields["cut"] ?? null),
    camera: wordOf("--camera", fields["camera"] ?? "corner", CAMERAS),
    background: wordOf("--background", fields["background"] ?? "dark", BACKGROUNDS),
  };
  const kind = endingOf(common.out);
  if (isPicture) {
    if (kind !== "png") throw new InvalidRequest(`--out ${common.out}: an image ends in .png`);
    return { ...common, kind, atS: numberOf("--at", fields["at"]) };
  }
  if (kind !== "mp4" && kind !== "gif")
    throw new InvalidRequest(`--out ${common.out}: a movie ends in .mp4 or .gif`);
  const [width, height] = common.size;
  if (kind === "mp4" && (width % 2 !== 0 || height % 2 !== 0)) {
    throw new InvalidRequest(`--size ${width}x${height}: an MP4 needs an even width and height`);
  }
  const fpsMax = kind === "gif" ? GIF_FPS_MAX : FPS_MAX;
  return {
    ...common,
    kind,
    fromS: timeOf("--from", fields["from"] ?? null),
    toS: timeOf("--to", fields["to"] ?? null),
    lengthS: numberOf("--seconds", fields["seconds"], { above: 0 }),
    fps: numberOf("--fps", fields["fps"], { above: 0, max: fpsMax }),
  };
}

/**
 * Times of the frames, ascending; one for an image. Throws if the recording cannot satisfy the
 * request.
 * @param {CaptureRequest} request
 * @param {RecordingFacts} recording
 * @returns {number[]}
 */
export function frameTimesOf(request, recording) {
  const { agent, layers } = request;
  if (agent !== null && agent >= recording.agents) {
    const are =
      recording.agents === 1 ? "the only agent is 0" : `the agents are 0 to ${recording.agents - 1}`;
    throw new InvalidRequest(`--agent ${agent}: ${are}`);
  }
  const unknown = layers?.find((layer) => !recording.layers.includes(layer));
  if (unknown !== undefined) {
    throw new InvalidRequest(`--layers ${unknown}: the layers are ${recording.layers.join(", ")}`);
  }
  if (request.kind === "png") return [within("--at", request.atS, recording.endS)];
  const fromS = within("--from", request.fromS ?? 0, recording.endS);
  const toS = within("--to", request.toS ?? recording.endS, recording.endS);
  if (!(fromS < toS)) {
    throw new InvalidRequest(
      `--from ${seconds(fromS)} --to ${seconds(toS)}: the movie must end after it begins`,
    );
  }
  return frameTimes(fromS, toS, request.lengthS, request.fps);
}

/**
 * The requested layers that show nothing because no agent was given.
 * @param {CaptureRequest} request
 * @returns {string[]}
 */
export function idleLayers({ agent, layers }) {
  return agent === null ? (layers ?? []).filter((layer) => LAYERS_OF_AGENT.includes(layer)) : [];
}

/**
 * Equidistant times; the first frame is at `fromS`, the last one at `toS`.
 * @param {number} fromS
 * @param {number} toS
 * @param {number} lengthS Duration of the movie.
 * @param {number} fps
 * @returns {number[]}
 */
export function frameTimes(fromS, toS, lengthS, fps) {
  const frames = Math.round(lengthS * fps);
  if (frames < 2) {
    throw new InvalidRequest(
      `--seconds ${lengthS} --fps ${fps}: that is ${frames} frames; a movie needs at least 2`,
    );
  }
  // Interpolated so that both ends are exact despite rounding.
  return Array.from({ length: frames }, (_, frame) => {
    const share = frame / (frames - 1);
    return fromS * (1 - share) + toS * share;
  });
}

/**
 * @param {string | undefined} text
 * @returns {Record<string, unknown>}
 */
function objectOf(text) {
  /** @type {unknown} */
  let value;
  try {
    value = JSON.parse(text ?? "");
  } catch {
    value = null;
  }
  if (typeof value !== "object" || value === null || Array.isArray(value)) {
    throw new InvalidRequest("expected one argument: a JSON object with the capture request");
  }
  return /** @type {Record<string, unknown>} */ (value);
}

/** @param {unknown} value */
function urlOf(value) {
  if (typeof value !== "string" || !/^https?:\/\//.test(value) || !globalThis.URL.canParse(value)) {
    throw new InvalidRequest(`url ${JSON.stringify(value)}: expected the address of the page, http://...`);
  }
  return value;
}

/** @param {unknown} value */
function pathOf(value) {
  if (typeof value !== "string" || !isAbsolute(value)) {
    throw new InvalidRequest(`--out ${JSON.stringify(value)}: expected an absolute path`);
  }
  return value;
}

/** @param {string} path */
function endingOf(path) {
  return /[^/]\.([^./]+)$/.exec(path)?.[1]?.toLowerCase() ?? null;
}

/**
 * @param {unknown} value
 * @returns {readonly [number, number]}
 */
function sizeOf(value) {
  const isSide = (/** @type {unknown} */ side) =>
    typeof side === "number" && Number.isInteger(side) && side >= SIDE_MIN && side <= SIDE_MAX;
  if (!Array.isArray(value) || value.length !== 2 || !value.every(isSide)) {
    const shown = Array.isArray(value) ? value.join("x") : JSON.stringify(value);
    throw new InvalidRequest(
      `--size ${shown}: expected WIDTHxHEIGHT in pixels, each from ${SIDE_MIN} to ${SIDE_MAX}`,
    );
  }
  return [value[0], value[1]];
}

/** @param {unknown} value */
function agentOf(value) {
  if (value === null) return null;
  if (typeof value !== "number" || !Number.isInteger(value) || value < 0) {
    throw new InvalidRequest(`--agent ${JSON.stringify(value)}: expected an agent id from 0 on`);
  }
  return value;
}

/**
 * @param {unknown} value
 * @returns {readonly string[] | null}
 */
function layersOf(value) {
  if (value === null) return null;
  if (!Array.isArray(value) || value.length === 0 || value.some((name) => typeof name !== "string")) {
    throw new InvalidRequest(`--layers ${JSON.stringify(value)}: expected layer names separated by commas`);
  }
  return value;
}

/**
 * @template {string} Word
 * @param {string} option
 * @param {unknown} value
 * @param {readonly Word[]} words
 * @returns {Word}
 */
function wordOf(option, value, words) {
  const word = words.find((word) => word === value);
  if (word === undefined)
    throw new InvalidRequest(`${option} ${JSON.stringify(value)}: expected ${words.join(", ")}`);
  return word;
}

/**
 * @param {unknown} value
 * @returns {Cut | null}
 */
function cutOf(value) {
  if (value === null) return null;
  const { axis, share } = /** @type {Record<string, unknown>} */ (value);
  if ((axis !== "x" && axis !== "y" && axis !== "z") || typeof share !== "number" || !(share > 0)) {
    throw new InvalidRequest(`cut ${JSON.stringify(value)}: expected an axis and a share above 0`);
  }
  return { axis, share };
}

/**
 * @param {string} option
 * @param {unknown} value
 * @param {{ above?: number, max?: number }} limits
 */
function numberOf(option, value, { above = -Infinity, max = Infinity } = {}) {
  if (typeof value !== "number" || !Number.isFinite(value) || value <= above || value > max) {
    const limits = [above > -Infinity ? ` above ${above}` : "", max < Infinity ? ` up to ${max}` : ""].join(
      "",
    );
    throw new InvalidRequest(`${option} ${JSON.stringify(value)}: expected a number${limits}`);
  }
  return value;
}

/**
 * @param {string} option
 * @param {unknown} value
 */
function timeOf(option, value) {
  return value === null ? null : numberOf(option, value);
}

/**
 * Clamps a time to the recording; it may exceed the end by a rounding error.
 * @param {string} option
 * @param {number} timeS
 * @param {number} endS
 */
function within(option, timeS, endS) {
  if (timeS < 0 || timeS > endS + SLACK_S) {
    throw new InvalidRequest(`${option} ${timeS}: the recording goes from 0 to ${seconds(endS)} s`);
  }
  return Math.min(timeS, endS);
}

/** @param {number} timeS */
function seconds(timeS) {
  return String(Number(timeS.toFixed(2)));
}
