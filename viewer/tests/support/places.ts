/**
 * Where the things are that the tests need and do not make: the binaries, the browser, the built page, scenarios.
 *
 * `MAES_BIN_DIR` names the folder of the binaries (default: those of a release build of the workspace), `MAES_CHROMIUM` a browser
 * (default: the first Chromium in the path), `MAES_PAGE` the folder of the built page (default: `dist`).
 */
import { accessSync, constants } from "node:fs";
import { delimiter, join, resolve } from "node:path";

const VIEWER = resolve(import.meta.dirname, "../..");

const BIN_DIR = resolve(process.env["MAES_BIN_DIR"] ?? join(VIEWER, "../target/release"));

/** The built page. */
export const PAGE = resolve(process.env["MAES_PAGE"] ?? join(VIEWER, "dist"));

/** The scenario that tests begin with: five agents, a cave of 50 cells along each axis. */
export const SCENARIO = join(VIEWER, "../launch_scripts/scenarios/default.toml");

export function binary(name: "sim_server" | "agent_node"): string {
  return join(BIN_DIR, name);
}

/** The script that carries out a run with one command. */
export const RUN_SCRIPT = join(VIEWER, "../launch_scripts/run.sh");

/** The environment of programs, in a ROS domain that is this worker's. */
export function environment(worker: number): NodeJS.ProcessEnv {
  return {
    ...process.env,
    MAES_BIN_DIR: BIN_DIR,
    ROS_DOMAIN_ID: String(90 + worker),
    ROS_AUTOMATIC_DISCOVERY_RANGE: "LOCALHOST",
  };
}

export function chromiumPath(): string {
  const named = process.env["MAES_CHROMIUM"];
  if (named) return named;
  const names = ["chromium", "chromium-browser", "google-chrome"];
  const folders = (process.env["PATH"] ?? "").split(delimiter);
  const found = names.flatMap((name) => folders.map((folder) => join(folder, name))).find(isExecutable);
  if (!found)
    throw new Error(`No browser: none of ${names.join(", ")} is in PATH; name one in MAES_CHROMIUM`);
  return found;
}

function isExecutable(path: string): boolean {
  try {
    accessSync(path, constants.X_OK);
    return true;
  } catch {
    return false;
  }
}
