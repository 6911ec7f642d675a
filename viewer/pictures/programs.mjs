/** Finds the programs that capturing needs. */
import { accessSync, constants, statSync } from "node:fs";
import { delimiter, join } from "node:path";
import { CaptureError } from "./errors.mjs";

const CHROMIUM_NAMES = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];

/** @typedef {Readonly<Record<string, string | undefined>>} Environment */

/**
 * The browser: `MAES_CHROMIUM`, else the first candidate in PATH.
 * @param {Environment} environment
 */
export function chromiumIn(environment) {
  const named = environment["MAES_CHROMIUM"];
  if (named) {
    if (!isProgram(named)) throw new CaptureError(`MAES_CHROMIUM is ${named}, which is not an executable`);
    return named;
  }
  const found = inPath(CHROMIUM_NAMES, environment);
  if (found === null)
    throw new CaptureError("Chromium is missing: apt install chromium, or set MAES_CHROMIUM");
  return found;
}

/** @param {Environment} environment */
export function ffmpegIn(environment) {
  const found = inPath(["ffmpeg"], environment);
  if (found === null) throw new CaptureError("ffmpeg is missing: apt install ffmpeg");
  return found;
}

/**
 * The first of these names in PATH.
 * @param {readonly string[]} names
 * @param {Environment} environment
 * @returns {string | null}
 */
export function inPath(names, environment) {
  const folders = (environment["PATH"] ?? "").split(delimiter).filter(Boolean);
  for (const name of names) {
    const found = folders.map((folder) => join(folder, name)).find(isProgram);
    if (found !== undefined) return found;
  }
  return null;
}

/** @param {string} path */
function isProgram(path) {
  try {
    accessSync(path, constants.X_OK);
    return statSync(path).isFile();
  } catch {
    return false;
  }
}
