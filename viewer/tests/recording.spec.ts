/** Recordings: ways to open them, numbers, and the timeline. */
import { readFileSync } from "node:fs";
import type { Page } from "@playwright/test";
import { expect, LONG, test } from "./support/fixtures.ts";
import { addressWith } from "./support/paths.ts";
import { recording } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

const FILE = recording("cave");

const TICK_S = 0.02;

/** Parses a number with spaces between thousands. */
const numberOf = (text: string): number => Number(text.replace(/\s/g, ""));

test("opens from the file chooser", async ({ page, servers }) => {
  await page.goto(addressWith(await servers.view(FILE), { recording: "" }));
  await expect(page.getByTestId("welcome")).toBeVisible();
  const chooser = page.waitForEvent("filechooser");
  await page.getByTestId("open-file").click();
  await (await chooser).setFiles(FILE);
  await shown.ready(page);
  await expect(page.getByTestId("run-title")).toHaveText("cave.mcap");
  await expect(page.getByTestId("welcome")).toBeHidden();
  // Another recording replaces it.
  await page.getByTestId("file").setInputFiles(recording("radio"));
  await expect(page.getByTestId("run-title")).toHaveText("radio.mcap");
  await expect(page.getByTestId("fact-radio-range")).toHaveText("15.0 m");
});

test.describe("without reduced motion", () => {
  test.use({ contextOptions: { reducedMotion: "no-preference" } });

  test("plays when it is opened, unless the address has a time", async ({ page, servers }) => {
    const url = await servers.view(FILE);
    await shown.open(page, url);
    await page.waitForFunction(() => window.maes!.state.isPlaying && window.maes!.state.timeS > 1);
    await page.getByTestId("play").click();
    expect((await page.evaluate(() => window.maes!.state)).isPlaying).toBe(false);
    await page.goto("about:blank");
    await shown.open(page, `${url}&time=20`);
    await shown.expectTime(page, 20);
    expect((await page.evaluate(() => window.maes!.state)).isPlaying).toBe(false);
  });
});

test("opens by drag and drop", LONG, async ({ page, servers }) => {
  await page.goto(addressWith(await servers.view(FILE), { recording: "" }));
  await expect(page.getByTestId("drop-zone")).toBeVisible();
  const bytes = readFileSync(FILE).toString("base64");
  await page.evaluate((base64) => {
    const content = Uint8Array.from(atob(base64), (character) => character.charCodeAt(0));
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(new File([content], "dropped.mcap"));
    document.body.dispatchEvent(new DragEvent("drop", { dataTransfer, bubbles: true, cancelable: true }));
  }, bytes);
  await shown.ready(page);
  await expect(page.getByTestId("run-title")).toHaveText("dropped.mcap");
});

test("opens at a time, with an agent", LONG, async ({ page, servers }) => {
  await shown.open(page, `${await servers.view(FILE)}&time=100&agent=3`);
  await shown.expectTime(page, 100);
  await expect(page.getByTestId("agent-title")).toHaveText("Agent 3");
  await expect(page.getByTestId("time-now")).toHaveText("01:40");
});

test("shows its numbers", LONG, async ({ page, servers }) => {
  const info = await servers.info(FILE);
  await shown.openWhole(page, await servers.view(FILE));
  const end = shown.secondsOf(info.endTime);
  await page.getByTestId("timeline").press("Escape");
  await page.keyboard.press("End");
  await shown.expectTime(page, end);

  await expect(page.getByTestId("run-state")).toHaveText("recording");
  await expect(page.getByTestId("time-end")).toHaveText(` / ${shown.whole(info.endTime)}`);
  await expect(page.getByTestId("fact-ended")).toHaveText(`${info.reason}, at ${shown.whole(info.endTime)}`);
  await expect(page.getByTestId("fact-digest")).toHaveAttribute("title", info.digest);
  await expect(page.getByTestId("fact-digest")).toHaveText(`${info.digest.slice(0, 16)}...`);
  expect(numberOf(await page.getByTestId("fact-free-cells").innerText())).toBe(
    info.counters.get("free_cells"),
  );

  const result = await page.evaluate(() => {
    const { result } = window.maes!.run!;
    return result && { ...result, counters: [...result.counters] };
  });
  expect(result!.tick).toBe(info.tick);
  const twoPlaces = (share: number | undefined): string => (share! * 100).toFixed(2);
  expect(twoPlaces(result!.explored)).toBe(info.team.explored);
  expect(twoPlaces(result!.covered)).toBe(info.team.covered);
  await expect(page.getByTestId("explored")).toHaveText(shown.finePercent(result!.explored));
  await expect(page.getByTestId("covered")).toHaveText(shown.finePercent(result!.covered));

  await page.getByTestId("counters-card").getByText("Counters").click();
  const counters = new Map<string, number>();
  for (const row of await page.getByTestId("counters").locator("tr").all()) {
    counters.set(await row.locator("th").innerText(), numberOf(await row.locator("td").innerText()));
  }
  const expected = new Map([...info.counters].map(([name, value]) => [name.replaceAll("_", " "), value]));
  for (const [share, time] of info.reached) {
    const tick = Math.round(shown.secondsOf(time) / TICK_S);
    expected.set(`tick explored permille ${Number(share) * 10}`, tick);
  }
  // The server omits counters of zero.
  for (const [name, value] of counters) if (value === 0) counters.delete(name);
  expect([...counters].sort()).toEqual([...expected].sort());

  expect(result!.exploredBy).toHaveLength(info.agents.length);
  for (const [id, agent] of info.agents.entries()) {
    await page.getByTestId(`agent-row-${id}`).click();
    await expect(page.getByTestId("agent-title")).toHaveText(`Agent ${id}`);
    await expect(page.getByTestId("fact-distance-travelled")).toHaveText(agent.distance);
    expect(twoPlaces(result!.exploredBy[id])).toBe(agent.explored);
    expect(twoPlaces(result!.coveredBy[id])).toBe(agent.covered);
    await expect(page.getByTestId("fact-explored")).toHaveText(shown.finePercent(result!.exploredBy[id]!));
    await expect(page.getByTestId("fact-covered")).toHaveText(shown.finePercent(result!.coveredBy[id]!));
    await expect(page.getByTestId("fact-known")).toHaveText(shown.finePercent(result!.believedBy[id]!));
    await page.getByTestId("agent-close").click();
  }
});

test("counts explored and covered cells like the server, at any time", async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const rows = await page.evaluate((tickS) => {
    const run = window.maes!.run!;
    const agents = Array.from({ length: run.setup.agents }, (_, id) => id);
    /** When every agent had another observation. */
    const allObservedS = (timeS: number): number => {
      let atS = timeS;
      while (atS < run.endS && agents.some((id) => run.agentAt(id, atS).observedS < timeS)) atS += tickS;
      return atS;
    };
    const share = (cells: number): number => cells / run.terrain.freeCells;
    return run.progress.map(({ timeS, explored, covered }) => ({
      timeS,
      explored,
      covered,
      // A recording contains cells once they are in an observation, which follows the scan.
      least: share(run.seenAt(timeS - tickS)),
      most: share(run.seenAt(allObservedS(timeS))),
      counted: share(run.seenAt(timeS)),
      visited: share(run.coveredAt(timeS)),
    }));
  }, TICK_S);
  expect(rows.length).toBeGreaterThan(10);
  for (const { explored, covered, least, most, visited } of rows) {
    expect(visited).toBeCloseTo(covered, 12);
    expect(explored).toBeGreaterThanOrEqual(least - 1e-12);
    expect(explored).toBeLessThanOrEqual(most + 1e-12);
  }
  // Where no scan awaits its observation both numbers are equal, and the panel shows them.
  const settled = rows.filter(({ timeS, least, most }) => timeS > 0 && least === most);
  expect(settled.length).toBeGreaterThan(0);
  for (const { timeS, explored, covered } of settled.slice(0, 3)) {
    await shown.showAt(page, timeS);
    await expect(page.getByTestId("explored")).toHaveText(shown.finePercent(explored));
    await expect(page.getByTestId("covered")).toHaveText(shown.finePercent(covered));
    const left = shown.clock(1800 - timeS);
    await expect(page.getByTestId("progress-text")).toHaveText(
      `${shown.percent(explored, 0)} explored, ${left} to the time limit`,
    );
  }
});

/** Clicks the timeline at a share of its length. */
async function clickLine(page: Page, share: number): Promise<void> {
  const box = (await page.getByTestId("timeline").boundingBox())!;
  await page.mouse.click(box.x + box.width * share, box.y + box.height / 2);
}

test("the timeline seeks", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const end = await shown.endOf(page);
  const line = page.getByTestId("timeline");
  const box = (await line.boundingBox())!;
  const tolerance = (end / box.width) * 1.5;

  await clickLine(page, 0.25);
  await expect.poll(async () => Math.abs((await shown.timeOf(page)) - end * 0.25)).toBeLessThan(tolerance);

  await page.mouse.move(box.x + box.width * 0.25, box.y + box.height / 2);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.4, box.y + box.height / 2, { steps: 4 });
  await page.mouse.move(box.x + box.width * 0.75, box.y + box.height / 2, { steps: 4 });
  await expect.poll(async () => Math.abs((await shown.timeOf(page)) - end * 0.75)).toBeLessThan(tolerance);
  await page.mouse.up();
  await page.mouse.move(box.x + box.width * 0.5, box.y - 200);
  await expect.poll(async () => Math.abs((await shown.timeOf(page)) - end * 0.75)).toBeLessThan(tolerance);

  await line.focus();
  for (const [key, from, to] of [
    ["Home", 50, 0],
    ["End", 50, end],
    ["ArrowRight", 50, 51],
    ["ArrowLeft", 50, 49],
    ["Shift+ArrowRight", 50, 60],
    ["Shift+ArrowLeft", 50, 40],
    ["PageUp", 50, 110],
    ["PageDown", 100, 40],
    [".", 50, 50.02],
    [",", 50, 49.98],
    ["ArrowLeft", 0, 0],
    ["ArrowRight", end, end],
  ] as const) {
    await shown.showAt(page, from);
    await page.keyboard.press(key);
    await shown.expectTime(page, to);
  }
  // The same keys work without focus.
  await line.blur();
  await shown.showAt(page, 50);
  await page.keyboard.press("ArrowRight");
  await shown.expectTime(page, 51);
  await page.keyboard.press("Home");
  await shown.expectTime(page, 0);
  await expect(line).toHaveAttribute("aria-valuetext", `00:00 of ${shown.clock(end)}`);
});

test("milestones show when shares were explored, and seek there", LONG, async ({ page, servers }) => {
  const info = await servers.info(FILE);
  await shown.openWhole(page, await servers.view(FILE));
  expect([...info.reached.keys()]).toEqual(["50", "90", "99", "99.9", "100"]);
  for (const [share, time] of info.reached) {
    const mark = page.getByTestId(`milestone-${share}`);
    await expect(mark).toHaveAttribute("title", `${share} % explored at ${shown.whole(time)}`);
    // Marks at the end overlap: keyboard and screen readers reach each of them.
    await mark.dispatchEvent("click");
    await shown.expectTime(page, shown.secondsOf(time));
  }
  const first = page.getByTestId("milestone-50");
  await first.click();
  await shown.expectTime(page, shown.secondsOf(info.reached.get("50")!));
});

test("plays, pauses, and plays to its end", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const end = await shown.endOf(page);
  const state = () => page.evaluate(() => window.maes!.state);

  await page.getByTestId("rate").selectOption("2");
  expect((await state()).rate).toBe(2);
  await page.keyboard.press(">");
  await expect.poll(async () => (await state()).rate).toBe(5);
  await page.keyboard.press("<");
  await page.keyboard.press("<");
  await expect(page.getByTestId("rate")).toHaveValue("1");

  await page.getByTestId("play").click();
  await expect.poll(() => shown.timeOf(page)).toBeGreaterThan(0.5);
  await page.keyboard.press(" ");
  await expect(page.getByTestId("play")).toHaveAttribute("aria-label", "Play (Space)");
  const held = await shown.timeOf(page);
  await page.getByTestId("timeline").hover();
  expect(await shown.timeOf(page)).toBe(held);

  await page.getByTestId("rate").selectOption("100");
  await shown.showAt(page, end - 30);
  await page.getByTestId("play").click();
  await shown.expectTime(page, end);
  expect((await state()).isPlaying).toBe(false);
  // At the end it starts over.
  await page.getByTestId("play").click();
  await expect.poll(() => shown.timeOf(page)).toBeLessThan(end - 1);
});

test("a click on the chart seeks", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const end = await shown.endOf(page);
  const over = page.getByTestId("chart").locator(".u-over");
  const box = (await over.boundingBox())!;
  await over.click({ position: { x: box.width / 2, y: box.height / 2 } });
  await expect.poll(async () => Math.abs((await shown.timeOf(page)) - end / 2)).toBeLessThan(end / 50);
});

test("a time has the same image whatever was shown before", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const first = await shown.pictureAt(page, 100);
  const later = await shown.pictureAt(page, 300);
  const again = await shown.pictureAt(page, 100);
  shown.expectOther(first, later, "100 s and 300 s");
  shown.expectSame(first, again, "100 s before and after 300 s");

  // Through the timeline as well, with another agent in between.
  await page.keyboard.press("2");
  await clickLine(page, 0.9);
  await page.keyboard.press("Escape");
  await clickLine(page, 0.1);
  shown.expectSame(first, await shown.pictureAt(page, 100), "100 s after a round trip");

  // And in a page that has not shown anything else.
  await page.reload();
  await shown.ready(page);
  shown.expectSame(first, await shown.pictureAt(page, 100), "100 s in a new page");
});

test(
  "a large cave is coarse in motion, and in full detail at rest",
  LONG,
  async ({ page, context, servers }) => {
    const triangles = () => page.evaluate(() => window.maes!.scene!.stats.triangles);
    const url = await servers.view(recording("hall"));
    await shown.openWhole(page, url);
    await shown.showAt(page, 5);
    const full = await triangles();
    await page.getByTestId("rate").selectOption("1");
    await page.getByTestId("play").click();
    await expect.poll(triangles).toBeLessThan(full / 2);
    await page.getByTestId("play").click();
    await expect.poll(triangles).toBeGreaterThan(full * 0.8);

    const other = await context.newPage();
    await shown.openWhole(other, url);
    const exact = await shown.pictureAt(other, await shown.timeOf(page));
    await expect.poll(async () => exact.equals(await shown.picture(page))).toBe(true);
  },
);

test("the picture of the start, in full, does not wait for the rest", async ({ page, servers }) => {
  const held = servers.held({ "cave.mcap": { file: recording("cave"), bytes: 300_000 } });
  await shown.open(page, await held.open("recording=cave.mcap"));
  const endS = await shown.endOf(page);
  expect(endS).toBeGreaterThan(0);
  await expect(page.getByTestId("run-title")).toBeVisible();
  const early = await shown.pictureAt(page, 0);
  expect(await page.evaluate(() => window.maes!.run!.isComplete)).toBe(false);
  held.release();
  await page.waitForFunction(() => window.maes!.run!.isComplete);
  expect(await shown.endOf(page)).toBeGreaterThan(endS);
  // What has been read since changes nothing of it, so it was not drawn again.
  expect(await page.evaluate(() => window.maes!.scene!.needsRedraw)).toBe(false);
  shown.expectSame(early, await shown.pictureAt(page, 0), "before and after the rest was read");
});
