#!/usr/bin/env node
/**
 * Time from the command `maes view FILE` to its first picture, in a Chromium that is open already:
 *
 *     node bench/first-picture.mjs MAES FILE
 *
 * Prints seconds. Rendering is done in software.
 */
/* global window -- inside the page */
import { spawn } from "node:child_process";
import { performance } from "node:perf_hooks";
import process from "node:process";
import { createInterface } from "node:readline";
import { chromium } from "playwright-core";
import { chromiumIn } from "../pictures/programs.mjs";

const [maes = "maes", file = "run.mcap"] = process.argv.slice(2);
const browser = await chromium.launch({
  executablePath: chromiumIn(process.env),
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({ viewport: { width: 1280, height: 720 } });
page.setDefaultTimeout(0);
const begunMs = performance.now();
const server = spawn(maes, ["view", file, "--address", "127.0.0.1:0", "--browser", "false"], {
  stdio: ["ignore", "pipe", "inherit"],
});
try {
  const [url] = await new Promise((found, failed) => {
    createInterface({ input: server.stdout }).on("line", (line) => {
      const address = /^http:\S+/.exec(line);
      if (address) found(address);
    });
    server.on("close", (code) => failed(new Error(`${maes} view has ended with ${code}`)));
    server.on("error", failed);
  });
  await page.goto(url);
  await page.evaluate(() => window.maes.ready);
  process.stdout.write(`${((performance.now() - begunMs) / 1000).toFixed(2)}\n`);
} finally {
  server.kill("SIGINT");
  await browser.close();
}
