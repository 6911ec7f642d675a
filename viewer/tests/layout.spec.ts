/** Which parts the page shows: on the welcome screen, in pictures, and on narrow screens. */
import type { Page } from "@playwright/test";
import { expect, test } from "./support/fixtures.ts";
import { addressWith } from "./support/paths.ts";
import { recording } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

/** The elements of the frame that are visible, without those inside them. */
const visibleParts = (page: Page): Promise<string[]> =>
  page.evaluate(() => {
    const parts = document.querySelectorAll<HTMLElement>(
      ".stage > *, .stage-foot > *, .side, .playback-bar, .chart-key",
    );
    return [...parts]
      .filter((part) => part.checkVisibility() && part.clientWidth > 0 && !part.matches(".stage-foot, .axes"))
      .map((part) => part.classList[0]!);
  });

test("the welcome screen shows nothing of a run", async ({ page, servers }) => {
  await page.goto(addressWith(await servers.view(recording("cave")), { recording: "" }));
  await expect(page.getByTestId("welcome")).toBeVisible();
  await expect(page.getByTestId("open-file")).toBeVisible();
  expect((await visibleParts(page)).filter((part) => part !== "banners")).toEqual(["canvas", "welcome"]);
});

test("pictures show the scene and a caption", async ({ page, servers }) => {
  await shown.open(page, `${await servers.view(recording("cave"))}&picture=1`);
  await expect(page.getByTestId("caption")).toContainText("cave.mcap");
  const parts = (await visibleParts(page)).filter((part) => part !== "banners");
  expect(parts).toEqual(["canvas", "legend", "caption"]);
  await expect(page.getByTestId("legend").locator(".legend-entry").first()).toBeHidden();
  await expect(page.getByTestId("scale")).toHaveText(/^\d+ m$/);
});

for (const [width, height] of [
  [760, 720],
  [390, 844],
] as const) {
  test(`a screen of ${width} pixels has the legend and named controls`, async ({ page, servers }) => {
    await page.setViewportSize({ width, height });
    await shown.open(page, await servers.view(recording("cave")));
    const legend = page.getByTestId("legend");
    await expect(legend).toBeVisible();
    await expect(legend).toContainText("unexplored cell");
    await expect(page.getByTestId("scale")).toHaveText(/^\d+ m$/);
    await expect(page.getByTestId("camera-bar").getByText("Show unexplored")).toBeVisible();
    await expect(page.getByText("explored by each agent")).toBeVisible();
    // Beside each other or one above the other, within the image.
    const stage = (await page.getByTestId("stage").boundingBox())!;
    const [upper, lower] = [
      (await legend.boundingBox())!,
      (await page.getByTestId("camera-bar").boundingBox())!,
    ];
    expect(upper.y + upper.height).toBeLessThanOrEqual(lower.y);
    for (const box of [upper, lower]) {
      expect(box.x).toBeGreaterThanOrEqual(stage.x);
      expect(box.x + box.width).toBeLessThanOrEqual(stage.x + stage.width);
    }
    expect(lower.y + lower.height).toBeLessThanOrEqual(stage.y + stage.height);
  });
}

test("two recordings on a phone leave room for their images", async ({ page, servers }) => {
  await page.setViewportSize({ width: 390, height: 844 });
  await page.goto(await servers.view(recording("cave"), recording("radio")));
  for (const testid of ["side-1", "side-2"]) {
    const side = page.frameLocator(`[data-testid=${testid}]`);
    await expect(side.getByTestId("legend")).toBeVisible();
    const [stage, legend] = [
      (await side.getByTestId("stage").boundingBox())!,
      (await side.getByTestId("legend").boundingBox())!,
    ];
    const toolbar = (await side.getByRole("navigation").boundingBox())!;
    expect(stage.height).toBeGreaterThan(250);
    expect(legend.y - (toolbar.y + toolbar.height)).toBeGreaterThan(100);
  }
});
