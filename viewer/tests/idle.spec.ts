/** An idle simulator: the start form, its errors, and consecutive runs. */
import { existsSync, mkdtempSync, readdirSync, readFileSync, rmSync } from "node:fs";
import { join } from "node:path";
import type { Page } from "@playwright/test";
import { expect, LONG, test, type Servers } from "./support/fixtures.ts";
import { temporaryFolder } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

/** Defaults and ranges of the reference; it has 10 agents at most. */
const SLIDERS: Record<string, readonly [value: number, min: number, max: number]> = {
  "start-agents": [3, 1, 27],
  "start-durationMin": [30, 1, 120],
  "start-size-x": [50, 30, 100],
  "start-spheresFillPercent": [20, 1, 30],
  "start-spheresRadiusMin": [3, 2, 15],
  "start-spheresRadiusMax": [8, 2, 15],
  "start-spheresConnections": [3, 1, 10],
  "start-spheresSmoothing": [5, 0, 20],
  "start-noiseFillPercent": [53, 45, 60],
  "start-noiseSmoothing": [5, 0, 20],
  "start-searchCellsPerTick": [100, 10, 250],
  "start-sensingFovDeg": [360, 1, 360],
};

/** Starts an idle server; the returned function starts the agents of the next run. */
async function idle(
  servers: Servers,
): Promise<{ url: string; recordings: string; agentsForNext: () => Promise<number> }> {
  const folder = mkdtempSync(join(temporaryFolder(), "idle-"));
  const [ready, recordings] = [join(folder, "ready"), join(folder, "recordings")];
  const { url } = await servers.run(["--idle", "--ready", ready, "--record-dir", recordings]);
  // The server writes the scenario's file name for every run.
  const scenario = (): string => (existsSync(ready) ? readFileSync(ready, "utf8") : "");
  return {
    url,
    recordings,
    async agentsForNext() {
      await expect.poll(scenario).toMatch(/\n$/);
      const file = scenario().trim();
      rmSync(ready);
      const count = Number(await servers.scenarioKey(file, "agents.count"));
      servers.agents(count);
      return count;
    },
  };
}

async function openForm(page: Page, button: string): Promise<void> {
  await page.getByTestId(button).click();
  await expect(page.getByTestId("start-form")).toBeVisible();
  await page.getByTestId("start-advanced").getByText("Advanced").click();
}

const toml = (page: Page): Promise<string> => page.getByTestId("start-toml").inputValue();

test("the form has the defaults and ranges of the reference", LONG, async ({ page, servers }) => {
  const { url } = await idle(servers);
  await page.goto(url);
  await openForm(page, "welcome-new");
  for (const [id, [value, min, max]] of Object.entries(SLIDERS)) {
    const slider = page.getByTestId(id);
    await expect(slider, id).toHaveValue(String(value));
    await expect(slider, id).toHaveAttribute("min", String(min));
    await expect(slider, id).toHaveAttribute("max", String(max));
  }
  await expect(page.getByTestId("start-controller")).toHaveValue("rbw");
  await expect(page.getByTestId("start-generator")).toHaveValue("spheres");
  await expect(page.getByTestId("start-unlimited")).toBeChecked();
  await expect(page.getByTestId("start-random")).toBeChecked();
  const names = await page
    .getByTestId("start-controller")
    .locator("option")
    .evaluateAll((options) => options.map((option) => (option as HTMLOptionElement).value));
  const registry = JSON.parse(readFileSync("src/app/controllers.json", "utf8")) as { value: string }[];
  expect(names).toEqual(registry.map((controller) => controller.value));
  expect(names).toEqual(expect.arrayContaining(["rbw", "lvd", "dsvp"]));

  // The text reflects the form.
  await page.getByTestId("start-agents").fill("7");
  await page.getByTestId("start-size-x").fill("40");
  await page.getByTestId("start-seed").fill("12");
  await expect(page.getByTestId("start-random")).not.toBeChecked();
  await page.getByTestId("start-controller").selectOption("lvd");
  await page.getByTestId("start-unlimited").click();
  await page.getByTestId("start-communicationRangeM").fill("25");
  await expect(page.getByTestId("start-communicationRangeM")).toHaveAttribute("min", "1");
  await expect(page.getByTestId("start-communicationRangeM")).toHaveAttribute("max", "100");
  for (const line of [
    "seed = 12",
    "duration_s = 1800.0",
    "size = 40",
    "count = 7",
    'controller = "lvd"',
    'set = { search_time = "budgeted", search_cells_per_tick = 100 }',
    "range_m = 25.0",
  ]) {
    expect((await toml(page)).split("\n")).toContain(line);
  }
  await page.getByTestId("start-generator").selectOption("noise");
  await expect(page.getByTestId("start-noiseFillPercent")).toBeVisible();
  await expect(page.getByTestId("start-spheresFillPercent")).toBeHidden();
  expect((await toml(page)).split("\n")).toContain("fill = 0.53");
});

test("errors of a scenario are shown beside the form", LONG, async ({ page, servers }) => {
  const { url } = await idle(servers);
  await page.goto(url);
  await openForm(page, "welcome-new");
  const problems = page.getByTestId("start-problems");
  // Found by the form itself.
  await page.getByTestId("start-spheresRadiusMin").fill("9");
  await expect(problems).toHaveText("Radius: the smallest exceeds the largest.");
  await page.getByTestId("start-go").click();
  await expect(page.getByTestId("start-form")).toBeVisible();
  await page.getByTestId("start-spheresRadiusMin").fill("3");
  await expect(problems).toBeHidden();
  // Found by the server.
  const text = await toml(page);
  for (const [edited, expected] of [
    [text.replace("count = 3", "count = 0"), /agents\.count/],
    [text.replace("count = 3", "count ="), /:17:8: /],
    [text.replace("count = 3", "counts = 3"), /counts/],
  ] as const) {
    await page.getByTestId("start-toml").fill(edited);
    await page.getByTestId("start-go").click();
    await expect(problems).toHaveText(expected);
    await expect(page.getByTestId("start-go")).toBeEnabled();
  }
  await page.getByTestId("start-back").click();
  expect(await toml(page)).toBe(text);
});

test("consecutive runs start and end", async ({ page, servers }) => {
  const { url, recordings, agentsForNext } = await idle(servers);
  await page.goto(url);
  await openForm(page, "welcome-new");
  await page.getByTestId("start-agents").fill("2");
  await page.getByTestId("start-size-x").fill("30");
  await page.getByTestId("start-seed").fill("5");
  await page.getByTestId("start-durationMin").fill("1");
  await page.getByTestId("start-stopWhenExplored").click();
  await page.getByTestId("start-rtf").fill("9");
  await page.getByTestId("start-go").click();
  expect(await agentsForNext()).toBe(2);
  await shown.ready(page);
  await expect(page.getByTestId("start-form")).toBeHidden();
  await expect(page.getByTestId("fact-agents")).toHaveText("2, rbw");
  await expect(page.getByTestId("fact-seed")).toHaveText("5");
  await expect(page.getByTestId("run-state")).toHaveText("ended");
  await page.keyboard.press("End");
  await shown.expectTime(page, 60);
  await expect(page.getByTestId("fact-digest")).toBeVisible();
  const first = await page.evaluate(() => [window.maes!.run!.id, window.maes!.run!.result!.digest]);

  // The form keeps its values; the same scenario has the same result.
  await openForm(page, "sim-new");
  await expect(page.getByTestId("start-agents")).toHaveValue("2");
  expect(existsSync(recordings)).toBe(false);
  await page.getByTestId("start-record").click();
  await page.getByTestId("start-go").click();
  await expect(page.getByTestId("banners")).toContainText(/recorded as run_\w+\.mcap/);
  expect(await agentsForNext()).toBe(2);
  await expect.poll(() => page.evaluate(() => window.maes!.run!.id)).not.toBe(first[0]);
  await expect(page.getByTestId("run-state")).toHaveText("ended");
  await expect.poll(() => page.evaluate(() => window.maes!.run!.result?.digest)).toBe(first[1]);
  expect(readdirSync(recordings)).toHaveLength(1);

  // A run is stopped, and another one follows.
  await openForm(page, "sim-new");
  await page.getByTestId("start-agents").fill("3");
  await page.getByTestId("start-durationMin").fill("30");
  await page.getByTestId("start-rtf").fill("2");
  await page.getByTestId("start-go").click();
  expect(await agentsForNext()).toBe(3);
  await expect(page.getByTestId("run-state")).toHaveText("playing");
  await expect(page.getByTestId("sim-new")).toBeDisabled();
  await page.getByTestId("sim-stop").click();
  await page.getByTestId("confirm-yes").click();
  await expect(page.getByTestId("run-state")).toHaveText("ended");
  await expect(page.getByTestId("sim-new")).toBeEnabled();
});
