/**
 * End-to-end tests: the built page in a real browser, with real recordings and simulators.
 *
 * They need `npm run build` before, and the binaries of the workspace (see
 * `tests/support/paths.ts`). Rendering is done in software, so that images are the same on every
 * machine. There is one worker and no retry: a failure is a defect.
 */
import { defineConfig } from "@playwright/test";
import { chromiumIn } from "./pictures/programs.mjs";

export default defineConfig({
  testDir: "tests",
  globalSetup: "./tests/support/setup.ts",
  outputDir: "test-results",
  reporter: [["list"]],
  workers: 1,
  fullyParallel: false,
  retries: 0,
  forbidOnly: true,
  // They only turn hangs into failures.
  timeout: 120_000,
  expect: { timeout: 60_000 },
  use: {
    viewport: { width: 960, height: 600 },
    // Recordings do not play by themselves then.
    contextOptions: { reducedMotion: "reduce" },
    actionTimeout: 60_000,
    navigationTimeout: 60_000,
    screenshot: "only-on-failure",
    launchOptions: {
      executablePath: chromiumIn(process.env),
      args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
    },
  },
});
