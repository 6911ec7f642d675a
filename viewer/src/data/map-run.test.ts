import { describe, expect, it } from "vitest";
import { isMapFile, mapRun } from "./map-run.ts";
import { UnreadableError } from "./run.ts";

/** A plain map of 2 x 2 x 2 cells, of which one is free. */
const PLAIN = Uint8Array.of(0x04, 0x08, 0x10, 0b01111111);

describe("map files", () => {
  it("are known by their names", () => {
    expect(["a.m3dm", "A.M3DM", "a.mcap", "m3dm"].map(isMapFile)).toEqual([true, true, false, false]);
  });

  it("are runs without agents in which all cells are seen", () => {
    const { header, batch } = mapRun("a.m3dm", PLAIN);
    expect(header.terrain).toMatchObject({ size: [2, 2, 2], cellM: 1, freeCells: 1 });
    expect(header.setup.agents).toBe(0);
    expect([...batch.seen]).toEqual([0, 0, 8]);
    expect(batch.isComplete).toBe(true);
  });

  it("are refused with their name if they are damaged", () => {
    expect(() => mapRun("a.m3dm", PLAIN.subarray(0, 2))).toThrow(UnreadableError);
    expect(() => mapRun("a.m3dm", PLAIN.subarray(0, 2))).toThrow("a.m3dm: byte 2");
  });
});
