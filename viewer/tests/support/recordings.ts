/** The recordings made by `setup.ts`. */
import { join } from "node:path";

/** Environment variable with their folder. */
export const FOLDER = "MAES_TEST_RECORDINGS";

/**
 * `cave`: five agents until all is explored; `radio`: two minutes with a limited radio range;
 * `hall`: half a minute of a larger cave.
 */
export function recording(name: "cave" | "radio" | "hall"): string {
  return join(temporaryFolder(), `${name}.mcap`);
}

/** Temporary folder of the test run, removed at its end. */
export function temporaryFolder(): string {
  const folder = process.env[FOLDER];
  if (folder === undefined)
    throw new Error(`${FOLDER} is not set: the tests are run by "npx playwright test"`);
  return folder;
}
