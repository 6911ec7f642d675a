/** A map without a run: measuring, what a body reaches, and starts for a scenario. */
import { mkdtempSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import type { Page } from "@playwright/test";
import { expect, test } from "./support/fixtures.ts";
import { temporaryFolder } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

/** A cave of triangles: two halls of 4 m x 4 m x 3 m, with a passage of 1 m x 2 m x 1 m between. */
function cave(folder: string): string {
  const corners: string[] = [];
  const faces: string[] = [];
  for (const [low, high] of [
    [
      [0, 0, 0],
      [4, 4, 3],
    ],
    [
      [3.5, 1, 0],
      [6.5, 2, 1],
    ],
    [
      [6, 0, 0],
      [10, 4, 3],
    ],
  ] as const) {
    const first = corners.length + 1;
    for (let corner = 0; corner < 8; corner++) {
      const at = [0, 1, 2].map((axis) => ((corner >> axis) & 1 ? high : low)[axis]);
      corners.push(`v ${at.join(" ")}`);
    }
    const quads = ["0 2 3 1", "4 5 7 6", "0 1 5 4", "2 6 7 3", "0 4 6 2", "1 3 7 5"];
    faces.push(
      ...quads.map(
        (quad) =>
          `f ${quad
            .split(" ")
            .map((at) => Number(at) + first)
            .join(" ")}`,
      ),
    );
  }
  writeFileSync(join(folder, "halls.obj"), [...corners, ...faces, ""].join("\n"));
  return "halls.obj";
}

/** A position of the image at which a wall lies in a part of the map, in pixels of the page. */
async function wallWithin(page: Page, low: number, high: number): Promise<{ x: number; y: number }> {
  const found = await page.waitForFunction(
    ([low, high]) => {
      const box = document.querySelector("canvas")!.getBoundingClientRect();
      for (let y = box.height * 0.3; y < box.height * 0.75; y += 7) {
        for (let x = box.width * 0.1; x < box.width * 0.9; x += 7) {
          const hit = window.maes!.scene!.surfaceAt(x, y);
          const isTop = document.elementFromPoint(box.left + x, box.top + y)?.tagName === "CANVAS";
          // The floor, away from the walls.
          const isFloor = hit && Math.abs(hit.point[2] - hit.free[2]) > 0.1 && hit.free[2] < 1.5;
          if (
            isTop &&
            isFloor &&
            hit.point[0] > low! &&
            hit.point[0] < high! &&
            hit.point[1] > 1.9 &&
            hit.point[1] < 3.6
          )
            return { x: box.left + x, y: box.top + y };
        }
      }
      return null;
    },
    [low, high],
  );
  return (await found.jsonValue())!;
}

/** A distance, and its parts along the axes. */
const MEASURED = /^([\d.]+) m \(x (-?[\d.]+), y (-?[\d.]+), z (-?[\d.]+)\)$/;

test("a map is measured, and gives a scenario that runs", async ({ page, servers }) => {
  const folder = mkdtempSync(join(temporaryFolder(), "map-"));
  const flags = ["--inside", "free", "--cell-m", "0.25"];
  await shown.open(page, await servers.map(cave(folder), folder, flags));
  await expect(page.getByTestId("map-title")).toHaveText("halls.obj");
  await expect(page.getByTestId("playback-bar")).toBeHidden();

  // The panels have their place now, and the image is drawn in the size that they leave to it.
  await shown.showAt(page, 0);
  const first = await wallWithin(page, 1, 3.5);
  const second = await wallWithin(page, 7.5, 9.5);
  await page.getByText("Measure", { exact: true }).click();
  for (const { x, y } of [first, second]) await page.mouse.click(x, y);
  await expect(page.getByTestId("measured")).toHaveText(MEASURED);
  const text = (await page.getByTestId("measured").textContent())!;
  const [, distance, x, y, z] = MEASURED.exec(text)!;
  expect(Number(distance)).toBeCloseTo(Math.hypot(Number(x), Number(y), Number(z)), 1);
  expect(Number(x)).toBeGreaterThan(4);
  expect(Number(z)).toBe(0);

  // A wide body is kept out of the passage, as `maes map check` says.
  const bare = await shown.picture(page);
  await page.getByTestId("room-radius").fill("0.6");
  await page.getByTestId("room-radius").blur();
  await page.getByText("Show what a body reaches").click();
  await expect(page.getByTestId("fact-it-reaches")).toBeVisible();
  const checked = await servers.maes(["map", "check", "halls.obj", ...flags, "--radius-m", "0.6"], folder);
  const share = (name: string): string => new RegExp(`^${name}.*?([\\d.]+) %`, "m").exec(checked)![1]!;
  const near = async (testid: string, name: string): Promise<void> => {
    const said = Number.parseFloat((await page.getByTestId(testid).textContent())!);
    expect(Math.abs(said - Number(share(name)))).toBeLessThanOrEqual(0.1);
  };
  await near("fact-a-body-fits-in", "body");
  await near("fact-it-reaches", "reachable");
  shown.expectOther(bare, await shown.picture(page), "with what a body reaches");

  await page.getByText("Start", { exact: true }).click();
  for (const { x, y } of [first, second]) await page.mouse.click(x, y);
  const starts = page.getByTestId("room-starts").locator("li");
  await expect(starts).toHaveCount(2);
  // Both halls together.
  await near("fact-it-reaches", "body");
  await page.screenshot({ path: join(temporaryFolder(), "map.png") });
  const [download] = await Promise.all([
    page.waitForEvent("download"),
    page.getByTestId("room-download").click(),
  ]);
  expect(download.suggestedFilename()).toBe("halls.toml");
  await download.saveAs(join(folder, "halls.toml"));
  const scenario = readFileSync(join(folder, "halls.toml"), "utf8");
  expect(await page.getByTestId("room-scenario").textContent()).toBe(scenario);
  const run = ["run", "halls.toml", "--transport", "memory", "--duration", "2"];
  expect(await servers.maes(run, folder)).toMatch(/^digest: [0-9a-f]{64}$/m);

  await starts.first().getByRole("button").click();
  await expect(starts).toHaveCount(1);
  await page.getByTestId("room-radius").fill("90");
  await page.getByTestId("room-radius").blur();
  await expect(page.getByTestId("room-problem")).toContainText("allowed is above 0 to 4 m");
});
