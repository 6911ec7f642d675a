/**
 * Tests of the whole: the built page in a real browser, with real recordings and real simulators.
 *
 * They need `npm run build` before, and `sim_server`, `agent_node` and `experiments` (see `tests/support/places.ts`). A browser without
 * graphics hardware draws the pictures, so that they are the same on every machine. There is one worker and no second try: a
 * failure is a fault.
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
    actionTimeout: 60_000,
    navigationTimeout: 60_000,
    screenshot: "only-on-failure",
    launchOptions: {
      executablePath: chromiumIn(process.env),
      args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
    },
  },
});
