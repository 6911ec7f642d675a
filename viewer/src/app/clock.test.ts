import { describe, expect, it } from "vitest";
import { Clock, FOLLOW_LAG_S } from "./clock.ts";

describe("a recording", () => {
  it("is played at its rate and stops at the end", () => {
    const clock = new Clock();
    clock.rate = 4;
    clock.play(10, true);
    clock.advance(100, 10, true, false);
    clock.advance(100.5, 10, true, false);
    expect(clock.timeS).toBeCloseTo(2, 9);
    for (let wallS = 101; wallS < 110; wallS += 0.5) clock.advance(wallS, 10, true, false);
    expect(clock.timeS).toBe(10);
    expect(clock.isPlaying).toBe(false);
    expect(clock.isMoving).toBe(false);
  });

  it("restarts when it is played at its end", () => {
    const clock = new Clock();
    clock.seek(99, 10);
    expect(clock.timeS).toBe(10);
    clock.play(10, true);
    expect(clock.timeS).toBe(0);
  });

  it("keeps a time beyond its end for a longer one beside it", () => {
    const clock = new Clock();
    clock.seek(30, 10);
    expect([clock.timeS, clock.wantedS]).toEqual([10, 30]);
    clock.seek(Infinity, 10);
    expect([clock.timeS, clock.wantedS]).toEqual([10, 10]);
    clock.seek(30, 10);
    clock.play(10, true);
    expect([clock.timeS, clock.wantedS]).toEqual([0, 0]);
  });

  it("waits for unread data", () => {
    const clock = new Clock();
    clock.rate = 100;
    clock.play(5, false);
    clock.advance(0, 5, false, false);
    clock.advance(0.9, 5, false, false);
    expect(clock.timeS).toBe(5);
    expect(clock.isPlaying).toBe(true);
    clock.advance(1, 50, false, false);
    expect(clock.timeS).toBeCloseTo(15, 9);
  });

  it("shows a time beyond what was read once it is read", () => {
    const clock = new Clock();
    clock.seek(20, 5, true);
    expect([clock.timeS, clock.wantedS]).toEqual([5, 20]);
    clock.isPlaying = true;
    clock.advance(0, 12, false, false);
    expect([clock.timeS, clock.wantedS]).toEqual([12, 20]);
    clock.advance(0.1, 25, false, false);
    expect([clock.timeS, clock.wantedS]).toEqual([20, 20]);
    // From there on it plays.
    clock.advance(0.2, 25, false, false);
    expect(clock.timeS).toBeCloseTo(21, 9);
    clock.seek(99, 25, true);
    clock.advance(0.3, 30, true, false);
    expect([clock.timeS, clock.wantedS, clock.isAwaiting]).toEqual([30, 30, false]);
  });

  it("does not skip the time while the page was hidden", () => {
    const clock = new Clock();
    clock.rate = 1;
    clock.play(1000, true);
    clock.advance(0, 1000, true, false);
    clock.advance(600, 1000, true, false);
    expect(clock.timeS).toBe(1);
  });
});

describe("following", () => {
  /** End of a run at a constant speed whose updates arrive every `burstS` seconds. */
  const endAt = (wallS: number, pace: number, burstS: number) =>
    pace * Math.floor(wallS / burstS + 1e-9) * burstS;

  it("lags behind the end smoothly, though updates arrive in bursts", () => {
    const clock = new Clock();
    clock.follow();
    const times: number[] = [];
    for (let frame = 0; frame <= 300; frame++) {
      const wallS = frame / 60;
      const endS = endAt(wallS, 10, 0.05);
      clock.advance(wallS, endS, false, true);
      expect(clock.timeS).toBeLessThanOrEqual(endS);
      times.push(clock.timeS);
    }
    const steps = times.slice(61).map((timeS, index) => timeS - times[index + 60]!);
    for (const step of steps) expect(step).toBeCloseTo(10 / 60, 9);
    expect(times.at(-1)).toBeCloseTo(10 * (5 - FOLLOW_LAG_S), 6);
    expect(clock.realTimeFactor).toBeCloseTo(10, 6);
  });

  it("reaches the end of a paused run and stops", () => {
    const clock = new Clock();
    clock.follow();
    for (let frame = 0; frame <= 60; frame++) clock.advance(frame / 60, frame / 60, false, true);
    expect(clock.isMoving).toBe(true);
    for (let frame = 61; frame <= 90; frame++) clock.advance(frame / 60, 1, false, true);
    expect(clock.timeS).toBe(1);
    expect(clock.isMoving).toBe(false);
  });

  it("ends with a seek, and resumes when playback reaches the end", () => {
    const clock = new Clock();
    clock.follow();
    clock.advance(0, 100, false, true);
    clock.seek(40, 100);
    expect(clock.isFollowing).toBe(false);
    clock.rate = 100;
    clock.play(100, false);
    clock.advance(1, 100, false, true);
    expect(clock.isFollowing).toBe(true);
  });

  it("measures 0 without updates", () => {
    const clock = new Clock();
    clock.follow();
    for (let frame = 0; frame <= 60 * 8; frame++) clock.advance(frame / 60, 77, false, true);
    expect(clock.realTimeFactor).toBe(0);
  });

  it("does not jump when a run resumes", () => {
    const clock = new Clock();
    clock.follow();
    let before = 0;
    for (let frame = 0; frame <= 600; frame++) {
      const wallS = frame / 60;
      clock.advance(wallS, wallS < 8 ? 1 : 1 + (wallS - 8), false, true);
      if (frame > 30) expect(clock.timeS - before).toBeLessThan(0.02);
      before = clock.timeS;
    }
    expect(before).toBeGreaterThan(2);
  });
});
