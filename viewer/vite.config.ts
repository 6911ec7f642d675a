import { defineConfig } from "vitest/config";

export default defineConfig({
  // The page may lie in any folder of a server.
  base: "./",
  // Three.js is most of it, and needed from the first picture on.
  build: { target: "es2022", sourcemap: false, chunkSizeWarningLimit: 1000 },
  worker: { format: "es" },
  // What lies in `tests` is for Playwright.
  test: { include: ["{src,pictures}/**/*.test.{ts,mjs}"] },
});
