import { describe, expect, it } from "vitest";
import type { Vec3 } from "../data/run.ts";
import { MapEdit } from "./map-edit.ts";

const hit = (free: Vec3) => ({ point: free, free });

describe("box of a change", () => {
  it("lies between two clicks, whichever comes first", () => {
    const edit = new MapEdit(() => undefined);
    edit.clicked(hit([1, 1, 1]));
    expect(edit.corners).toEqual([]);
    edit.setOn(true);
    edit.clicked(hit([4.5, 2.5, 3.5]));
    edit.clicked(null);
    expect(edit.box).toBeNull();
    edit.clicked(hit([1.5, 6.5, 3.5]));
    expect(edit.box).toEqual({ low: [1.5, 2.5, 3.5], high: [4.5, 6.5, 3.5] });
    edit.clicked(hit([7.5, 7.5, 7.5]));
    expect(edit.corners).toEqual([[7.5, 7.5, 7.5]]);
  });

  it("has the coordinates that are typed", () => {
    let changes = 0;
    const edit = new MapEdit(() => changes++);
    edit.setOn(true);
    edit.clicked(hit([1, 2, 3]));
    edit.setCoordinate(1, 2, 5);
    expect(edit.box).toEqual({ low: [1, 2, 3], high: [1, 2, 5] });
    edit.setCoordinate(0, 0, NaN);
    edit.setCoordinate(0, 0, 0.5);
    expect(edit.box).toEqual({ low: [0.5, 2, 3], high: [1, 2, 5] });
    expect(changes).toBe(4);
  });

  it("is forgotten when the tool is put away", () => {
    const edit = new MapEdit(() => undefined);
    edit.setOn(true);
    edit.clicked(hit([1, 2, 3]));
    edit.setOn(false);
    expect(edit.corners).toEqual([]);
  });
});
