import { describe, expect, it } from "vitest";
import { NEVER } from "../data/run.ts";
import { shiftFor, TimesVolume } from "./volumes.ts";

describe("times of cells as a texture", () => {
  it("are the run's own array where the graphics can hold it", () => {
    const times = new Uint32Array(30).fill(NEVER);
    const volume = new TimesVolume(times, [5, 3, 2], () => true, 2048);
    expect(volume.shift).toBe(0);
    expect(volume.texture.image.data).toBe(times);
    expect([volume.texture.image.width, volume.texture.image.height, volume.texture.image.depth]).toEqual([
      5, 3, 2,
    ]);
  });

  it("are those of blocks, the earliest of the cells that count, where it cannot", () => {
    const times = new Uint32Array(5 * 3 * 2).fill(NEVER);
    times[0] = 9;
    times[6] = 4;
    times[1] = 2;
    const volume = new TimesVolume(times, [5, 3, 2], (cell) => cell !== 1, 4);
    expect(volume.shift).toBe(1);
    const texels = (): number[] => [...(volume.texture.image.data as unknown as Uint32Array)];
    expect(texels()).toEqual([4, NEVER, NEVER, NEVER, NEVER, NEVER]);
    times[29] = 7;
    volume.learn([29]);
    expect(texels()).toEqual([4, NEVER, NEVER, NEVER, NEVER, 7]);
    times.fill(NEVER);
    volume.learnAll();
    expect(texels()).toEqual([NEVER, NEVER, NEVER, NEVER, NEVER, NEVER]);
  });

  it("get coarser until both the edges and the whole fit", () => {
    expect(shiftFor([100, 100, 100], 2048)).toBe(0);
    expect(shiftFor([512, 512, 512], 2048)).toBe(1);
    expect(shiftFor([1024, 1024, 1024], 2048)).toBe(2);
    expect(shiftFor([1024, 30, 30], 256)).toBe(2);
  });
});
