/**
 * View controls: layers, cuts, camera, selection, and the settings that persist.
 *
 * Every control changes the image, and resetting it restores the image to the last pixel.
 */
import type { Page } from "@playwright/test";
import { expect, LONG, test } from "./support/fixtures.ts";
import { recording } from "./support/recordings.ts";
import * as shown from "./support/shown.ts";

const FILE = recording("radio");

/** Half of the cave is explored then, agents follow paths, and some are in contact. */
const TIME_S = 20;
/** An agent with contacts then. */
const AGENT = 1;

const LAYERS = [
  "walls",
  "unexplored",
  "covered",
  "heat",
  "trails",
  "paths",
  "contacts",
  "hits",
  "belief",
  "labels",
] as const;

const isOn = (page: Page, layer: (typeof LAYERS)[number]): Promise<boolean> =>
  page.evaluate((name) => window.maes!.scene!.view.layers[name], layer);

const selectedIn = (page: Page): Promise<number | null> =>
  page.evaluate(() => {
    const { state, scene } = window.maes!;
    if (state.selected !== scene!.selected) throw new Error("The page and its scene disagree");
    return state.selected;
  });

const expectSelected = (page: Page, agent: number | null): Promise<void> =>
  expect.poll(() => selectedIn(page)).toBe(agent);

test("every layer can be shown and hidden", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, `${await servers.view(FILE)}&agent=${AGENT}`);
  await page.getByTestId("toolbar-layers").click();
  await expect(page.getByTestId("layers-panel")).toBeVisible();
  // Far enough from the agent that every layer is visible in the image.
  await shown.showAt(page, TIME_S);
  await page.getByTestId("canvas").hover();
  for (let turn = 0; turn < 4; turn++) await page.mouse.wheel(0, 240);
  const before = await shown.pictureAt(page, TIME_S);
  for (const layer of LAYERS) {
    const input = page.getByTestId(`layer-${layer}`);
    const was = await isOn(page, layer);
    await expect(input).toBeChecked({ checked: was });
    await input.click();
    expect(await isOn(page, layer), layer).toBe(!was);
    shown.expectOther(before, await shown.pictureAt(page, TIME_S), `${layer} ${was ? "off" : "on"}`);
    await input.click();
    shown.expectSame(before, await shown.pictureAt(page, TIME_S), `${layer} put back`);
  }
});

test("walls become solid, and the cave is cut open along each axis", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await page.keyboard.press("l");
  const before = await shown.pictureAt(page, TIME_S);

  const opacity = page.getByTestId("wall-opacity");
  const had = await opacity.inputValue();
  const pictures = [before];
  for (const value of ["0", "0.5", "1"]) {
    await opacity.fill(value);
    const picture = await shown.pictureAt(page, TIME_S);
    for (const other of pictures) shown.expectOther(other, picture, `near walls at ${value}`);
    pictures.push(picture);
  }
  await opacity.fill(had);
  shown.expectSame(before, await shown.pictureAt(page, TIME_S), "near walls put back");

  const cut = page.getByTestId("cut-share");
  await cut.fill("0.5");
  for (const axis of ["x", "y", "z"]) {
    await page.getByTestId(`cut-${axis}`).check();
    expect(await page.evaluate(() => window.maes!.scene!.view.cut)).toEqual({ axis, share: 0.5 });
    const picture = await shown.pictureAt(page, TIME_S);
    for (const other of pictures) shown.expectOther(other, picture, `cut along ${axis}`);
    pictures.push(picture);
  }
  await cut.fill("1");
  shown.expectSame(before, await shown.pictureAt(page, TIME_S), "cut put back");
});

test("unexplored cells have a switch and a key", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const before = await shown.pictureAt(page, TIME_S);
  const input = page.getByTestId("show-unexplored");
  await expect(input).toBeChecked();
  await input.click();
  shown.expectOther(before, await shown.pictureAt(page, TIME_S), "without what is unexplored");
  await page.keyboard.press("u");
  await expect(input).toBeChecked();
  shown.expectSame(before, await shown.pictureAt(page, TIME_S), "with it again");
});

test("agents are selected by buttons, keys, clicks and the table", async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const before = await shown.pictureAt(page, TIME_S);

  // Through all of them, including the cave, and back.
  for (const agent of [0, 1, 2, 3, 4, null, 0]) {
    await page.getByTestId("camera-next").click();
    await expectSelected(page, agent);
  }
  for (const agent of [null, 4]) {
    await page.getByTestId("camera-prev").click();
    await expectSelected(page, agent);
  }
  await expect(page.getByTestId("camera-cave")).toHaveText("Agent 4");
  await page.getByTestId("camera-cave").click();
  await expectSelected(page, null);
  await expect(page.getByTestId("camera-cave")).toHaveText("Cave");

  for (const agent of [3, 0, 4]) {
    await page.keyboard.press(String(agent));
    await expectSelected(page, agent);
  }
  // There is no agent 9.
  await page.keyboard.press("9");
  await page.keyboard.press("[");
  await expectSelected(page, 3);
  await page.keyboard.press("]");
  await expectSelected(page, 4);
  shown.expectOther(before, await shown.pictureAt(page, TIME_S), "agent 4");
  await page.keyboard.press("Escape");
  await expectSelected(page, null);
  shown.expectSame(before, await shown.pictureAt(page, TIME_S), "the whole cave again");

  await page.getByTestId("agent-row-2").click();
  await expectSelected(page, 2);
  await page.getByTestId("agent-close").click();
  await expectSelected(page, null);

  // Clicks the image where the scene reports an agent.
  await shown.showAt(page, TIME_S);
  const place = await page.evaluate(() => {
    const scene = window.maes!.scene!;
    const { clientWidth, clientHeight } = scene.canvas;
    for (let y = 80; y < clientHeight - 80; y += 3) {
      for (let x = 40; x < clientWidth - 40; x += 3) {
        const agent = scene.pick(x, y);
        if (agent !== null) return { x, y, agent };
      }
    }
    return null;
  });
  expect(place, "an agent in the picture").not.toBeNull();
  await page.getByTestId("canvas").click({ position: { x: place!.x, y: place!.y } });
  await expectSelected(page, place!.agent);
});

test("the panel shows the state of the selected agent", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const fact = (name: string) => page.getByTestId(`fact-${name}`);
  const thousands = (value: number): string => String(value).replace(/\B(?=(\d{3})+(?!\d))/g, "\u202f");
  const place = (position: readonly number[]): string =>
    `${position.map((value) => value.toFixed(1)).join("  ")} m`;
  for (const timeS of [TIME_S, 60]) {
    for (const id of [0, AGENT, 4]) {
      await page.keyboard.press(String(id));
      await shown.showAt(page, timeS);
      const agent = await page.evaluate(([id, timeS]) => window.maes!.run!.agentAt(id!, timeS!), [id, timeS]);
      expect(agent.info).not.toBe("");
      await expect(page.getByTestId("agent-title")).toHaveText(`Agent ${id}`);
      await expect(page.getByTestId("agent-info")).toHaveText(agent.info);
      await expect(fact("position")).toHaveText(place(agent.position), { useInnerText: true });
      await expect(fact("contacts")).toHaveText(agent.contacts.join(", ") || "none");
      await expect(fact("sent")).toContainText(`${thousands(agent.sent.messages)} messages`);
      await expect(fact("received")).toContainText(`${thousands(agent.received.messages)} messages`);
      await expect(fact("speed")).toHaveText(`${agent.speedMS.toFixed(2)} m/s`);
      await expect(fact("target")).toHaveText(place(agent.path.at(-1)!), { useInnerText: true });
      await expect(fact("controller")).toContainText("lvd");
    }
  }
});

test("dragging rotates the view and the wheel zooms", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const before = await shown.pictureAt(page, TIME_S);
  const box = (await page.getByTestId("canvas").boundingBox())!;
  const middle = { x: box.x + box.width / 2, y: box.y + box.height / 2 };
  const drag = async (): Promise<void> => {
    await page.mouse.move(middle.x, middle.y);
    await page.mouse.down();
    await page.mouse.move(middle.x + 120, middle.y + 40, { steps: 3 });
    await page.mouse.up();
  };

  await drag();
  const turned = await shown.pictureAt(page, TIME_S);
  shown.expectOther(before, turned, "turned");
  expect(await selectedIn(page), "a drag selects nothing").toBeNull();
  await page.keyboard.down("Shift");
  await drag();
  await page.keyboard.up("Shift");
  const moved = await shown.pictureAt(page, TIME_S);
  shown.expectOther(turned, moved, "moved");
  await page.mouse.wheel(0, -300);
  const nearer = await shown.pictureAt(page, TIME_S);
  shown.expectOther(moved, nearer, "nearer");
  await page.mouse.wheel(0, 300);
  await page.keyboard.press("Escape");
  shown.expectSame(before, await shown.pictureAt(page, TIME_S), "the whole cave again");
});

test("keys rotate, pan and zoom the view", async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await shown.showAt(page, TIME_S);
  const orbit = () => page.evaluate(() => window.maes!.scene!.orbit);
  /** Presses a key, and waits until the pose differs. */
  const press = async (key: string) => {
    const before = await orbit();
    await page.keyboard.press(key);
    await expect.poll(orbit).not.toEqual(before);
    return [before, await orbit()] as const;
  };
  for (const [key, angle, sign] of [
    ["w", "pitchRad", 1],
    ["s", "pitchRad", -1],
    ["a", "yawRad", -1],
    ["d", "yawRad", 1],
  ] as const) {
    const [before, after] = await press(key);
    expect((after[angle] - before[angle]) * sign, key).toBeGreaterThan(0.05);
    expect({ ...after, [angle]: 0 }, key).toEqual({ ...before, [angle]: 0 });
  }
  for (const key of ["Shift+w", "Shift+a", "Shift+s", "Shift+d"]) {
    const [before, after] = await press(key);
    expect(after.centre, key).not.toEqual(before.centre);
    expect({ ...after, centre: 0 }, key).toEqual({ ...before, centre: 0 });
  }
  for (const [key, isNearer] of [
    ["+", true],
    ["=", true],
    ["-", false],
  ] as const) {
    const [before, after] = await press(key);
    expect(after.distanceM < before.distanceM, key).toBe(isNearer);
  }
  // The image follows, and no other key has a part in it.
  const turned = await shown.pictureAt(page, TIME_S);
  await press("d");
  shown.expectOther(turned, await shown.pictureAt(page, TIME_S), "turned");
  expect(await selectedIn(page)).toBeNull();
  await shown.expectTime(page, TIME_S);
});

test("a lost graphics context comes back with the same picture", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  const before = await shown.pictureAt(page, TIME_S);
  await page.evaluate(async () => {
    const { canvas } = window.maes!.scene!;
    const extension = canvas.getContext("webgl2")!.getExtension("WEBGL_lose_context")!;
    for (const [name, act] of [
      ["webglcontextlost", () => extension.loseContext()],
      ["webglcontextrestored", () => extension.restoreContext()],
    ] as const) {
      // A context can be restored once all listeners have heard of its loss.
      const happened = new Promise((resolve) =>
        canvas.addEventListener(name, () => setTimeout(resolve), { once: true }),
      );
      act();
      await happened;
    }
  });
  shown.expectSame(before, await shown.pictureAt(page, TIME_S), "after the loss");
});

test("labels are sharp in frames of few pixels", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await shown.showAt(page, TIME_S);
  const [full, reduced] = await page.evaluate((timeS) => {
    const { scene } = window.maes!;
    const { canvas } = scene!;
    const { width, height } = canvas.getBoundingClientRect();
    const gl = canvas.getContext("webgl2")!;
    // The text of labels is white; nothing else is, while no agent is selected.
    const drawn = (share: number) => {
      scene!.resize(width, height, devicePixelRatio, share);
      scene!.render(timeS);
      const pixels = new Uint8Array(canvas.width * canvas.height * 4);
      gl.readPixels(0, 0, canvas.width, canvas.height, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
      const white = [];
      let sum = 0;
      for (let at = 0; at < pixels.length; at += 4) {
        if (pixels[at]! > 250 && pixels[at + 1]! > 250 && pixels[at + 2]! > 250) white.push(at / 4);
        sum = (sum * 31 + pixels[at]!) % 2 ** 32;
      }
      return { size: [canvas.width, canvas.height], white, sum };
    };
    return [drawn(1), drawn(0.375)] as const;
  }, TIME_S);
  expect(reduced.sum, "the rest has fewer pixels").not.toBe(full.sum);
  expect(reduced.size).toEqual(full.size);
  expect(full.white.length).toBeGreaterThan(20);
  expect(reduced.white).toEqual(full.white);
});

test("help, statistics and panels can be toggled", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await page.keyboard.press("?");
  await expect(page.getByTestId("help")).toBeVisible();
  for (const text of ["Select an agent", "Zoom out and in", "Two fingers"]) {
    await expect(page.getByTestId("help")).toContainText(text);
  }
  // Keys belong to the dialog while it is open.
  await page.keyboard.press("2");
  await page.keyboard.press("Escape");
  await expect(page.getByTestId("help")).toBeHidden();
  expect(await selectedIn(page)).toBeNull();
  await page.getByTestId("toolbar-help").click();
  await page.getByTestId("help-close").click();
  await expect(page.getByTestId("help")).toBeHidden();

  await expect(page.getByTestId("render-stats")).toBeHidden();
  await page.keyboard.press("f");
  await expect(page.getByTestId("render-stats")).toContainText("triangles");
  await page.keyboard.press("f");
  await expect(page.getByTestId("render-stats")).toBeHidden();

  await page.keyboard.press("l");
  await expect(page.getByTestId("layers-panel")).toBeVisible();
  await page.getByTestId("layers-close").click();
  await expect(page.getByTestId("layers-panel")).toBeHidden();

  const width = async (): Promise<number> => (await page.getByTestId("canvas").boundingBox())!.width;
  const narrow = await width();
  await page.keyboard.press("p");
  await expect(page.getByTestId("side")).toBeHidden();
  expect(await width()).toBeGreaterThan(narrow);
  await page.getByTestId("toolbar-panel").click();
  await expect(page.getByTestId("side")).toBeVisible();
  await expect(page.getByTestId("toolbar-panel")).toHaveAttribute("aria-pressed", "true");
  expect(await width()).toBe(narrow);

  await expect(page.getByTestId("scenario")).toBeHidden();
  await page.getByTestId("scenario-card").getByText("Scenario").click();
  await expect(page.getByTestId("scenario")).toContainText("range_m = 15");
});

test("view settings persist", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await page.keyboard.press("l");
  await page.getByTestId("layer-heat").check();
  await page.getByTestId("layer-trails").uncheck();
  await page.getByTestId("wall-opacity").fill("0.4");
  await page.getByTestId("cut-y").check();
  await page.getByTestId("cut-share").fill("0.7");
  await page.getByTestId("rate").selectOption("50");
  await page.keyboard.press("f");
  const left = await shown.pictureAt(page, TIME_S);

  await page.reload();
  await shown.ready(page);
  await expect(page.getByTestId("layers-panel")).toBeVisible();
  await expect(page.getByTestId("render-stats")).toBeVisible();
  await expect(page.getByTestId("layer-heat")).toBeChecked();
  await expect(page.getByTestId("layer-trails")).not.toBeChecked();
  await expect(page.getByTestId("wall-opacity")).toHaveValue("0.4");
  await expect(page.getByTestId("cut-y")).toBeChecked();
  await expect(page.getByTestId("cut-share")).toHaveValue("0.7");
  await expect(page.getByTestId("rate")).toHaveValue("50");
  shown.expectSame(left, await shown.pictureAt(page, TIME_S), "before and after");
});

test("a page for captures has only the image and a caption", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await page.getByTestId("toolbar-layers").click();
  await page.getByTestId("layer-heat").check();
  await shown.open(page, `${page.url()}&picture=1&time=${TIME_S}`);
  await shown.expectTime(page, TIME_S);
  await shown.showAt(page, TIME_S);
  for (const part of ["side", "playback-bar", "camera-bar", "layers-panel"]) {
    await expect(page.getByTestId(part)).toBeHidden();
  }
  // Stored settings do not apply: captured images are the same everywhere.
  expect(await isOn(page, "heat")).toBe(false);
  const share = await page.evaluate((timeS) => {
    const { seenAt, terrain } = window.maes!.run!;
    return seenAt.call(window.maes!.run, timeS) / terrain.freeCells;
  }, TIME_S);
  await expect(page.getByTestId("caption")).toContainText(`00:20`);
  await expect(page.getByTestId("caption")).toContainText(`${shown.finePercent(share)} explored`);
});

test("a link shows the same view", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, `${await servers.view(FILE)}&agent=${AGENT}`);
  await page.getByTestId("toolbar-layers").click();
  await page.getByTestId("layer-trails").uncheck();
  await shown.showAt(page, TIME_S);
  await page.getByTestId("canvas").hover();
  await page.mouse.wheel(0, 240);
  await shown.showAt(page, TIME_S);
  const cameraOf = (): Promise<number[]> =>
    page.evaluate(() => {
      const { centre, yawRad, pitchRad, distanceM } = window.maes!.scene!.orbit;
      return [...centre, yawRad, pitchRad, distanceM];
    });
  const camera = await cameraOf();
  // Without the permission to write to the clipboard the page shows the link.
  await page.evaluate(() => {
    navigator.clipboard.writeText = () => Promise.reject(new Error("not allowed"));
  });
  await page.getByTestId("toolbar-link").click();
  const link = await page.getByTestId("share-link").innerText();
  expect(link).toContain(`time=${TIME_S}&agent=${AGENT}&layers=walls,unexplored,paths,labels&camera=`);
  expect(link).not.toContain("token");
  await page.evaluate(() => localStorage.clear());
  await shown.openWhole(page, link);
  await shown.expectTime(page, TIME_S);
  await expectSelected(page, AGENT);
  expect(await isOn(page, "trails")).toBe(false);
  // The link rounds to centimetres and tenths of a degree.
  (await cameraOf()).forEach((value, index) => expect(value).toBeCloseTo(camera[index]!, 2));
  expect(page.url()).toBe(link);
});

test("pictures and movies are saved", LONG, async ({ page, servers }) => {
  await shown.openWhole(page, await servers.view(FILE));
  await shown.showAt(page, TIME_S);
  const picture = page.waitForEvent("download");
  await page.getByTestId("toolbar-picture").click();
  expect((await picture).suggestedFilename()).toMatch(/-00m20s\.png$/);

  await page.getByTestId("toolbar-movie").click();
  await expect(page.getByTestId("toolbar-movie")).toHaveAttribute("aria-pressed", "true");
  const movie = page.waitForEvent("download");
  await page.getByTestId("toolbar-movie").click();
  expect((await movie).suggestedFilename()).toMatch(/\.(mp4|webm)$/);
  await expect(page.getByTestId("toolbar-movie")).toHaveAttribute("aria-pressed", "false");
});

test(
  "the legend explains the visible layers, and the scale follows the camera",
  LONG,
  async ({ page, servers }) => {
    await shown.openWhole(page, await servers.view(FILE));
    await shown.showAt(page, TIME_S);
    const legend = page.getByTestId("legend");
    await expect(legend).toContainText("unexplored cell");
    await expect(legend.getByText("visited cell")).toBeHidden();
    await page.keyboard.press("u");
    await expect(legend.getByText("unexplored cell")).toBeHidden();
    const lengthM = async (): Promise<number> =>
      Number.parseFloat(await page.getByTestId("scale").innerText());
    const far = await lengthM();
    expect(far).toBeGreaterThanOrEqual(1);
    await page.getByTestId("canvas").hover();
    for (let turn = 0; turn < 8; turn++) await page.mouse.wheel(0, -240);
    await shown.showAt(page, TIME_S);
    expect(await lengthM()).toBeLessThan(far);
  },
);
