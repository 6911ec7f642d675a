import { defineConfig } from "vitest/config";

export default defineConfig({
  // Relative, so that the page can be served from any folder.
  base: "./",
  // Three.js is most of the bundle, and needed for the first frame.
  build: { target: "es2022", sourcemap: false, chunkSizeWarningLimit: 1000 },
  worker: { format: "es" },
  // `tests` belongs to Playwright.
  // The time limit only turns hangs into failures, also on a busy machine.
  test: { include: ["{src,pictures}/**/*.test.{ts,mjs}"], testTimeout: 120_000 },
});
