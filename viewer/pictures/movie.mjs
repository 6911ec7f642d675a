/**
 * Encodes a movie with ffmpeg from a sequence of PNG frames.
 *
 * An MP4 is encoded while the frames arrive. A GIF needs the colours of all frames first: they are
 * kept in a temporary file, which one filter graph reads twice, so that memory use does not grow
 * with the length.
 */
import { spawn } from "node:child_process";
import { once } from "node:events";
import { open } from "node:fs/promises";
import { CaptureError } from "./errors.mjs";
import { killAtExit, removeAtExit } from "./cleanup.mjs";

/** Length of ffmpeg's error output that is kept, characters. */
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
 * @param {string} path Output file.
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
    ...frameInput(fps, "pipe:0"),
    // BT.709, which players expect of HD video, with explicit labels.
    ...["-vf", "scale=out_color_matrix=bt709:out_range=tv:flags=accurate_rnd+full_chroma_int,format=yuv420p"],
    ...["-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"],
    // One thread, because the output of x264 depends on the number; rendering dominates anyway.
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
        ...frameInput(fps, kept),
        ...frameInput(fps, kept),
        "-filter_complex",
        // Ordered dithering is stable between frames; other patterns flicker, and make large files.
        "[0:v]palettegen=stats_mode=full[colours];[1:v][colours]paletteuse=dither=bayer:bayer_scale=3:diff_mode=rectangle",
        ...["-loop", "0", "-f", "gif", path],
      ]);
      encoder.program.stdin.end();
      await encoder.isOver;
    },
  };
}

/**
 * Input arguments for a sequence of PNG frames.
 * @param {number} fps
 * @param {string} from
 */
function frameInput(fps, from) {
  return ["-f", "image2pipe", "-framerate", String(fps), "-c:v", "png", "-i", from];
}

/**
 * @param {string} ffmpeg
 * @param {readonly string[]} settings
 */
function run(ffmpeg, settings) {
  const program = spawn(ffmpeg, ["-hide_banner", "-loglevel", "error", "-nostdin", "-y", ...settings], {
    stdio: ["pipe", "ignore", "pipe"],
    // Ctrl-C is handled by this process, which kills ffmpeg itself.
    detached: true,
  });
  killAtExit(program);
  let stderr = "";
  program.stderr.setEncoding("utf8");
  program.stderr.on("data", (/** @type {string} */ text) => (stderr = (stderr + text).slice(-STDERR_MAX)));
  // The reason of its exit says more than a broken pipe.
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
  // It may reject before it is awaited; the next await reports it.
  isOver.catch(() => undefined);
  return { program, isOver };
}
