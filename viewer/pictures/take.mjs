/**
 * Takes a picture or a movie of a recording with the viewer's own page, in Chromium without a window.
 *
 *     node take.mjs '{"url": "http://127.0.0.1:PORT/?recording=recording/run.mcap", "out": "/tmp/cave.png", "size": [1280, 720],
 *                     "agent": null, "layers": null, "at": 120}'
 *     node take.mjs '{"url": ..., "out": "/tmp/cave.mp4", "size": [1280, 720], "agent": 3, "layers": ["walls", "trails"],
 *                     "from": null, "to": 300, "seconds": 20, "fps": 30}'
 *
 * It is called by `sim_server snapshot` and `experiments movie`, which serve the page. The file appears under its name when it is
 * complete, and not before. Errors are one line on stderr; exit code 2: what was asked for cannot be, 1: something has failed.
 */
import { open, rename, stat, writeFile } from "node:fs/promises";
import { basename, dirname, join } from "node:path";
import { performance } from "node:perf_hooks";
import process from "node:process";
import { Failure, firstLine, Refusal } from "./faults.mjs";
import { startFilm } from "./film.mjs";
import { leaveNothing, removeAtExit } from "./leftovers.mjs";
import { checkedAgainst, idleLayers, orderOf } from "./order.mjs";
import { chromiumIn, ffmpegIn } from "./programs.mjs";
import { Stage } from "./stage.mjs";

/** How often it is told how far a movie is, milliseconds. */
const PROGRESS_MS = 2000;

leaveNothing();
try {
  await take(orderOf(process.argv[2]));
} catch (error) {
  tell(`error: ${firstLine(error)}`);
  process.exit(error instanceof Refusal ? error.exitCode : 1);
}

/** @param {import("./order.mjs").Order} order */
async function take(order) {
  const chromium = chromiumIn(process.env);
  const ffmpeg = order.kind === "png" ? null : ffmpegIn(process.env);
  const part = await partOf(order.out);
  const stage = await Stage.open(chromium, order);
  try {
    const told = await stage.read();
    const times = checkedAgainst(order, told);
    if (told.problem !== null) tell(`note: ${told.problem}`);
    for (const layer of idleLayers(order)) tell(`note: the layer ${layer} shows nothing without --agent`);
    await stage.arrange(order, times[0] ?? 0);
    if (order.kind === "png") await writeFile(part, await stage.take(times[0] ?? 0, { isQuick: false }));
    else await shoot(stage, times, await startFilm(ffmpeg ?? "", { kind: order.kind, fps: order.fps }, part));
    await rename(part, order.out);
  } finally {
    // Nothing of the browser outlives this, whatever came of it.
    await stage.close();
  }
}

/**
 * @param {Stage} stage
 * @param {readonly number[]} times
 * @param {import("./film.mjs").Film} film
 */
async function shoot(stage, times, film) {
  const parent = process.ppid;
  let toldMs = performance.now();
  for (const [frame, timeS] of times.entries()) {
    await film.add(await stage.take(timeS, { isQuick: true }));
    if (process.ppid !== parent) throw new Failure("the command that ordered the movie has ended");
    const isLast = frame === times.length - 1;
    if (!isLast && performance.now() - toldMs < PROGRESS_MS) continue;
    toldMs = performance.now();
    tell(`frame ${frame + 1} of ${times.length}`);
  }
  await film.finish();
}

/**
 * Makes the file that is written until it is complete, beside the one that it becomes.
 * @param {string} out
 */
async function partOf(out) {
  if (await isFolder(out)) throw new Refusal(`--out ${out}: it is a folder`);
  if (!(await isFolder(dirname(out)))) throw new Refusal(`--out ${out}: there is no folder ${dirname(out)}`);
  const part = join(dirname(out), `.${basename(out)}.${process.pid}.part`);
  try {
    await (await open(part, "wx")).close();
  } catch (error) {
    const { code } = /** @type {NodeJS.ErrnoException} */ (error);
    throw new Refusal(`--out ${out}: no file can be made there (${code ?? firstLine(error)})`);
  }
  removeAtExit(part);
  return part;
}

/** @param {string} path */
async function isFolder(path) {
  return (await stat(path).catch(() => null))?.isDirectory() ?? false;
}

/** @param {string} line */
function tell(line) {
  process.stderr.write(`${line}\n`);
}
