#!/usr/bin/env node
/**
 * Benchmark of the page in a real Chromium: time to the first frame of a recording and of seeks
 * (any frame, and a full one), frame rate of a live run, the slowdown of the run by its observer,
 * and the memory that a large map takes.
 *
 *     node bench/bench.mjs [recording] [run] [memory] [--rounds N] [--seconds S]
 *
 * in the folder viewer, with the page of MAES_PAGE or dist (npm run build) and the binaries of
 * MAES_BIN_DIR or ../target/release. Prints one line of JSON per measurement, and medians at the
 * end. Uses the GPU if `MAES_GPU=1`; otherwise rendering is done in software.
 */
/* global window, setTimeout -- inside the page */
import { spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join, resolve } from "node:path";
import { performance } from "node:perf_hooks";
import process from "node:process";
import { createInterface } from "node:readline";
import { clearInterval, setInterval } from "node:timers";
import { chromium } from "@playwright/test";
import { chromiumIn } from "../pictures/programs.mjs";
import { increase, memoryOf } from "./memory.mjs";

const root = resolve(import.meta.dirname, "../..");
const binaries = process.env["MAES_BIN_DIR"] ?? join(root, "target/release");
const page = resolve(process.env["MAES_PAGE"] ?? join(root, "viewer/dist"));
const option = (name, fallback) => {
  const at = process.argv.indexOf(name);
  return at < 0 ? fallback : Number(process.argv[at + 1]);
};
const rounds = option("--rounds", 3);
const seconds = option("--seconds", 300);
const subjects = process.argv.slice(2).filter((word) => ["recording", "run", "memory"].includes(word));
const isAsked = (subject) => subjects.length === 0 || subjects.includes(subject);
const folder = mkdtempSync(join(tmpdir(), "maes-bench-"));
const environment = {
  ...process.env,
  ROS_DOMAIN_ID: "29",
  ROS_AUTOMATIC_DISCOVERY_RANGE: "LOCALHOST",
  MAES_BIN_DIR: binaries,
};
const software = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"];
const flags = ["--no-sandbox", ...(process.env["MAES_GPU"] === "1" ? [] : software)];

/** A child process and the lines of its output. */
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
  const prints = (pattern) =>
    new Promise((found, failed) => {
      const check = () => {
        const match = lines.map((line) => line.match(pattern)).find(Boolean);
        if (!match) return;
        waiting.delete(check);
        found(match[1] ?? match[0]);
      };
      waiting.add(check);
      check();
      void ended.then(() =>
        failed(new Error(`${program} has ended without saying ${pattern}:\n${lines.join("\n")}`)),
      );
    });
  return { child, lines, ended, prints };
}

/** Serves a recording, and the page. */
const serve = (file) =>
  start(join(binaries, "maes"), [
    "view",
    file,
    "--browser",
    "false",
    "--address",
    "127.0.0.1:0",
    "--page",
    page,
  ]);

const median = (values) => [...values].sort((a, b) => a - b)[Math.floor(values.length / 2)];
const report = (what, values) => process.stdout.write(`${JSON.stringify({ what, ...values })}\n`);

/** A run at 10 times real time, observed or not: wall time of its ticks, and frame rate. */
async function run(isObserved) {
  const scenario = join(root, "launch_scripts/scenarios/default.toml");
  const words = `--size 100 --seed 3 --agents 20 --rtf 10 --duration ${seconds}`.split(" ");
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
  const server = start(join(binaries, "sim_server"), ["run", scenario, ...words, ...shown]);
  const address = await server.prints(/(http:\/\/\S+)/);
  const agents = Array.from({ length: 20 }, (_, id) =>
    start(join(binaries, "agent_node"), ["--id", String(id)]),
  );
  await server.prints(/all 20 agents/);
  const browser = await chromium.launch({ executablePath: chromiumIn(process.env), args: flags });
  try {
    const tab = await browser.newPage({ viewport: { width: 1280, height: 720 } });
    await tab.goto(address);
    await tab.waitForFunction(() => window.maes?.run, null, { timeout: 60_000 });
    await tab.evaluate(() => {
      const { scene } = window.maes;
      const render = scene.render.bind(scene);
      window.drawn = 0;
      scene.render = (...words) => {
        render(...words);
        window.drawn += 1;
      };
    });
    const begun = performance.now();
    await tab.getByTestId("sim-play").click();
    if (!isObserved) await tab.goto("about:blank");
    const digest = await server.prints(/^digest: (\w+)/);
    const wallS = (performance.now() - begun) / 1000;
    const drawn = isObserved ? await tab.evaluate(() => window.drawn) : 0;
    return { wallS, digest, fps: drawn / wallS };
  } finally {
    await browser.close();
    await Promise.all([server, ...agents].map(({ ended }) => ended));
  }
}

/**
 * Executed in the page before its scripts: `window.finishedFrames` collects the frames that the GPU has finished and in
 * which nothing is missing, with their sim time, whether they are in full quality, and the wall
 * time (milliseconds since 1970).
 */
function watchFrames() {
  window.finishedFrames = [];
  const watch = (scene) => {
    const gl = scene.canvas.getContext("webgl2");
    const render = scene.render.bind(scene);
    scene.render = (timeS, quality) => {
      render(timeS, quality);
      if (scene.needsRedraw) return;
      const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
      gl.flush();
      const check = () => {
        if (gl.getSyncParameter(fence, gl.SYNC_STATUS) !== gl.SIGNALED) return void setTimeout(check, 3);
        window.finishedFrames.push({
          timeS,
          isFull: !quality.isCoarse && quality.share === 1,
          atMs: Date.now(),
        });
      };
      check();
    };
  };
  // The page sets its handle before it draws; while it is being loaded, the handle has no scene.
  let handle;
  Object.defineProperty(window, "maes", {
    get: () => handle,
    set: (given) => {
      handle = given;
      if (given.scene) watch(given.scene);
    },
  });
}

/**
 * Time from a moment to the first frame at the requested time, and to the first one in full
 * quality; seconds.
 */
async function framesAfter(tab, sinceMs) {
  const first = async (isFull) => {
    const found = await tab.waitForFunction(
      ([isFull, sinceMs]) => {
        const { run, state } = window.maes;
        return window.finishedFrames.find(
          (one) => run && one.atMs >= sinceMs && one.timeS === state.timeS && (one.isFull || !isFull),
        );
      },
      [isFull, sinceMs],
      { timeout: 60_000 },
    );
    return ((await found.jsonValue()).atMs - sinceMs) / 1000;
  };
  return { anyS: await first(false), fullS: await first(true) };
}

/** Half an hour of ten agents from disk: the first frame, reading to the end, and seeks. */
async function recording(file) {
  const server = serve(file);
  const address = await server.prints(/(http:\/\/\S+)/);
  const browser = await chromium.launch({ executablePath: chromiumIn(process.env), args: flags });
  try {
    const tab = await browser.newPage({ viewport: { width: 1280, height: 720 } });
    await tab.addInitScript(watchFrames);
    const begunMs = Date.now();
    await tab.goto(address);
    const begin = await framesAfter(tab, begunMs);
    const readMs = await tab.waitForFunction(() => window.maes.run.isComplete && Date.now(), null, {
      timeout: 60_000,
    });
    const line = await tab.getByTestId("timeline").boundingBox();
    const seeks = [];
    for (const share of [0.5, 0.05, 0.95, 0.02, 0.1, 0.3]) {
      const soughtMs = Date.now();
      await tab.mouse.click(line.x + share * line.width, line.y + line.height / 2);
      seeks.push(await framesAfter(tab, soughtMs));
    }
    return {
      firstFrameS: begin.anyS,
      firstFullFrameS: begin.fullS,
      readS: ((await readMs.jsonValue()) - begunMs) / 1000,
      firstSeekS: seeks[0].anyS,
      seekS: Math.max(...seeks.map((seek) => seek.anyS)),
      seekFullS: Math.max(...seeks.map((seek) => seek.fullS)),
    };
  } finally {
    await browser.close();
    server.child.kill();
    await server.ended;
  }
}

/**
 * What a map of 512^3 cells takes more than an empty page, in full resolution: at most while it is
 * opened, and then at rest.
 */
async function memory(file) {
  const server = serve(file);
  const address = await server.prints(/(http:\/\/\S+)/);
  const browserServer = await chromium.launchServer({
    executablePath: chromiumIn(process.env),
    args: flags,
  });
  const browser = await chromium.connect(browserServer.wsEndpoint());
  try {
    const tab = await browser.newPage({ viewport: { width: 1280, height: 720 } });
    const measure = () => memoryOf(browserServer.process().pid);
    await settled(measure);
    const empty = measure();
    let most = empty;
    const timer = setInterval(() => {
      const now = measure();
      if (now.allMB > most.allMB) most = now;
    }, 50);
    await tab.goto(address);
    await tab.evaluate(() => window.maes.ready);
    await tab.waitForFunction(() => window.maes.run.isComplete, null, { timeout: 60_000 });
    await tab.evaluate(() => window.maes.showAt(20));
    const atRest = await settled(measure);
    clearInterval(timer);
    return { ...increase(atRest, empty), mostMB: increase(most, empty).allMB };
  } finally {
    await browser.close();
    await browserServer.close();
    server.child.kill();
    await server.ended;
  }
}

/** The memory once it has stayed the same, to 2 MB, for a second. */
async function settled(measure) {
  for (let last = measure(), same = 0; ;) {
    await new Promise((done) => setTimeout(done, 200));
    const now = measure();
    same = Math.abs(now.allMB - last.allMB) < 2 ? same + 1 : 0;
    if (same === 0) last = now;
    if (same === 5) return now;
  }
}

/** Records a run. */
async function record(name, words) {
  const file = join(folder, name);
  const made = start(join(root, "launch_scripts/run.sh"), [
    ...words,
    "--transport",
    "memory",
    "--record",
    file,
  ]);
  await made.ended;
  return file;
}

/** Ten agents for half an hour. */
function recordHalfHour() {
  const words = "--agents 10 --controller dsvp --size 100 --seed 2 --duration 1800";
  return record("half_an_hour.mcap", [...words.split(" "), "--set", "stop_when_explored=false"]);
}

/** The first half minute of 512^3 cells. */
function recordLarge() {
  return record("large.mcap", [join(root, "launch_scripts/scenarios/large.toml"), "--duration", "30"]);
}

const recordings = [];
const memories = [];
const alone = [];
const observed = [];
try {
  const file = isAsked("recording") ? await recordHalfHour() : "";
  const large = isAsked("memory") ? await recordLarge() : "";
  for (let round = 0; round < rounds; round += 1) {
    if (isAsked("recording")) {
      recordings.push(await recording(file));
      report("recording", recordings.at(-1));
    }
    if (isAsked("memory")) {
      memories.push(await memory(large));
      report("memory of a large map", memories.at(-1));
    }
    if (isAsked("run")) {
      alone.push(await run(false));
      report("run without observer", alone.at(-1));
      observed.push(await run(true));
      report("run with observer", observed.at(-1));
    }
  }
} finally {
  rmSync(folder, { recursive: true });
}
for (const [subject, measured] of [
  ["recordings", recordings],
  ["memory of a large map", memories],
]) {
  if (measured.length === 0) continue;
  const names = Object.keys(measured[0]);
  const medians = names.map((name) => [name, median(measured.map((one) => one[name]))]);
  report(`medians of ${subject}`, Object.fromEntries(medians));
}
if (isAsked("run")) {
  report("medians of runs", {
    fps: median(observed.map((one) => one.fps)),
    wallRatio: median(observed.map((one, round) => one.wallS / alone[round].wallS)),
    digests: new Set([...alone, ...observed].map((one) => one.digest)).size,
  });
}
