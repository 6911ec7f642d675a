/** What a page shows: image, state, texts. */
import type { Page } from "@playwright/test";
import type {} from "../../src/app/handle.ts";
import { expect } from "./fixtures.ts";

/** Hides the parts over the image. */
const WITHOUT_PANELS = ".float, .caption, .banners, .tl-hint { visibility: hidden !important; }";

/** Opens an address and waits for the first frame. */
export async function open(page: Page, url: string): Promise<void> {
  await page.goto(url);
  await ready(page);
}

export async function ready(page: Page): Promise<void> {
  await page.evaluate(() => window.maes!.ready);
}

/** Opens a recording and waits until it has been read completely. */
export async function openWhole(page: Page, url: string): Promise<void> {
  await open(page, url);
  await page.waitForFunction(() => window.maes?.run?.isComplete);
  await expect(page.getByTestId("time-end")).toHaveText(` / ${clock(await endOf(page))}`);
}

/** mm:ss, the page's format of times below an hour. */
export function clock(timeS: number): string {
  const seconds = Math.floor(timeS + 1e-6);
  const two = (value: number): string => String(value).padStart(2, "0");
  return `${two(Math.floor(seconds / 60))}:${two(seconds % 60)}`;
}

/** A share in the page's format, rounded down to `places` decimals. */
export function percent(share: number, places: number): string {
  return `${(Math.floor(share * 100 * 10 ** places + 1e-7) / 10 ** places).toFixed(places)} %`;
}

/** The same, with another decimal close to 100 %. */
export function finePercent(share: number): string {
  return percent(share, share >= 0.99 && share < 1 ? 2 : 1);
}

/** Pauses the page at a time and waits for the frame. */
export async function showAt(page: Page, timeS: number): Promise<void> {
  await page.evaluate((time) => window.maes!.showAt(time), timeS);
}

/** The complete image of a time, without the panels over it: a PNG. */
export async function pictureAt(page: Page, timeS: number): Promise<Buffer> {
  await showAt(page, timeS);
  return picture(page);
}

/** The present image, without the panels over it: a PNG. */
export function picture(page: Page): Promise<Buffer> {
  return page.getByTestId("canvas").screenshot({ style: WITHOUT_PANELS });
}

/** Compares two images to the last pixel, without printing their bytes. */
export function expectSame(a: Buffer, b: Buffer, what: string): void {
  expect(a.equals(b), `${what}: the same picture`).toBe(true);
}

export function expectOther(a: Buffer, b: Buffer, what: string): void {
  expect(a.equals(b), `${what}: another picture`).toBe(false);
}

/** The time shown. */
export function timeOf(page: Page): Promise<number> {
  return page.evaluate(() => window.maes!.state.timeS);
}

/** Waits until a time is shown. */
export async function expectTime(page: Page, timeS: number): Promise<void> {
  await expect.poll(() => timeOf(page)).toBeCloseTo(timeS, 6);
}

/** End of the known part of the run. */
export function endOf(page: Page): Promise<number> {
  return page.evaluate(() => window.maes!.run!.endS);
}

/** mm:ss of mm:ss.cc. */
export function whole(time: string): string {
  return time.replace(/\.\d+$/, "");
}

/** Seconds of mm:ss.cc. */
export function secondsOf(time: string): number {
  return time.split(":").reduce((sum, part) => sum * 60 + Number(part), 0);
}
