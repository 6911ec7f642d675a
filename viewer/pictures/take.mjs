/**
 * Captures an image or a movie of a recording with the viewer's page in headless Chromium.
 *
 *     MAES_CAPTURE='{"url": "http://127.0.0.1:PORT/?token=...&recording=recording/run.mcap",
 *                    "out": "/tmp/cave.png", "size": [1280, 720],
 *                    "agent": null, "layers": null, "at": 120}' node take.mjs
 *     MAES_CAPTURE='{"url": ..., "out": "/tmp/cave.mp4", "size": [1280, 720],
 *                    "agent": 3, "layers": ["walls", "trails"],
 *                    "from": null, "to": 300, "seconds": 20, "fps": 30}' node take.mjs
 *
 * The order is in the environment, which other users of the machine cannot read, because the
 * address has the token of the server.
 *
 * Called by `maes snapshot` and `maes movie`, which serve the page. The output file appears when it
 * is complete. Errors are one line on stderr; exit code 2: the request is invalid, 1: something has
 * failed.
 */
import { open, rename, stat, writeFile } from "node:fs/promises";
import { basename, dirname, join } from "node:path";
import { performance } from "node:perf_hooks";
import process from "node:process";
import { CaptureError, firstLine, InvalidRequest } from "./errors.mjs";
import { startMovie } from "./movie.mjs";
import { cleanUpAtExit, removeAtExit } from "./cleanup.mjs";
import { frameTimesOf, idleLayers, parseRequest } from "./request.mjs";
import { chromiumIn, ffmpegIn } from "./programs.mjs";
import { HeadlessPage } from "./headless-page.mjs";

/** Period of progress reports of a movie, milliseconds. */
const PROGRESS_MS = 2000;

cleanUpAtExit();
try {
  await take(parseRequest(process.env["MAES_CAPTURE"]));
} catch (error) {
  report(`error: ${firstLine(error)}`);
  process.exit(error instanceof InvalidRequest ? error.exitCode : 1);
}

/** @param {import("./request.mjs").CaptureRequest} request */
async function take(request) {
  const chromium = chromiumIn(process.env);
  const ffmpeg = request.kind === "png" ? null : ffmpegIn(process.env);
  const part = await partOf(request.out);
  const page = await HeadlessPage.open(chromium, request);
  try {
    const recording = await page.read();
    const times = frameTimesOf(request, recording);
    if (recording.problem !== null) report(`note: ${recording.problem}`);
    for (const layer of idleLayers(request)) report(`note: the layer ${layer} shows nothing without --agent`);
    await page.arrange(request, times[0] ?? 0);
    if (request.kind === "png") await writeFile(part, await page.take(times[0] ?? 0, { isQuick: false }));
    else
      await record(
        page,
        times,
        await startMovie(ffmpeg ?? "", { kind: request.kind, fps: request.fps }, part),
      );
    await rename(part, request.out);
  } finally {
    // The browser never outlives this process.
    await page.close();
  }
}

/**
 * @param {HeadlessPage} page
 * @param {readonly number[]} times
 * @param {import("./movie.mjs").MovieWriter} movie
 */
async function record(page, times, movie) {
  const parent = process.ppid;
  let reportedMs = performance.now();
  for (const [frame, timeS] of times.entries()) {
    await movie.add(await page.take(timeS, { isQuick: true }));
    if (process.ppid !== parent) throw new CaptureError("the command that requested the movie has ended");
    const isLast = frame === times.length - 1;
    if (!isLast && performance.now() - reportedMs < PROGRESS_MS) continue;
    reportedMs = performance.now();
    report(`frame ${frame + 1} of ${times.length}`);
  }
  await movie.finish();
}

/**
 * Creates the temporary file beside the output file.
 * @param {string} out
 */
async function partOf(out) {
  if (await isFolder(out)) throw new InvalidRequest(`--out ${out}: it is a folder`);
  if (!(await isFolder(dirname(out))))
    throw new InvalidRequest(`--out ${out}: the folder ${dirname(out)} does not exist`);
  const part = join(dirname(out), `.${basename(out)}.${process.pid}.part`);
  try {
    await (await open(part, "wx")).close();
  } catch (error) {
    const { code } = /** @type {NodeJS.ErrnoException} */ (error);
    throw new InvalidRequest(`--out ${out}: the file cannot be created (${code ?? firstLine(error)})`);
  }
  removeAtExit(part);
  return part;
}

/** @param {string} path */
async function isFolder(path) {
  return (await stat(path).catch(() => null))?.isDirectory() ?? false;
}

/** @param {string} line */
function report(line) {
  process.stderr.write(`${line}\n`);
}
