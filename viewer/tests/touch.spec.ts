/** Fingers: one rotates the view, two zoom it, and a tap selects. */
import type { CDPSession, Page } from "@playwright/test";
import { expect, test } from "./support/fixtures.ts";
import { recording } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

test.use({ hasTouch: true });

interface Point {
  readonly x: number;
  readonly y: number;
}

/** Moves fingers from their first places to their last ones. */
async function drag(device: CDPSession, from: readonly Point[], to: readonly Point[]): Promise<void> {
  const send = (type: "touchStart" | "touchMove" | "touchEnd", touchPoints: readonly Point[]) =>
    device.send("Input.dispatchTouchEvent", {
      type,
      touchPoints: touchPoints.map((at, id) => ({ ...at, id })),
    });
  await send("touchStart", from);
  const steps = 8;
  for (let step = 1; step <= steps; step++) {
    const between = (a: number, b: number) => a + ((b - a) * step) / steps;
    await send(
      "touchMove",
      from.map(({ x, y }, finger) => ({ x: between(x, to[finger]!.x), y: between(y, to[finger]!.y) })),
    );
  }
  await send("touchEnd", []);
}

const orbitOf = (page: Page) => page.evaluate(() => window.maes!.scene!.orbit);

test("fingers rotate, zoom and select", async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(recording("cave")));
  const device = await page.context().newCDPSession(page);
  const before = await orbitOf(page);

  await drag(device, [{ x: 300, y: 300 }], [{ x: 380, y: 270 }]);
  await expect.poll(async () => (await orbitOf(page)).yawRad).not.toBeCloseTo(before.yawRad, 2);
  const turned = await orbitOf(page);
  expect(turned.distanceM).toBeCloseTo(before.distanceM, 6);

  const near = [
    { x: 280, y: 300 },
    { x: 340, y: 300 },
  ];
  const apart = [
    { x: 220, y: 300 },
    { x: 400, y: 300 },
  ];
  await drag(device, near, apart);
  await expect.poll(async () => (await orbitOf(page)).distanceM).toBeLessThan(turned.distanceM * 0.6);
  const zoomed = await orbitOf(page);
  await drag(device, apart, near);
  await expect.poll(async () => (await orbitOf(page)).distanceM).toBeGreaterThan(zoomed.distanceM * 1.6);

  // The agent that was touched, or one in front of it.
  await shown.showAt(page, 60);
  const [x, y] = await page.evaluate(() =>
    window.maes!.scene!.project(window.maes!.run!.agentAt(1, 60).position),
  );
  const box = (await page.getByTestId("canvas").boundingBox())!;
  const picked = await page.evaluate(([x, y]) => window.maes!.scene!.pick(x, y), [x, y] as const);
  expect(picked).not.toBeNull();
  await page.touchscreen.tap(box.x + x, box.y + y);
  await expect.poll(() => page.evaluate(() => window.maes!.state.selected)).toBe(picked);
});
