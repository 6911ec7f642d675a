/**
 * Takes a picture of the whole page in headless Chromium, for docs/images/viewer.sh:
 *
 *     node docs/images/page.mjs URL SECONDS WIDTHxHEIGHT OUT.jpg
 */
/* global window -- inside the page */
import process from "node:process";
import { chromiumIn } from "../../viewer/pictures/programs.mjs";
import { chromium } from "../../viewer/node_modules/playwright-core/index.mjs";

const [url, seconds, size, out] = process.argv.slice(2);
const [width, height] = size.split("x").map(Number);
const browser = await chromium.launch({
  executablePath: chromiumIn(process.env),
  args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});
const page = await browser.newPage({ viewport: { width, height } });
page.setDefaultTimeout(0);
await page.goto(url);
const sideOf = async (name) => (await page.waitForSelector(`[data-testid=${name}]`)).contentFrame();
const sides = new URL(url).searchParams.has("beside") ? ["side-1", "side-2"] : [];
const frames = sides.length === 0 ? [page] : await Promise.all(sides.map(sideOf));
for (const frame of frames) {
  await frame.waitForFunction(() => window.maes?.run?.isComplete);
  await frame.evaluate((timeS) => window.maes.showAt(timeS), Number(seconds));
}
await page.screenshot({ path: out, type: "jpeg", quality: 88 });
await browser.close();
