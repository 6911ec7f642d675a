/** Two recordings side by side: their time is linked. */
import type { Frame, Page } from "@playwright/test";
import { expect, LONG, test } from "./support/fixtures.ts";
import { recording } from "./support/recordings.ts";

async function sideOf(page: Page, testid: string): Promise<Frame> {
  return (await (await page.getByTestId(testid).elementHandle())!.contentFrame())!;
}

/** The frames of both sides, with their recordings read completely. */
async function sidesOf(page: Page): Promise<[Frame, Frame]> {
  const sides: [Frame, Frame] = [await sideOf(page, "side-1"), await sideOf(page, "side-2")];
  for (const side of sides) {
    await side.waitForFunction(() => window.maes?.run?.isComplete);
    await side.evaluate(() => window.maes!.ready);
  }
  return sides;
}

const stateOf = (side: Frame) => side.evaluate(() => window.maes!.state);
const endOf = (side: Frame) => side.evaluate(() => window.maes!.run!.endS);

async function expectTimes(sides: [Frame, Frame], times: [number, number]): Promise<void> {
  for (const index of [0, 1] as const) {
    const timeOf = async () => (await stateOf(sides[index])).timeS;
    await expect.poll(timeOf).toBeCloseTo(times[index], 6);
  }
}

test("shows two recordings with linked time", async ({ page, servers }) => {
  await page.goto(`${await servers.view(recording("cave"), recording("radio"))}&time=30`);
  const sides = await sidesOf(page);
  const [cave, radio] = sides;
  await expect(cave.getByTestId("run-title")).toHaveText("cave.mcap");
  await expect(radio.getByTestId("run-title")).toHaveText("radio.mcap");
  await expectTimes(sides, [30, 30]);

  // A side that is shorter stays at its end.
  await radio.getByTestId("timeline").press("End");
  const shortS = await endOf(radio);
  await expectTimes(sides, [shortS, shortS]);
  await cave.getByTestId("timeline").press("End");
  const longS = await endOf(cave);
  expect(longS).toBeGreaterThan(shortS);
  await expectTimes(sides, [longS, shortS]);

  // Both timelines are as long as the longer run, and a time beyond the shorter one is shown there.
  for (const side of sides) {
    const length = side.locator(".tl-labels span").last();
    expect(await length.textContent()).toBe(await cave.locator(".tl-labels span").last().textContent());
  }
  const line = (await radio.getByTestId("timeline").boundingBox())!;
  const beyondS = (shortS + longS) / 2;
  await page.mouse.click(line.x + (line.width * beyondS) / longS, line.y + line.height / 2);
  await expect.poll(async () => (await stateOf(radio)).timeS).toBeCloseTo(shortS, 6);
  await expect.poll(async () => Math.abs((await stateOf(cave)).timeS - beyondS)).toBeLessThan(longS / 100);

  // Both play, at one rate, and stop together.
  await cave.getByTestId("timeline").press("Home");
  await expectTimes(sides, [0, 0]);
  await radio.getByTestId("play").click();
  for (const side of sides) {
    await side.waitForFunction(() => window.maes!.state.isPlaying && window.maes!.state.timeS > 0);
  }
  await cave.getByTestId("play").click();
  await expect.poll(async () => (await stateOf(radio)).isPlaying).toBe(false);
  const [one, two] = [await stateOf(cave), await stateOf(radio)];
  expect(one.isPlaying).toBe(false);
  expect(two).toMatchObject({ timeS: one.timeS, rate: one.rate });
});

test.describe("without reduced motion", () => {
  test.use({ contextOptions: { reducedMotion: "no-preference" } });

  test("both sides play when they are opened", async ({ page, servers }) => {
    await page.goto(await servers.view(recording("cave"), recording("radio")));
    for (const side of await sidesOf(page)) {
      await side.waitForFunction(() => window.maes!.state.isPlaying && window.maes!.state.timeS > 1);
    }
  });
});

test("a side that drifts is set right", LONG, async ({ page, servers }) => {
  await page.goto(await servers.view(recording("cave"), recording("radio")));
  const [cave, radio] = await sidesOf(page);
  await cave.getByTestId("play").click();
  await radio.waitForFunction(() => window.maes!.state.isPlaying);
  // As if its frames had taken longer.
  await radio.evaluate(() => window.maes!.follow({ timeS: 100, isPlaying: true, rate: 0.1 }));
  await radio.waitForFunction(() => window.maes!.state.timeS < 90);
  expect((await stateOf(radio)).rate).toBe((await stateOf(cave)).rate);
});

test("a side that is still being read catches up", async ({ page, servers }) => {
  const server = servers.held({
    "cave.mcap": { file: recording("cave"), bytes: Infinity },
    "radio.mcap": { file: recording("radio"), bytes: 200_000 },
  });
  await page.goto(await server.open("recording=cave.mcap&beside=radio.mcap"));
  const cave = await sideOf(page, "side-1");
  await cave.waitForFunction(() => window.maes?.run?.isComplete);
  const radio = await sideOf(page, "side-2");
  await radio.waitForFunction(() => (window.maes?.run?.endS ?? 0) > 0);
  await cave.evaluate(() => window.maes!.ready);

  // A time that only one of them knows, then play from there.
  await cave.getByTestId("timeline").press("Home");
  await cave.getByTestId("timeline").press("Shift+PageUp");
  const aheadS = (await stateOf(cave)).timeS;
  const readS = await endOf(radio);
  expect(readS).toBeLessThan(aheadS);
  await expect.poll(async () => (await stateOf(radio)).timeS).toBeCloseTo(readS, 6);
  server.release();
  await expect.poll(() => endOf(radio)).toBeGreaterThan(readS);
  await radio.waitForFunction(() => window.maes!.run!.isComplete);
  const wantedS = Math.min(aheadS, await endOf(radio));
  await expect.poll(async () => (await stateOf(radio)).timeS).toBeCloseTo(wantedS, 6);
});

test("a link leads to both", LONG, async ({ page, servers }) => {
  await page.goto(`${await servers.view(recording("cave"), recording("radio"))}&time=20`);
  const [, radio] = await sidesOf(page);
  // Without the permission to write to the clipboard the page shows the link.
  await radio.evaluate(() => {
    navigator.clipboard.writeText = () => Promise.reject(new Error("not allowed"));
  });
  await radio.getByTestId("toolbar-link").click();
  const link = await radio.getByTestId("share-link").innerText();
  expect(link).toContain("?recording=beside/radio.mcap&beside=recording/cave.mcap&time=20&");
  await page.goto(link);
  const sides = await sidesOf(page);
  await expect(sides[0].getByTestId("run-title")).toHaveText("radio.mcap");
  await expect(sides[1].getByTestId("run-title")).toHaveText("cave.mcap");
  await expectTimes(sides, [20, 20]);
});
