/**
 * Global setup: makes the recordings, with in-memory runs, in a folder that is removed afterwards.
 */
import { mkdtempSync, rmSync, existsSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { environment, PAGE, RUN_SCRIPT, SCENARIO } from "./paths.ts";
import { outputOf } from "./programs.ts";
import { FOLDER } from "./recordings.ts";

export default async function setup(): Promise<() => void> {
  if (!existsSync(join(PAGE, "index.html"))) {
    throw new Error(`${PAGE} has no index.html: build the page with "npm run build" first`);
  }
  const folder = mkdtempSync(join(tmpdir(), "maes-viewer-"));
  process.env[FOLDER] = folder;
  const record = (name: string, ...flags: string[]): Promise<string> =>
    outputOf(
      RUN_SCRIPT,
      [SCENARIO, "--transport", "memory", "--record", join(folder, name), ...flags],
      environment(0),
    );
  const remove = (): void => rmSync(folder, { recursive: true });
  try {
    // With all poses recorded, covered cells need no interpolation.
    await record("cave.mcap", "--set", "recording.poses_period_ticks=1");
    // Agents are in contact at times, and lvd has a status text.
    await record(
      "radio.mcap",
      "--controller",
      "lvd",
      "--duration",
      "120",
      "--set",
      "communication.range_m=15",
    );
    await record("hall.mcap", "--size", "72", "--duration", "30");
  } catch (error) {
    remove();
    throw error;
  }
  return remove;
}
