/**
 * Paths of the test inputs: binaries, the built page, scenarios.
 *
 * `MAES_BIN_DIR` is the folder of the binaries (default: the release build of the workspace),
 * `MAES_PAGE` that of the built page (default: `dist`).
 */
import { join, resolve } from "node:path";

const VIEWER = resolve(import.meta.dirname, "../..");

const BIN_DIR = resolve(process.env["MAES_BIN_DIR"] ?? join(VIEWER, "../target/release"));

/** The built page. */
export const PAGE = resolve(process.env["MAES_PAGE"] ?? join(VIEWER, "dist"));

/** The default scenario: five agents, a cave of 50 cells along each axis. */
export const SCENARIO = join(VIEWER, "../launch_scripts/scenarios/default.toml");

/** The token of all servers of these tests. */
const TOKEN = "the-token-of-the-page-tests";

/** The address of a page with another query, and the token. */
export function addressWith(url: string, query: Readonly<Record<string, string>>): string {
  return new URL(`/?${new URLSearchParams({ token: TOKEN, ...query }).toString()}`, url).href;
}

export function binary(name: "maes" | "sim_server" | "agent_node"): string {
  return join(BIN_DIR, name);
}

/** The script that executes a complete run. */
export const RUN_SCRIPT = join(VIEWER, "../launch_scripts/run.sh");

/** Environment of child processes, in the ROS domain of the caller, or else one of this worker. */
export function environment(worker: number): NodeJS.ProcessEnv {
  return {
    ...process.env,
    MAES_BIN_DIR: BIN_DIR,
    ROS_DOMAIN_ID: process.env["ROS_DOMAIN_ID"] ?? String(90 + worker),
    ROS_AUTOMATIC_DISCOVERY_RANGE: "LOCALHOST",
    // A server that is started again at the same address has the same token.
    MAES_VIEW_TOKEN: TOKEN,
  };
}
