/**
 * Makes a movie of pictures with ffmpeg. Each picture is a PNG; they come in request.
 *
 * An MP4 is encoded while pictures come. A GIF needs the colours of all pictures first: they are kept in a file beside it meanwhile,
 * which one filter graph reads twice, so that memory does not grow with the length.
 */
import { spawn } from "node:child_process";
import { once } from "node:events";
import { open } from "node:fs/promises";
import { CaptureError } from "./errors.mjs";
import { killAtExit, removeAtExit } from "./cleanup.mjs";

/** So much of what ffmpeg has stderr last is kept, characters. */
const STDERR_MAX = 4000;

/**
 * @typedef {object} MovieWriter
 * @property {(png: Uint8Array) => Promise<void>} add
 * @property {() => Promise<void>} finish Resolves when the file is complete.
 *
 * @typedef {{ kind: "mp4" | "gif", fps: number }} Format
 */

/**
 * @param {string} ffmpeg
 * @param {Format} format
 * @param {string} path Where it is written.
 * @returns {Promise<MovieWriter>}
 */
export async function startMovie(ffmpeg, format, path) {
  return format.kind === "mp4" ? openMp4(ffmpeg, format.fps, path) : await openGif(ffmpeg, format.fps, path);
}

/**
 * @param {string} ffmpeg
 * @param {number} fps
 * @param {string} path
 * @returns {MovieWriter}
 */
function openMp4(ffmpeg, fps, path) {
  const encoder = run(ffmpeg, [
    ...pictures(fps, "pipe:0"),
    // Colours as players expect them of a movie of this size; without the labels each would guess.
    ...["-vf", "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int,format=yuv420p"],
    ...["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"],
    // One thread, because what x264 writes depends on how many there are; to draw takes longer anyway.
    ...["-c:v", "libx264", "-preset", "medium", "-crf", "18", "-threads", "1"],
    ...["-movflags", "+faststart", "-fflags", "+bitexact", "-f", "mp4", path],
  ]);
  const { stdin } = encoder.program;
  return {
    add: async (png) => {
      if (stdin.destroyed || !stdin.write(png)) await Promise.race([once(stdin, "drain"), encoder.isOver]);
    },
    finish: async () => {
      stdin.end();
      await encoder.isOver;
    },
  };
}

/**
 * @param {string} ffmpeg
 * @param {number} fps
 * @param {string} path
 * @returns {Promise<MovieWriter>}
 */
async function openGif(ffmpeg, fps, path) {
  const kept = `${path}.frames`;
  removeAtExit(kept);
  const file = await open(kept, "w");
  return {
    add: (png) => file.appendFile(png),
    finish: async () => {
      await file.close();
      const encoder = run(ffmpeg, [
        ...pictures(fps, kept),
        ...pictures(fps, kept),
        "-filter_complex",
        // An ordered pattern stays where it is from picture to picture; others would flicker, and make large files.
        "[0:v]palettegen=stats_mode=full[colours];[1:v][colours]paletteuse=dither=bayer:bayer_scale=3:diff_mode=rectangle",
        ...["-loop", "0", "-f", "gif", path],
      ]);
      encoder.program.stdin.end();
      await encoder.isOver;
    },
  };
}

/**
 * The arguments for an input of pictures one after the other.
 * @param {number} fps
 * @param {string} from
 */
function pictures(fps, from) {
  return ["-f", "image2pipe", "-framerate", String(fps), "-c:v", "png", "-i", from];
}

/**
 * @param {string} ffmpeg
 * @param {readonly string[]} settings
 */
function run(ffmpeg, settings) {
  const program = spawn(ffmpeg, ["-hide_banner", "-loglevel", "error", "-nostdin", "-y", ...settings], {
    stdio: ["pipe", "ignore", "pipe"],
    // An interrupt at the terminal is for this process, which ends ffmpeg itself.
    detached: true,
  });
  killAtExit(program);
  let stderr = "";
  program.stderr.setEncoding("utf8");
  program.stderr.on("data", (/** @type {string} */ text) => (stderr = (stderr + text).slice(-STDERR_MAX)));
  // That a pipe has broken says less than why the program has ended.
  program.stdin.on("error", () => undefined);
  /** @type {Promise<void>} */
  const isOver = new Promise((resolve, reject) => {
    program.once("error", (error) => reject(new CaptureError(`ffmpeg cannot be started: ${error.message}`)));
    program.once("close", (code) => {
      if (code === 0) resolve();
      else
        reject(
          new CaptureError(`ffmpeg has failed: ${stderr.trim().split("\n").at(-1) || `exit code ${code}`}`),
        );
    });
  });
  // It may fail while nobody waits for it; who waits next is told.
  isOver.catch(() => undefined);
  return { program, isOver };
}
