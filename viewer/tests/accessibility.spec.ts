/**
 * The page has no violation that axe finds (https://github.com/dequelabs/axe-core): names and roles
 * for screen readers, contrast, order of headings, labels of fields. axe cannot check the image.
 */
import { createRequire } from "node:module";
import type { AxeResults } from "axe-core";
import type { Page } from "@playwright/test";
import { expect, LONG, test } from "./support/fixtures.ts";
import { addressWith } from "./support/paths.ts";
import { recording } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

const AXE = createRequire(import.meta.url).resolve("axe-core/axe.min.js");

declare global {
  interface Window {
    axe: { run(): Promise<AxeResults> };
  }
}

/** Checks all frames of the page, in its present state. */
async function expectAccessible(page: Page, state: string): Promise<void> {
  for (const frame of page.frames()) {
    await frame.addScriptTag({ path: AXE });
    const { violations } = await frame.evaluate(() => window.axe.run());
    const found = violations.flatMap(({ id, help, nodes }) =>
      nodes.map(({ html, failureSummary }) => `${id}: ${help}\n${html}\n${failureSummary}`),
    );
    expect(found, `${state}, ${frame.url()}`).toEqual([]);
  }
}

// Scripts of the test are no files of the page.
test.use({ bypassCSP: true });

for (const colorScheme of ["light", "dark"] as const) {
  test(`a recording in the ${colorScheme} scheme`, async ({ page, servers }) => {
    await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
    await aRecording(page, await servers.view(recording("cave")));
    // The panel is light or dark, and the image is the same.
    const { r } = await page.evaluate(() => {
      const [r] = getComputedStyle(document.querySelector(".side")!)
        .backgroundColor.match(/\d+/g)!
        .map(Number);
      return { r: r! };
    });
    expect(r > 128).toBe(colorScheme === "light");
  });
}

async function aRecording(page: Page, url: string): Promise<void> {
  await shown.openWhole(page, url);
  await expectAccessible(page, "the cave");
  await page.keyboard.press("2");
  await expect(page.getByTestId("agent-title")).toHaveText("Agent 2");
  await page.getByTestId("toolbar-layers").click();
  await expectAccessible(page, "an agent, with layers");
  await page.keyboard.press("?");
  await expect(page.getByRole("dialog")).toBeVisible();
  await expectAccessible(page, "the help");
}

test("the image and the agents have names", async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(recording("cave")));
  await shown.showAt(page, 20);
  const share = (await page.getByTestId("explored").textContent())!;
  const name = `The cave and its agents in three dimensions: cave.mcap, 00:20, ${share} explored`;
  const image = page.getByTestId("canvas");
  await expect(image).toHaveAccessibleName(name);
  await page.getByRole("button", { name: "agent 2, rbw", exact: true }).click();
  await expect(image).toHaveAccessibleName(name.replace("cave.mcap", "cave.mcap, agent 2"));

  // While the time moves, it changes rarely, and not with every frame.
  const changes = await page.evaluate(async () => {
    let count = 0;
    const { canvas } = window.maes!.scene!;
    new MutationObserver((records) => (count += records.length)).observe(canvas, {
      attributeFilter: ["aria-label"],
    });
    document.querySelector<HTMLElement>('[data-testid="play"]')!.click();
    const fromS = window.maes!.state.timeS;
    while (window.maes!.state.timeS < fromS + 10) await new Promise(requestAnimationFrame);
    return count;
  });
  expect(changes).toBeLessThanOrEqual(1);
});

test("a narrow screen", LONG, async ({ page, servers }) => {
  await page.setViewportSize({ width: 390, height: 844 });
  await shown.openWhole(page, await servers.view(recording("cave")));
  await expectAccessible(page, "a narrow screen");
});

test("the welcome screen", LONG, async ({ page, servers }) => {
  await page.goto(addressWith(await servers.view(recording("cave")), { recording: "" }));
  await expect(page.getByTestId("welcome")).toBeVisible();
  await expectAccessible(page, "the welcome screen");
});

test("two recordings", LONG, async ({ page, servers }) => {
  await page.goto(await servers.view(recording("cave"), recording("radio")));
  await expect(page.getByRole("heading")).toHaveText("Two recordings");
  for (const frame of page.frames().slice(1)) {
    await frame.waitForFunction(() => window.maes?.run?.isComplete);
  }
  await expectAccessible(page, "two recordings");
});

test("the start form", LONG, async ({ page, servers }) => {
  const { url } = await servers.run(["--idle"]);
  await page.goto(url);
  await page.getByTestId("welcome-new").click();
  await expect(page.getByTestId("start-form")).toBeVisible();
  await page.getByTestId("start-advanced").getByText("Advanced").click();
  await expectAccessible(page, "the start form");
});

test("a live run", LONG, async ({ page, servers }) => {
  const flags = ["--agents", "2", "--size", "30", "--rtf", "2"];
  const { url } = await servers.run(["../launch_scripts/scenarios/default.toml", ...flags]);
  servers.agents(2);
  await shown.open(page, url);
  await expectAccessible(page, "a live run");
});
