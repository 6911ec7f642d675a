/** Errors are shown in words, and the page stays usable. */
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { McapWriter } from "@mcap/core";
import type { Page } from "@playwright/test";
import { expect, LONG, test } from "./support/fixtures.ts";
import { addressWith, SCENARIO } from "./support/paths.ts";
import { recording, temporaryFolder } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

const AGENTS = 5;

/** An MCAP file with other contents. */
async function foreignMcap(): Promise<Buffer> {
  const parts: Uint8Array[] = [];
  let length = 0n;
  const writer = new McapWriter({
    writable: {
      position: () => length,
      write: async (bytes) => {
        parts.push(bytes.slice());
        length += BigInt(bytes.length);
      },
    },
  });
  await writer.start({ profile: "", library: "another" });
  const schemaId = await writer.registerSchema({
    name: "std_msgs/msg/String",
    encoding: "ros2msg",
    data: new TextEncoder().encode("string data"),
  });
  const channelId = await writer.registerChannel({
    topic: "/chatter",
    messageEncoding: "cdr",
    schemaId,
    metadata: new Map(),
  });
  const data = new Uint8Array([0, 1, 0, 0, 3, 0, 0, 0, 104, 105, 0]);
  await writer.addMessage({ channelId, sequence: 0, logTime: 0n, publishTime: 0n, data });
  await writer.end();
  return Buffer.concat(parts);
}

async function choose(page: Page, name: string, content: Buffer): Promise<void> {
  const path = join(temporaryFolder(), name);
  writeFileSync(path, content);
  await page.getByTestId("file").setInputFiles(path);
}

test("other files are rejected with a message", LONG, async ({ page, servers }) => {
  await page.goto(addressWith(await servers.view(recording("cave")), { recording: "" }));
  const banner = page.getByTestId("banner-opening");
  for (const [name, content, expected] of [
    ["notes.mcap", Buffer.from("These are only some words.\n".repeat(20)), /MCAP/],
    ["empty.mcap", Buffer.alloc(0), /empty|MCAP/],
    ["other.mcap", await foreignMcap(), /recording/],
    ["start.mcap", readFileSync(recording("cave")).subarray(0, 100), /cut off after byte 100/],
  ] as const) {
    await choose(page, name, content);
    await expect(banner).toContainText(name);
    await expect(banner).toHaveText(expected);
    // Another recording can be opened.
    await expect(page.getByTestId("drop-zone")).toBeVisible();
    await page.getByTestId("banner-opening-close").click();
    await expect(banner).toBeHidden();
  }
  await page.getByTestId("file").setInputFiles(recording("cave"));
  await shown.ready(page);
  await expect(page.getByTestId("run-title")).toHaveText("cave.mcap");
  // A bad file does not replace the open run.
  await choose(page, "more.mcap", Buffer.from("no"));
  await expect(banner).toContainText("more.mcap");
  await expect(page.getByTestId("run-title")).toHaveText("cave.mcap");
});

test("a cut recording is shown up to the cut", async ({ page, servers }) => {
  await page.goto(addressWith(await servers.view(recording("cave")), { recording: "" }));
  const whole = readFileSync(recording("cave"));
  await choose(page, "cut.mcap", whole.subarray(0, Math.floor(whole.length / 2)));
  await shown.ready(page);
  await page.waitForFunction(() => window.maes!.run!.isComplete);
  await expect(page.getByTestId("banner-run")).toContainText("cut.mcap");
  const end = await shown.endOf(page);
  expect(end).toBeGreaterThan(20);
  expect(end).toBeLessThan(400);
  await page.keyboard.press("End");
  await shown.expectTime(page, end);
  const cut = await shown.pictureAt(page, 20);
  await page.getByTestId("file").setInputFiles(recording("cave"));
  await expect(page.getByTestId("run-title")).toHaveText("cave.mcap");
  await page.waitForFunction(() => window.maes!.run!.isComplete);
  await expect(page.getByTestId("banner-run")).toBeHidden();
  shown.expectSame(cut, await shown.pictureAt(page, 20), "20 s of a part and of the whole");
});

test("an unreachable address is reported", LONG, async ({ page, servers }) => {
  const url = await servers.view(recording("cave"));
  await page.goto(addressWith(url, { recording: "nothing.mcap" }));
  await expect(page.getByTestId("banner-opening")).toContainText("nothing.mcap");
  await expect(page.getByTestId("banner-opening")).toContainText("404");
  await expect(page.getByTestId("drop-zone")).toBeVisible();

  // Port 1 is closed.
  await page.goto(addressWith(url, { server: "127.0.0.1:1" }));
  await expect(page.getByTestId("banner-connection")).toContainText(
    "No simulator answers at ws://127.0.0.1:1",
  );
  await page.getByTestId("welcome-cancel").click();
  await expect(page.getByTestId("drop-zone")).toBeVisible();
  const name = new URL(url).searchParams.get("recording")!;
  await page.getByTestId("recording-url").fill(new URL(`/${name}`, url).href);
  await page.getByTestId("open-url").click();
  await shown.ready(page);
  await expect(page.getByTestId("run-title")).toHaveText(name.split("/").at(-1)!);
});

test("the page survives the death of its server", LONG, async ({ page, servers }) => {
  const flags = [SCENARIO, "--rtf", "5", "--set", "stop_when_explored=false"];
  const { server, url } = await servers.run(flags);
  const agents = servers.agents(AGENTS);
  await shown.open(page, url);
  await expect.poll(() => shown.endOf(page)).toBeGreaterThan(4);
  const id = await page.evaluate(() => window.maes!.run!.id);

  await server.kill();
  await agents.kill();
  await expect(page.getByTestId("run-state")).toHaveText("connection lost");
  await expect(page.getByTestId("banner-connection")).toContainText("was lost. Reconnecting.");
  await expect(page.getByTestId("sim-play")).toBeDisabled();
  // What was received stays available.
  expect(await page.evaluate(() => window.maes!.run!.id)).toBe(id);
  const end = await shown.endOf(page);
  await page.keyboard.press("Home");
  await shown.expectTime(page, 0);
  await page.keyboard.press("End");
  await shown.expectTime(page, end);

  await servers.run([...flags, "--seed", "2"], new URL(url).host);
  servers.agents(AGENTS);
  await expect.poll(() => page.evaluate(() => window.maes!.run!.id)).not.toBe(id);
  await expect(page.getByTestId("banner-connection")).toBeHidden();
  await expect(page.getByTestId("fact-seed")).toHaveText("2");
  await expect(page.getByTestId("run-state")).toHaveText("playing");
  await expect.poll(() => shown.timeOf(page)).toBeGreaterThan(1);
});
