import { describe, expect, it } from "vitest";
import type { Vec3 } from "../data/run.ts";
import {
  between,
  distanceToFit,
  cameraPositionOf,
  FIELD_OF_VIEW_RAD,
  viewDirectionOf,
  panned,
  rightOf,
  shorterTurnRad,
  turned,
  zoomed,
  type Orbit,
} from "./orbit.ts";

const ORBIT: Orbit = { centre: [10, -4, 3], yawRad: 0.7, pitchRad: 0.4, distanceM: 25 };

const dot = (a: Vec3, b: Vec3): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const minus = (a: Vec3, b: Vec3): Vec3 => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];

describe("an orbit", () => {
  it("looks at its centre from its distance", () => {
    const offset = minus(ORBIT.centre, cameraPositionOf(ORBIT));
    expect(Math.hypot(...offset)).toBeCloseTo(25);
    expect(dot(offset, viewDirectionOf(ORBIT))).toBeCloseTo(25);
    expect(dot(viewDirectionOf(ORBIT), rightOf(ORBIT))).toBeCloseTo(0);
  });

  it("looks along +x with +y to the left at yaw 0", () => {
    const level: Orbit = { ...ORBIT, yawRad: 0, pitchRad: 0 };
    expect(viewDirectionOf(level).map((value) => value + 0)).toEqual([1, 0, 0]);
    expect(rightOf(level)[1]).toBe(-1);
  });

  it("rotates so that the foreground follows the pointer", () => {
    const front = cameraPositionOf({ ...ORBIT, distanceM: 5 });
    const after = turned(ORBIT, 0.01, 0.01);
    const moved = minus(front, ORBIT.centre);
    expect(dot(moved, rightOf(after))).toBeGreaterThan(0);
    expect(cameraPositionOf(after)[2]).toBeGreaterThan(cameraPositionOf(ORBIT)[2]);
  });

  it("never looks straight up or down", () => {
    for (const down of [-9, 9]) expect(Math.abs(turned(ORBIT, 0, down).pitchRad)).toBeLessThan(Math.PI / 2);
  });

  it("pans across the line of sight, by the pointer's span at the centre", () => {
    const after = panned(ORBIT, 0.5, 0.25);
    const offset = minus(after.centre, ORBIT.centre);
    const height = 2 * Math.tan(FIELD_OF_VIEW_RAD / 2) * 25;
    expect(dot(offset, viewDirectionOf(ORBIT))).toBeCloseTo(0);
    expect(dot(offset, rightOf(ORBIT))).toBeCloseTo(-0.5 * height);
    expect(offset[2]).toBeGreaterThan(0);
    expect(Math.hypot(...offset)).toBeCloseTo(height * Math.hypot(0.5, 0.25));
  });

  it("respects the zoom limits", () => {
    expect(zoomed(ORBIT, 0.001, [2, 80]).distanceM).toBe(2);
    expect(zoomed(ORBIT, 1000, [2, 80]).distanceM).toBe(80);
    expect(zoomed(ORBIT, 2, [2, 80]).distanceM).toBe(50);
  });
});

describe("a flight", () => {
  const there: Orbit = { centre: [0, 0, 0], yawRad: -2.8, pitchRad: 0.1, distanceM: 100 };

  it("starts and ends at the given poses", () => {
    expect(between(ORBIT, there, 0)).toEqual(ORBIT);
    expect(between(ORBIT, there, 1)).toBe(there);
    expect(between(ORBIT, there, 7)).toBe(there);
  });

  it("takes the shorter rotation", () => {
    const from: Orbit = { ...ORBIT, yawRad: 3 };
    const middle = between(from, there, 0.5);
    expect(middle.yawRad).toBeCloseTo(3 + (2 * Math.PI - 5.8) / 2);
    expect(middle.distanceM).toBeCloseTo(50);
    expect(shorterTurnRad(0, 4)).toBeCloseTo(4 - 2 * Math.PI);
    expect(shorterTurnRad(5, -5)).toBeCloseTo(-10 + 4 * Math.PI);
  });
});

describe("distance to fit", () => {
  it.each([
    [0.9, 0.4, 1.6],
    [0, 1.2, 0.5],
    [-2, -0.3, 3],
  ])(
    "shows every corner of the box, one at the edge (yaw %f, pitch %f, aspect %f)",
    (yawRad, pitchRad, aspect) => {
      const extent: Vec3 = [60, 40, 13];
      const orbit: Orbit = { centre: [0, 0, 0], yawRad, pitchRad, distanceM: 1 };
      const fitted = { ...orbit, distanceM: distanceToFit(orbit, extent, aspect) };
      const [look, right, eye] = [viewDirectionOf(fitted), rightOf(fitted), cameraPositionOf(fitted)];
      const tan = Math.tan(FIELD_OF_VIEW_RAD / 2);
      const shares = [0, 1, 2, 3, 4, 5, 6, 7].map((bits) => {
        const corner = extent.map((value, axis) => ((bits >> axis) & 1 ? value : -value) / 2) as Vec3;
        const offset = minus(corner, eye);
        const depth = dot(offset, look);
        const across = dot(offset, right);
        const up = Math.sqrt(Math.max(dot(offset, offset) - depth ** 2 - across ** 2, 0));
        return Math.max(Math.abs(across) / (depth * tan * aspect), up / (depth * tan));
      });
      expect(Math.max(...shares)).toBeCloseTo(1);
    },
  );
});
