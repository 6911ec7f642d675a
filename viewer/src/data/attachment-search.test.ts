import { readFileSync } from "node:fs";
import { describe, expect, test } from "vitest";
import { AttachmentSearch, type Attachments } from "./attachment-search.ts";
import { MissingAttachmentError } from "./recording-reader.ts";
import { readRun } from "./testing.ts";
import * as make from "./testing-recording.ts";
import { loadZstd } from "./zstd.ts";

const CAVE = new Uint8Array(readFileSync(new URL("../../tests/fixtures/cave.mcap", import.meta.url)));
const zstd = await loadZstd();

function search(bytes: Uint8Array): Attachments | null {
  const search = new AttachmentSearch(zstd);
  for (let at = 0; at < bytes.length; at += 1000) search.push(bytes.subarray(at, at + 1000));
  return search.found;
}

function read(bytes: Uint8Array) {
  expect(() => readRun(bytes)).toThrow(MissingAttachmentError);
  return readRun(bytes, bytes.length, () => {}, search(bytes));
}

describe("a recording that another program has written again", () => {
  const original = readRun(CAVE);

  test("with its attachments behind the messages is the same run", async () => {
    const run = read(await make.rewritten(CAVE, zstd, { areAttachmentsLast: true, hasChunks: false }));
    expect(run.problem).toBeNull();
    expect(run.setup).toEqual(original.setup);
    expect(run.terrain).toEqual(original.terrain);
    expect(run.agentAt(1, 7.5)).toEqual(original.agentAt(1, 7.5));
  });

  test("without its attachments has the map that the team has seen", async () => {
    const run = read(await make.rewritten(CAVE, zstd, { attachments: {} }));
    expect(run.problem).toBe(
      "test.mcap: another program has written this recording again without its scenario and its map. " +
        "What the team has not seen is drawn as rock.",
    );
    expect(run.terrain.size).toEqual(original.terrain.size);
    expect(run.terrain.freeCells).toBe(original.seenAt(original.endS));
    for (let cell = 0; cell < original.terrain.walls.length; cell++) {
      expect(run.terrain.walls.has(cell) || !original.terrain.walls.has(cell)).toBe(true);
    }
    expect(run.endS).toBe(original.endS);
    expect(run.result?.digest).toBe(original.result?.digest);
    expect(run.agentAt(1, 7.5)).toEqual(original.agentAt(1, 7.5));
  });

  test("without anything of a run is refused", async () => {
    const other = { topic: "/camera/image", tick: 1, bytes: new Uint8Array(9) };
    expect(search(await make.recordingOf([other], { attachments: {} }))).toBeNull();
    expect(search(new TextEncoder().encode("duration_s = 5"))).toBeNull();
  });
});
