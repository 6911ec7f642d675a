import { describe, expect, it } from "vitest";
import { FramePacer } from "./frame-pacer.ts";

describe("frame pacing", () => {
  it("leaves a pause between frames", () => {
    const pacer = new FramePacer();
    expect(pacer.mayBegin(0)).toBe(true);
    pacer.done(0, 100, true);
    expect(pacer.mayBegin(109)).toBe(false);
    expect(pacer.mayBegin(111)).toBe(true);
  });

  it("reduces the quality of slow frames, and restores it for quick ones", () => {
    const pacer = new FramePacer();
    const slow = (pictures: number): void => {
      for (let picture = 0; picture < pictures; picture++) pacer.done(0, 200, true);
    };
    expect(pacer.quality).toEqual({ share: 1, isCoarse: false });
    slow(3);
    expect(pacer.quality).toEqual({ share: 1, isCoarse: true });
    slow(3);
    expect(pacer.quality).toEqual({ share: 0.75, isCoarse: true });
    slow(30);
    const least = pacer.quality.share;
    expect(least).toBeLessThan(0.5);
    for (let picture = 0; picture < 39; picture++) pacer.done(0, 5, true);
    expect(pacer.quality.share).toBe(least);
    for (let picture = 0; picture < 1000; picture++) pacer.done(0, 5, true);
    expect(pacer.quality).toEqual({ share: 1, isCoarse: false });
  });

  it("starts at reduced quality in software, never in full detail", () => {
    const pacer = new FramePacer(true);
    expect(pacer.quality).toEqual({ share: 0.5, isCoarse: true });
    for (let picture = 0; picture < 1000; picture++) pacer.done(0, 5, true);
    expect(pacer.quality).toEqual({ share: 1, isCoarse: true });
  });

  it("reduces the quality at once for a very slow frame", () => {
    const pacer = new FramePacer();
    for (let picture = 0; picture < 2; picture++) pacer.done(0, 301, true);
    expect(pacer.quality.share).toBe(0.75);
    pacer.done(0, 100, true);
    expect(pacer.quality.share).toBe(0.75);
  });

  it("ignores a single slow frame, and frames of another quality", () => {
    const pacer = new FramePacer();
    for (let picture = 0; picture < 20; picture++) {
      pacer.done(0, picture % 3 === 0 ? 250 : 50, true);
      pacer.done(0, 900, false);
    }
    expect(pacer.quality.share).toBe(1);
  });
});
