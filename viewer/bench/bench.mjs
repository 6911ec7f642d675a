#!/usr/bin/env node
/**
 * What looking on costs and gives, measured in a real Chromium: the first picture of a recording, seeks, pictures per second of a run under
 * way, and how much longer that run takes than one that nobody looks at.
 *
 *   node bench/bench.mjs [--rounds N] [--seconds S]      in the folder viewer; binaries of MAES_BIN_DIR or ../target/release
 *
 * Prints one line of JSON for each measurement, and medians at the end. The machine's graphics are used if `MAES_GPU=1`; otherwise
 * everything is drawn in software.
 */
/* global window -- inside the page */
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { performance } from "node:perf_hooks";
import process from "node:process";
import { createInterface } from "node:readline";
import { chromium } from "@playwright/test";
import { chromiumIn } from "../pictures/programs.mjs";

const root = resolve(import.meta.dirname, "../..");
const binaries = process.env["MAES_BIN_DIR"] ?? join(root, "target/release");
const page = join(root, "viewer/dist");
const option = (name, fallback) => {
  const at = process.argv.indexOf(name);
  return at < 0 ? fallback : Number(process.argv[at + 1]);
};
const rounds = option("--rounds", 3);
const seconds = option("--seconds", 300);
const folder = mkdtempSync(join(tmpdir(), "maes-bench-"));
const environment = {
  ...process.env,
  ROS_DOMAIN_ID: "29",
  ROS_AUTOMATIC_DISCOVERY_RANGE: "LOCALHOST",
  MAES_BIN_DIR: binaries,
};
const software = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const flags = ["--no-sandbox", ...(process.env["MAES_GPU"] === "1" ? [] : software)];

/** A process, with the lines that it says on stderr and stdout. */
function start(program, words) {
  const child = spawn(program, words, { env: environment, cwd: folder });
  const lines = [];
  const waiting = new Set();
  for (const stream of [child.stdout, child.stderr]) {
    createInterface({ input: stream }).on("line", (line) => {
      lines.push(line);
      for (const wait of [...waiting]) wait();
    });
  }
  const ended = new Promise((done) => child.on("close", done));
  const says = (pattern) =>
    new Promise((found, failed) => {
      const look = () => {
        const match = lines.map((line) => line.match(pattern)).find(Boolean);
        if (!match) return;
        waiting.delete(look);
        found(match[1] ?? match[0]);
      };
      waiting.add(look);
      look();
      void ended.then(() =>
        failed(new Error(`${program} has ended without saying ${pattern}:\n${lines.join("\n")}`)),
      );
    });
  return { child, lines, ended, says };
}

const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
const tell = (what, values) => process.stdout.write(`${JSON.stringify({ what, ...values })}\n`);

/** A run at 10 times real time, looked at or not: wall seconds of its ticks, and pictures per second. */
async function run(isLookedAt) {
  const scenario = join(root, "launch_scripts/scenarios/default.toml");
  const words = [
    "run",
    scenario,
    "--size",
    "100",
    "--seed",
    "3",
    "--agents",
    "20",
    "--rtf",
    "10",
    "--duration",
    String(seconds),
  ];
  const shown = [
    "--view",
    "127.0.0.1:0",
    "--page",
    page,
    "--paused",
    "true",
    "--set",
    "stop_when_explored=false",
  ];
  const server = start(join(binaries, "sim_server"), [...words, ...shown]);
  const address = await server.says(/to look on: (http:\/\/\S+)/);
  const agents = Array.from({ length: 20 }, (_, id) =>
    start(join(binaries, "agent_node"), ["--id", String(id)]),
  );
  await server.says(/all 20 agents are there/);
  const browser = await chromium.launch({ executablePath: chromiumIn(process.env), args: flags });
  try {
    const tab = await browser.newPage({ viewport: { width: 1280, height: 720 } });
    await tab.goto(address);
    await tab.waitForFunction(() => window.maes?.run, null, { timeout: 60_000 });
    await tab.evaluate(() => {
      const { scene } = window.maes;
      const render = scene.render.bind(scene);
      window.drawn = [];
      scene.render = (timeS) => {
        render(timeS);
        window.drawn.push(performance.now());
      };
    });
    const begun = performance.now();
    await tab.getByTestId("sim-play").click();
    if (!isLookedAt) await tab.goto("about:blank");
    const digest = await server.says(/^digest: (\w+)/);
    const wallS = (performance.now() - begun) / 1000;
    const drawn = isLookedAt ? await tab.evaluate(() => window.drawn) : [];
    return { wallS, digest, fps: drawn.length / wallS };
  } finally {
    await browser.close();
    await Promise.all([server, ...agents].map(({ ended }) => ended));
  }
}

/** Half an hour of ten agents from disk: until there is a picture, until all is read, and seeks all over it. */
async function recording(file) {
  const server = start(join(binaries, "sim_server"), [
    "view",
    file,
    "--address",
    "127.0.0.1:0",
    "--page",
    page,
  ]);
  const address = await server.says(/(http:\/\/\S+)/);
  const browser = await chromium.launch({ executablePath: chromiumIn(process.env), args: flags });
  try {
    const tab = await browser.newPage({ viewport: { width: 1280, height: 720 } });
    const begun = performance.now();
    await tab.goto(address);
    await tab.waitForFunction(() => window.maes?.run, null, { timeout: 60_000 });
    await tab.evaluate(() => window.maes.ready);
    const firstPictureS = (performance.now() - begun) / 1000;
    await tab.waitForFunction(() => window.maes.run.isComplete, null, { timeout: 60_000 });
    const allReadS = (performance.now() - begun) / 1000;
    const seeksS = await tab.evaluate(async () => {
      const { run } = window.maes;
      const taken = [];
      for (const share of [0.5, 0.05, 0.95, 0.02, 0.1, 0.3]) {
        const from = performance.now();
        await window.maes.showAt(share * run.endS);
        taken.push((performance.now() - from) / 1000);
      }
      return taken;
    });
    return { firstPictureS, allReadS, seekS: Math.max(...seeksS) };
  } finally {
    await browser.close();
    server.child.kill();
    await server.ended;
  }
}

const file = join(folder, "half_an_hour.mcap");
const made = start(join(root, "launch_scripts/run.sh"), [
  ...[
    "--transport",
    "memory",
    "--agents",
    "10",
    "--controller",
    "dsvp",
    "--size",
    "100",
    "--seed",
    "2",
    "--duration",
    "1800",
  ],
  ...["--set", "stop_when_explored=false", "--record", file],
]);
await made.ended;
const recordings = [];
const alone = [];
const watched = [];
try {
  for (let round = 0; round < rounds; round += 1) {
    recordings.push(await recording(file));
    tell("recording", recordings.at(-1));
    alone.push(await run(false));
    tell("run that nobody looks at", alone.at(-1));
    watched.push(await run(true));
    tell("run that is looked at", watched.at(-1));
  }
} finally {
  rmSync(folder, { recursive: true });
}
tell("medians", {
  firstPictureS: median(recordings.map((one) => one.firstPictureS)),
  allReadS: median(recordings.map((one) => one.allReadS)),
  seekS: median(recordings.map((one) => one.seekS)),
  fps: median(watched.map((one) => one.fps)),
  wallRatio: median(watched.map((one, round) => one.wallS / alone[round].wallS)),
  digests: new Set([...alone, ...watched].map((one) => one.digest)).size,
});
