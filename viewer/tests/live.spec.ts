/** A live run: the page shows it, controls it, and does not change its digest. */
import type { Page } from "@playwright/test";
import { expect, LONG, test } from "./support/fixtures.ts";
import { digestIn } from "./support/info.ts";
import { SCENARIO } from "./support/paths.ts";
import { parameterOf } from "./support/simulator.ts";
import * as shown from "./support/shown.ts";

const AGENTS = 5;

/** A run that does not end by itself during a test. */
const ENDLESS = [SCENARIO, "--paused", "true", "--set", "stop_when_explored=false"];
const TICK_S = 0.02;

const expectState = (page: Page, text: string): Promise<void> =>
  expect(page.getByTestId("run-state")).toHaveText(text);

const stateOf = (page: Page) => page.evaluate(() => window.maes!.state);

const runId = (page: Page): Promise<string> => page.evaluate(() => window.maes!.run!.id);

/** Waits until the run is known up to a time. */
const expectKnown = (page: Page, timeS: number): Promise<void> =>
  expect.poll(() => shown.endOf(page)).toBeGreaterThanOrEqual(timeS);

async function confirm(page: Page, button: string): Promise<void> {
  await page.getByTestId(button).click();
  await page.getByTestId("confirm-yes").click();
  await expect(page.getByTestId("confirm")).toBeHidden();
}

/** Everything that a page has received, as numbers. */
function sumOf(page: Page) {
  return page.evaluate(() => {
    const run = window.maes!.run!;
    const sum = (times: typeof run.firstSeenTick): number => {
      let all = 7;
      times.forEach((cell, tick) => (all = (all * 31 + tick + cell) % 1e9));
      return all;
    };
    const agents = Array.from({ length: run.setup.agents }, (_, id) => id);
    return {
      id: run.id,
      endS: run.endS,
      seen: sum(run.firstSeenTick),
      covered: sum(run.coveredTick),
      progress: run.progress,
      poses: agents.map((id) => run.track(id).count),
      states: agents.map((id) => run.agentAt(id, run.endS)),
    };
  });
}

test("a paused run is resumed, paused and stepped", async ({ page, servers }) => {
  // With all poses in the recording every tick has a message.
  const { url } = await servers.run([...ENDLESS, "--rtf", "2", "--set", "recording.poses_period_ticks=1"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  await expectState(page, "paused");
  await expect(page.getByTestId("run-title")).toHaveText(`Run at ${new URL(url).host}`);
  /**
   * Steps, and expects exactly that many ticks. The known part ends before the tick whose messages
   * are arriving.
   */
  const step = async (from: number, ticks: number): Promise<number> => {
    await page.getByTestId(`sim-step-${ticks}`).click();
    await expect.poll(() => shown.endOf(page)).toBeCloseTo((from + ticks - 1) * TICK_S, 6);
    await expectState(page, "paused");
    return from + ticks;
  };
  let tick = 0;
  for (const ticks of [1, 10, 50, 1]) tick = await step(tick, ticks);

  await page.getByTestId("sim-play").click();
  await expectState(page, "playing");
  for (const ticks of [1, 10, 50]) await expect(page.getByTestId(`sim-step-${ticks}`)).toBeDisabled();
  await expectKnown(page, 4);
  // The time shown follows.
  await expect.poll(() => shown.timeOf(page)).toBeGreaterThan(3);
  await page.getByTestId("sim-play").click();
  await expectState(page, "paused");

  // The play button and the space bar control the simulator while it is followed.
  await page.getByTestId("play").click();
  await expectState(page, "playing");
  await page.keyboard.press(" ");
  await expectState(page, "paused");
});

test("the map is changed from the page", async ({ page, servers }) => {
  const { url } = await servers.run(ENDLESS);
  servers.agents(AGENTS);
  await shown.open(page, url);
  await page.getByTestId("sim-step-1").click();
  await expectKnown(page, 0);
  await expectState(page, "paused");
  await page.getByTestId("sim-map").locator("summary").click();
  await expect(page.getByTestId("edit-wall")).toBeDisabled();
  for (const axis of ["x", "y", "z"]) {
    await page.getByTestId(`edit-0-${axis}`).fill("0");
    await page.getByTestId(`edit-1-${axis}`).fill("1000");
    await page.getByTestId(`edit-1-${axis}`).blur();
  }
  // Bodies are in the way of walls, and of nothing else.
  await page.getByTestId("edit-wall").click();
  await expect(page.getByTestId("banner-control")).toContainText(
    "a body, a relay or an obstacle is in the box",
  );
  await page.getByTestId("edit-free").click();
  await expect(page.getByTestId("edit-outcome")).toHaveText(/^\d+ cells have become free\.$/);
  await page.getByTestId("sim-step-10").click();
  await expectKnown(page, 9 * TICK_S);
  const walls = () =>
    page.evaluate(() => {
      const run = window.maes!.run!;
      const { size, walls } = run.terrainAt(run.endS);
      return { size, walls: walls.count };
    });
  const { size, walls: left } = await walls();
  const [x, y, z] = size;
  expect(left).toBe(x * y * z - (x - 2) * (y - 2) * (z - 2));
});

test("the real-time factor is the server's", LONG, async ({ page, servers }) => {
  const { url } = await servers.run([...ENDLESS, "--rtf", "2"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  const speed = page.getByTestId("sim-speed");
  await expect(speed).toHaveAttribute("aria-valuetext", "2x");
  for (const [step, rtf, text] of [
    ["0", 0.25, "0.25x"],
    ["5", 10, "10x"],
    ["9", 0, "max"],
  ] as const) {
    await speed.fill(step);
    await expect(speed).toHaveAttribute("aria-valuetext", text);
    await expect.poll(() => parameterOf(page, "execution.rtf")).toBe(rtf);
  }
});

test("shows where the simulator's time goes", LONG, async ({ page, servers }) => {
  const { url } = await servers.run([...ENDLESS, "--rtf", "5"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  const phases = page.getByTestId("sim-profile");
  await page.getByTestId("sim-play").click();
  await page.getByText("Where its time goes").click();
  await expect(phases.locator("dt")).toHaveText([
    "pace",
    "record state",
    "publish",
    "scan",
    "contacts and observations",
    "send",
    "agents",
    "record",
    "radio and bodies",
  ]);
  const sum = async (): Promise<number> => {
    const texts = await phases.locator("dd").allTextContents();
    return texts.reduce((whole, text) => whole + Number.parseInt(text, 10), 0);
  };
  // Each share is rounded down.
  await expect.poll(sum).toBeGreaterThan(100 - 9);
  expect(await sum()).toBeLessThanOrEqual(100);
});

test("earlier times can be shown while the run continues", LONG, async ({ page, servers }) => {
  const { url } = await servers.run([...ENDLESS, "--rtf", "5"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  await page.getByTestId("sim-play").click();
  await expectKnown(page, 3);

  const live = page.getByTestId("go-live");
  await expect(live).toHaveAttribute("aria-pressed", "true");
  await page.keyboard.press("Home");
  await shown.expectTime(page, 0);
  await expect(live).toHaveAttribute("aria-pressed", "false");
  const picture = await shown.pictureAt(page, 2);
  const then = await shown.endOf(page);
  await expectKnown(page, then + 3);
  // The past stays the same, however much is received afterwards.
  await shown.expectTime(page, 2);
  shown.expectSame(picture, await shown.pictureAt(page, 2), "2 s, earlier and later");
  await expectState(page, "playing");

  await live.click();
  await expect.poll(() => shown.timeOf(page)).toBeGreaterThan(then);
  expect((await stateOf(page)).isFollowing).toBe(true);

  // Played from the start, the time shown catches up with the run.
  await page.getByTestId("sim-play").click();
  await expectState(page, "paused");
  await page.keyboard.press("Home");
  await page.getByTestId("rate").selectOption("100");
  await page.getByTestId("play").click();
  await expect.poll(async () => (await stateOf(page)).isFollowing).toBe(true);
  await expect.poll(async () => (await shown.endOf(page)) - (await shown.timeOf(page))).toBeCloseTo(0, 6);
});

test("a run is restarted, and stopped", LONG, async ({ page, servers }) => {
  const { server, url } = await servers.run([...ENDLESS, "--rtf", "10"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  const first = await runId(page);
  await page.getByTestId("sim-play").click();
  await expectKnown(page, 10);
  await page.getByTestId("sim-play").click();
  await expectState(page, "paused");

  // Only after confirmation.
  await page.getByTestId("sim-restart").click();
  await page.getByTestId("confirm-no").click();
  expect(await runId(page)).toBe(first);
  const earlier = await page.evaluate(() => [...window.maes!.run!.terrain.walls.bytes].join(""));
  await confirm(page, "sim-restart");
  await expect.poll(() => runId(page)).not.toBe(first);
  expect(await page.evaluate(() => [...window.maes!.run!.terrain.walls.bytes].join(""))).toBe(earlier);

  await expectState(page, "paused");
  await page.getByTestId("sim-play").click();
  await expectKnown(page, 5);
  await confirm(page, "sim-stop");
  await expectState(page, "ended");
  await server.ended;
  const digest = digestIn(server.stdout);
  await page.keyboard.press("End");
  await expect(page.getByTestId("fact-digest")).toHaveAttribute("title", digest);
  const end = await page.evaluate(() => window.maes!.run!.result!);
  expect(server.stdout).toContain(`(tick ${end.tick})`);
  await expect(page.getByTestId("fact-ended")).toHaveText(`${end.reason}, at ${shown.clock(end.timeS)}`);
  await expect(page.getByTestId("banner-connection")).toContainText("The run is over");
});

test("a viewed run stays for a restart and for a new run", LONG, async ({ page, servers }) => {
  // Three runs.
  test.slow();
  const { run, url } = await servers.viewedRun([
    "--agents",
    "2",
    "--duration",
    "4",
    "--rtf",
    "20",
    "--paused",
  ]);
  await shown.open(page, url);
  const ended = async (count: number) => {
    await page.getByTestId("sim-play").click();
    await run.prints("stdout", new RegExp(`(digest: [^]*){${count}}`));
    await expectState(page, "ended");
  };
  await ended(1);
  await run.prints("stderr", /the page stays/);
  const first = await runId(page);

  // The run again, without a question, because nothing is lost.
  await page.getByTestId("sim-restart").click();
  await expect.poll(() => runId(page)).not.toBe(first);
  const second = await runId(page);
  await ended(2);

  // Another run, on a map of another kind.
  await page.getByTestId("sim-new").click();
  await page.getByTestId("start-generator").selectOption("mine");
  await page.getByTestId("start-durationMin").fill("1");
  await page.getByTestId("start-rtf").fill("9");
  await page.getByTestId("start-go").click();
  await expect.poll(() => runId(page)).not.toBe(second);
  await run.prints("stdout", /(digest: [^]*){3}/);
  await expectState(page, "ended");

  const digests = [...run.stdout.matchAll(/^digest: (\S+)$/gm)].map(([, digest]) => digest);
  expect(digests).toHaveLength(3);
  expect(digests[1]).toBe(digests[0]);
  expect(digests[2]).not.toBe(digests[0]);
  expect(await page.evaluate(() => window.maes!.run!.setup.scenarioToml)).toContain('kind = "mine"');
  expect(await run.interrupt()).toBe(0);
});

test("observing and controlling a run does not change its digest", async ({ page, servers }) => {
  const flags = ["--duration", "20"];
  const { server, url } = await servers.run([SCENARIO, ...flags, "--paused", "true", "--rtf", "5"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  // What appears in the panel later does not move the buttons, so that no click misses one.
  const place = () => page.getByTestId("sim-play").boundingBox();
  const first = await place();
  await page.getByTestId("sim-step-10").click();
  // While it steps, the button pauses.
  await expectKnown(page, 8.5 * TICK_S);
  await expectState(page, "paused");
  await page.getByTestId("sim-play").click();
  await expectKnown(page, 4);
  await page.keyboard.press(" ");
  await expectState(page, "paused");
  await page.keyboard.press("2");
  await page.getByTestId("sim-step-1").click();
  await page.getByTestId("sim-speed").fill("9");
  await page.getByTestId("sim-play").click();
  expect(await server.ended).toBe(0);
  await expectState(page, "ended");
  await page.keyboard.press("End");
  await expect(page.getByTestId("fact-digest")).toHaveAttribute("title", digestIn(server.stdout));
  expect(await place()).toEqual(first);
  expect(digestIn(server.stdout)).toBe(await servers.digestUnobserved(flags));
});

test("two pages show the same, whenever they connected", LONG, async ({ page, context, watch, servers }) => {
  const { url } = await servers.run([...ENDLESS, "--rtf", "10"]);
  servers.agents(AGENTS);
  await shown.open(page, url);
  await page.getByTestId("sim-play").click();
  await expectKnown(page, 30);

  const second = await context.newPage();
  watch(second);
  await shown.open(second, url);
  await expectKnown(second, 35);
  // A command of one page is visible in the other.
  await second.getByTestId("sim-play").click();
  await expectState(second, "paused");
  await expectState(page, "paused");
  await expect.poll(async () => (await shown.endOf(second)) - (await shown.endOf(page))).toBe(0);
  const sum = await sumOf(page);
  expect(await sumOf(second)).toEqual(sum);
  expect(sum.progress.length).toBeGreaterThan(3);
  shown.expectSame(await shown.pictureAt(page, 25), await shown.pictureAt(second, 25), "25 s in both");
});
