import { defineConfig } from "vitest/config";

export default defineConfig({
  // The page may lie in any folder of a server.
  base: "./",
  build: { target: "es2022", sourcemap: false },
  worker: { format: "es" },
  // What lies in `tests` is for Playwright.
  test: { include: ["{src,pictures}/**/*.test.{ts,mjs}"] },
});
