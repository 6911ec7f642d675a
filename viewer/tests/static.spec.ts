/** The page on a static web server: no simulator, and no attempt to reach one. */
import { cpSync, mkdtempSync } from "node:fs";
import { join } from "node:path";
import type { Frame, Page } from "@playwright/test";
import { expect, test } from "./support/fixtures.ts";
import { PAGE } from "./support/paths.ts";
import { recording, temporaryFolder } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

/** Collects errors of the console, and the addresses of WebSockets. */
function troublesOf(page: Page): string[] {
  const troubles: string[] = [];
  page.on("console", (message) => message.type() === "error" && troubles.push(message.text()));
  page.on("websocket", (socket) => troubles.push(socket.url()));
  return troubles;
}

/** The page and two recordings, as `launch_scripts/site.sh` lays them out. */
function site(): string {
  const folder = mkdtempSync(join(temporaryFolder(), "site-"));
  cpSync(PAGE, folder, { recursive: true });
  for (const name of ["cave", "radio"] as const) {
    cpSync(recording(name), join(folder, `recording/${name}.mcap`));
  }
  return folder;
}

/** Plays a recording for a while. */
async function play(frame: Page | Frame): Promise<void> {
  await frame.waitForFunction(() => window.maes?.run?.isComplete);
  await frame.getByTestId("play").click();
  await frame.waitForFunction(() => window.maes!.state.timeS > 1);
}

/** The frames of two recordings side by side, each with its own page, not its first empty document. */
async function sidesOf(page: Page): Promise<Frame[]> {
  const sides = [page.getByTestId("side-1"), page.getByTestId("side-2")].map(async (side) => {
    const frame = (await (await side.elementHandle())!.contentFrame())!;
    await frame.waitForURL((url) => url.protocol === "http:");
    return frame;
  });
  return Promise.all(sides);
}

test("plays one recording and two", async ({ page, servers }) => {
  const troubles = troublesOf(page);
  const address = await servers.folder(site());
  await shown.openWhole(page, `${address}?recording=recording/cave.mcap`);
  await play(page);
  await expect(page.getByTestId("run-title")).toHaveText("cave.mcap");

  await page.goto(`${address}?recording=recording/cave.mcap&beside=recording/radio.mcap`);
  const [cave, radio] = await sidesOf(page);
  await radio!.waitForFunction(() => window.maes?.run?.isComplete);
  await play(cave!);
  await radio!.waitForFunction(() => window.maes!.state.timeS > 1);
  await expect(radio!.getByTestId("run-title")).toHaveText("radio.mcap");
  expect(troubles).toEqual([]);
});

test("plays an exported recording", async ({ page, servers }) => {
  const folder = join(temporaryFolder(), "exported one");
  const output = await servers.export(folder, recording("cave"));
  const query = new URL(output.at(-1)!).search;
  const troubles = troublesOf(page);
  const address = await servers.folder(folder);
  await shown.openWhole(page, address);
  expect(page.url()).toBe(`${address}${query}`);
  await play(page);

  // A link without a recording has that of the folder.
  await shown.openWhole(page, `${address}?time=20&agent=1`);
  await shown.expectTime(page, 20);
  expect(page.url()).toBe(`${address}${query}&time=20&agent=1`);
  expect(troubles).toEqual([]);

  const again = servers.export(folder, recording("cave"));
  await expect(again).rejects.toThrow(`--export ${folder}: not empty; expected a new or an empty folder`);
});

test("plays two exported recordings", async ({ page, servers }) => {
  const folder = join(mkdtempSync(join(temporaryFolder(), "exported-")), "two");
  const output = await servers.export(folder, recording("cave"), recording("radio"));
  expect(output.at(-1)).toContain("?recording=recording/cave.mcap&beside=beside/radio.mcap");
  const troubles = troublesOf(page);
  await page.goto(await servers.folder(folder));
  const [cave, radio] = await sidesOf(page);
  await radio!.waitForFunction(() => window.maes?.run?.isComplete);
  await play(cave!);
  await expect(radio!.getByTestId("run-title")).toHaveText("radio.mcap");
  expect(troubles).toEqual([]);
});
