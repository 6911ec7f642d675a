import { chmodSync, mkdirSync, mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { delimiter, join } from "node:path";
import { afterAll, beforeAll, expect, it } from "vitest";
import { firstLine } from "./errors.mjs";
import { chromiumIn, ffmpegIn, inPath } from "./programs.mjs";

let root = "";
/** @param {string[]} names */
const path = (...names) => names.map((name) => join(root, name)).join(delimiter);

beforeAll(() => {
  root = mkdtempSync(join(tmpdir(), "programs-"));
  for (const folder of ["a", "b"]) mkdirSync(join(root, folder));
  for (const name of ["a/google-chrome", "b/chromium", "b/ffmpeg"]) {
    writeFileSync(join(root, name), "");
    chmodSync(join(root, name), 0o755);
  }
  writeFileSync(join(root, "a/chromium"), "not to be run", { mode: 0o644 });
  mkdirSync(join(root, "a/ffmpeg"));
});

afterAll(() => rmSync(root, { recursive: true }));

it("finds the first executable name in PATH", () => {
  expect(chromiumIn({ PATH: path("a", "b") })).toBe(join(root, "b/chromium"));
  expect(chromiumIn({ PATH: path("a") })).toBe(join(root, "a/google-chrome"));
  expect(ffmpegIn({ PATH: path("a", "b") })).toBe(join(root, "b/ffmpeg"));
  expect(inPath(["chromium"], {})).toBeNull();
});

it("uses the browser in MAES_CHROMIUM", () => {
  const named = join(root, "a/google-chrome");
  expect(chromiumIn({ PATH: path("b"), MAES_CHROMIUM: named })).toBe(named);
  expect(() => chromiumIn({ PATH: path("b"), MAES_CHROMIUM: "/nowhere" })).toThrow(
    "MAES_CHROMIUM is /nowhere, which is not an executable",
  );
});

it("reports what is missing", () => {
  expect(() => chromiumIn({ PATH: "" })).toThrow(
    "Chromium is missing: apt install chromium, or set MAES_CHROMIUM",
  );
  expect(() => ffmpegIn({ PATH: path("a") })).toThrow("ffmpeg is missing: apt install ffmpeg");
});

it("shortens errors to one line", () => {
  expect(firstLine(new Error("page.goto: net::ERR_FAILED at http://a\nCall log:\n  - x"))).toBe(
    "net::ERR_FAILED at http://a",
  );
  expect(firstLine("plain: words")).toBe("plain: words");
});
