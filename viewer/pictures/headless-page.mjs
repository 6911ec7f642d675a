/**
 * The page with a recording in a headless browser, which renders and captures exact times.
 *
 * Rendering is done in software, so that a recording gives the same image on every machine with the
 * same browser and fonts. Images are captured only when they are complete, with one pixel per CSS
 * pixel.
 */
/* global document, requestAnimationFrame, setTimeout, window */
import { Buffer } from "node:buffer";
import { existsSync } from "node:fs";
import { join } from "node:path";
import process from "node:process";
import { CaptureError, firstLine, InvalidRequest } from "./errors.mjs";

/**
 * @typedef {import("./request.mjs").CaptureRequest} CaptureRequest
 * @typedef {import("./request.mjs").RecordingFacts} RecordingFacts
 */

export class HeadlessPage {
  /** @type {import("playwright-core").Browser} */
  #browser;
  /** @type {import("playwright-core").Page} */
  #page;
  /** @type {import("playwright-core").CDPSession} */
  #devtools;

  /**
   * @param {import("playwright-core").Browser} browser
   * @param {import("playwright-core").Page} page
   * @param {import("playwright-core").CDPSession} devtools
   */
  constructor(browser, page, devtools) {
    this.#browser = browser;
    this.#page = page;
    this.#devtools = devtools;
  }

  /**
   * Starts the browser and opens the page.
   * @param {string} chromium
   * @param {Pick<CaptureRequest, "url" | "size" | "agent">} request
   */
  static async open(chromium, request) {
    const browser = await launch(chromium);
    const [width, height] = request.size;
    const context = await browser.newContext({ viewport: { width, height }, deviceScaleFactor: 1 });
    const page = await context.newPage();
    const devtools = await context.newCDPSession(page);
    // Reading and rendering have no time limit.
    page.setDefaultTimeout(0);
    page.setDefaultNavigationTimeout(0);
    const address = addressOf(request);
    const answer = await page.goto(address).catch((error) => {
      throw new CaptureError(`${address} cannot be opened: ${firstLine(error)}`);
    });
    if (!answer?.ok())
      throw new CaptureError(`${address} cannot be opened: the server answers ${answer?.status()}`);
    return new HeadlessPage(browser, page, devtools);
  }

  /**
   * Resolves when the recording has been read, as far as it can be.
   * @returns {Promise<RecordingFacts & { problem: string | null }>}
   */
  async read() {
    const recording = await this.#page.evaluate(readWhole);
    if ("refusal" in recording) throw new InvalidRequest(recording.refusal);
    if ("failure" in recording) throw new CaptureError(recording.failure);
    return recording;
  }

  /**
   * Sets the layers, the cut, the background and the camera: behind the agent at this time, or on
   * the whole cave.
   * @param {Pick<CaptureRequest, "agent" | "layers" | "cut" | "camera" | "background">} request
   * @param {number} timeS
   */
  async arrange({ agent, layers, cut, camera, background }, timeS) {
    await this.#page.evaluate(arrange, { agent, layers, cut, camera, background, timeS });
  }

  /**
   * The image at a time, a PNG.
   * @param {number} timeS
   * @param {{ isQuick: boolean }} options `isQuick`: faster, weaker compression of the same pixels.
   * @returns {Promise<Uint8Array>}
   */
  async take(timeS, { isQuick }) {
    const problem = await this.#page.evaluate(draw, timeS);
    if (problem !== null) throw new CaptureError(problem);
    const { data } = await this.#devtools.send("Page.captureScreenshot", {
      format: "png",
      optimizeForSpeed: isQuick,
    });
    return Buffer.from(data, "base64");
  }

  async close() {
    await this.#browser.close();
  }
}

/** @param {string} chromium */
async function launch(chromium) {
  const isRoot = process.getuid?.() === 0;
  try {
    return await (
      await browserType()
    ).launch({
      executablePath: chromium,
      // Chromium refuses to run as root with the sandbox.
      chromiumSandbox: !isRoot,
      args: ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-lcd-text"],
      // Signals are handled by `cleanup.mjs`.
      handleSIGHUP: false,
      handleSIGINT: false,
      handleSIGTERM: false,
    });
  } catch (error) {
    if (error instanceof CaptureError) throw error;
    throw new CaptureError(`${chromium} cannot be started: ${reasonOf(error)}`);
  }
}

async function browserType() {
  try {
    return (await import("playwright-core")).chromium;
  } catch {
    // A checkout pins the version; the files of a release have no list of packages.
    const viewer = join(import.meta.dirname, "..");
    const install = existsSync(join(viewer, "package-lock.json"))
      ? "npm ci"
      : "npm install --no-save --prefix . playwright-core";
    throw new CaptureError(`playwright-core is missing: run \`${install}\` in ${viewer}`);
  }
}

/**
 * The error message of a browser that failed to start, if it printed one.
 * @param {unknown} error
 */
function reasonOf(error) {
  const printed = /\[pid=\d+\]\[err\]\s*(.*(?:FATAL|ERROR|error).*)/.exec(
    error instanceof Error ? error.message : "",
  );
  if (printed?.[1] !== undefined) return printed[1];
  const line = firstLine(error);
  return line.includes("has been closed") ? "it exited at once" : line;
}

/** @param {Pick<CaptureRequest, "url" | "agent">} request */
function addressOf({ url, agent }) {
  const address = new globalThis.URL(url);
  address.searchParams.set("picture", "1");
  if (agent !== null) address.searchParams.set("agent", String(agent));
  return address.href;
}

// ---------------------------------------------------------------- in the page
// These functions are sent to the page as text: they cannot refer to this file.

/**
 * @returns {Promise<(RecordingFacts & { problem: string | null }) | { refusal: string }
 *   | { failure: string }>}
 */
function readWhole() {
  const maes = window.maes;
  if (!maes) return Promise.resolve({ failure: "this is not the viewer page" });
  return new Promise((resolve) => {
    const poll = () => {
      const { run, scene } = maes;
      const { opening, graphics, render, error } = maes.state.problems;
      const failure = graphics ?? render ?? error;
      if (failure !== undefined) resolve({ failure });
      else if (opening !== undefined) resolve({ refusal: opening });
      else if (run?.isComplete && scene) {
        const layers = Object.keys(scene.view.layers);
        resolve({ endS: run.endS, agents: run.setup.agents, layers, problem: run.problem });
      } else setTimeout(poll, 20);
    };
    poll();
  });
}

/**
 * @param {Pick<CaptureRequest, "agent" | "layers" | "cut" | "camera" | "background">
 *   & { timeS: number }} request
 */
async function arrange({ agent, layers, cut, camera, background, timeS }) {
  const maes = window.maes;
  const scene = maes?.scene;
  if (!maes || !scene) throw new Error("the page is gone");
  if (layers) {
    for (const layer of /** @type {(keyof typeof scene.view.layers)[]} */ (Object.keys(scene.view.layers))) {
      scene.view.layers[layer] = layers.includes(layer);
    }
    scene.viewChanged();
  }
  if (cut) {
    scene.view.cut = cut;
    scene.viewChanged();
  }
  scene.view.isOnWhite = background === "white";
  document.documentElement.classList.toggle("is-on-white", scene.view.isOnWhite);
  scene.viewChanged();
  // Notices are printed on the terminal; they would cover the image.
  for (const banners of document.querySelectorAll("[data-testid=banners]"))
    banners.setAttribute("hidden", "");
  await maes.showAt(timeS);
  // The camera looks where the agent looks at that time; the whole cave fits an image of this size.
  scene.select(agent, { fly: false });
  if (agent === null && camera !== "corner") scene.lookFrom(camera);
}

/**
 * Renders a time, and waits until the browser has presented the frame.
 * @param {number} timeS
 * @returns {Promise<string | null>} The error, if any.
 */
async function draw(timeS) {
  const maes = window.maes;
  const scene = maes?.scene;
  if (!maes || !scene) return "the page is gone";
  await maes.showAt(timeS);
  await new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve)));
  const { render, error } = maes.state.problems;
  const gl = scene.canvas.getContext("webgl2");
  if (!gl || gl.isContextLost())
    return "the graphics context of the browser was lost; a smaller --size may help";
  return render ?? error ?? null;
}
