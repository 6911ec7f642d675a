/** The recordings that `setup.ts` has made. */
import { join } from "node:path";

/** The variable of the environment that names their folder. */
export const FOLDER = "MAES_TEST_RECORDINGS";

/** `cave`: five agents until all is explored; `radio`: two minutes with a limited radio range; `hall`: half a minute of a larger cave. */
export function recording(name: "cave" | "radio" | "hall"): string {
  return join(temporaryFolder(), `${name}.mcap`);
}

/** A folder for files of tests, removed after the last one. */
export function temporaryFolder(): string {
  const folder = process.env[FOLDER];
  if (folder === undefined)
    throw new Error(`${FOLDER} is not set: the tests are run by "npx playwright test"`);
  return folder;
}
