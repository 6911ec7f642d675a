import { describe, expect, it } from "vitest";
import { bytes, clockTime, count, finePercent, heading, metres, speedFactor, percent } from "./format.ts";

describe("times", () => {
  it("are mm:ss, and h:mm:ss from an hour on", () => {
    expect(clockTime(0)).toBe("00:00");
    expect(clockTime(65.9)).toBe("01:05");
    expect(clockTime(3599.99)).toBe("59:59");
    expect(clockTime(3600)).toBe("1:00:00");
    expect(clockTime(7384)).toBe("2:03:04");
  });

  it("do not lose a second to rounding", () => {
    expect(clockTime(150 * 0.02 * 20)).toBe("01:00");
    expect(clockTime(0.1 + 0.2 + 0.7 - 1e-12)).toBe("00:01");
  });

  it("are never negative, and have a text for NaN", () => {
    expect(clockTime(-3)).toBe("00:00");
    expect(clockTime(NaN)).toBe("--:--");
  });
});

describe("shares", () => {
  it("are never rounded up to 100 %", () => {
    expect(percent(0.99999)).toBe("99 %");
    expect(percent(1)).toBe("100 %");
    expect(finePercent(0.99999)).toBe("99.99 %");
    expect(finePercent(1)).toBe("100.0 %");
  });

  it("keep exact values", () => {
    expect(percent(0.57)).toBe("57 %");
    expect(percent(0.29, 1)).toBe("29.0 %");
    expect(percent(NaN)).toBe("- %");
  });
});

describe("amounts", () => {
  it("have suitable units", () => {
    expect(bytes(999)).toBe("999 B");
    expect(bytes(1000)).toBe("1.0 kB");
    expect(bytes(999_600)).toBe("1.0 MB");
    expect(bytes(123_456_789)).toBe("123 MB");
    expect(metres(Infinity)).toBe("unlimited");
    expect(metres(1234)).toBe("1.23 km");
    expect(count(1234567)).toBe("1\u202f234\u202f567");
  });

  it("of speed are factors", () => {
    expect([0, 0.25, 1, 2.5, 9.96, 100].map(speedFactor)).toEqual([
      "max",
      "0.25x",
      "1x",
      "2.5x",
      "10x",
      "100x",
    ]);
  });

  it("of angles are within one turn", () => {
    expect([0, -Math.PI / 2, 2 * Math.PI - 1e-9].map(heading)).toEqual(["0°", "270°", "0°"]);
  });
});
