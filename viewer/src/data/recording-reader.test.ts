import { readFileSync } from "node:fs";
import { McapStreamReader } from "@mcap/core";
import { beforeAll, describe, expect, test } from "vitest";
import type { CellTimes } from "./cell-times.ts";
import type { RunModel } from "./run-model.ts";
import { NEVER, UnreadableError, type Run } from "./run.ts";
import { readRun } from "./testing.ts";
import * as make from "./testing-recording.ts";
import { loadZstd, slowZstd, type Zstd } from "./zstd.ts";

/**
 * 20 s of three agents in a small cave, made by `maes run --transport memory --agents 3 --size 20
 * --seed 5 --duration 20 --controller dsvp --map noise --set lidar.range_m=6 --set
 * recording.poses_period_ticks=25 --share-period 100`.
 */
const CAVE = new Uint8Array(readFileSync(new URL("../../tests/fixtures/cave.mcap", import.meta.url)));

const zstd: Zstd = await loadZstd();

/** All answers of a run, to compare. */
function answersOf(run: Run) {
  const times = Array.from({ length: 42 }, (_, half) => half / 2);
  const { setup, terrain, endS, isComplete, firstSeenTick, coveredTick, progress, result } = run;
  const agents = setup.controllers.map((_, agent) => times.map((timeS) => run.agentAt(agent, timeS)));
  const counts = times.map((timeS) => [run.seenAt(timeS), run.coveredAt(timeS)]);
  return { setup, terrain, endS, isComplete, firstSeenTick, coveredTick, progress, result, agents, counts };
}

describe("a recording of the simulator", () => {
  const run = readRun(CAVE);
  const result = run.result!;
  const { freeCells } = run.terrain;

  test("has its setup and result", () => {
    expect(run.problem).toBeNull();
    expect(run.isComplete).toBe(true);
    expect(run.endS).toBe(20);
    expect(run.terrain.size).toEqual([20, 20, 20]);
    expect(run.setup).toMatchObject({
      agents: 3,
      controllers: ["dsvp", "dsvp", "dsvp"],
      radiusM: [0.4, 0.4, 0.4],
      durationS: 20,
      lidar: { rays: 5124, rangeM: 6, fovRad: 2 * Math.PI },
      communicationRangeM: Infinity,
    });
    expect(run.setup.scenarioToml).toContain("poses_period_ticks = 25");
    expect(result).toMatchObject({ tick: 1000, timeS: 20, reason: "duration", messageBytes: 2225 });
    expect(result.digest).toBe("0708c98491427b1634727ee172ee5dba49f770a342d4bc29f75545a0d47cd5de");
    expect(result.counters.get("free_cells")).toBe(freeCells);
    expect(run.progress.map(({ timeS }) => timeS)).toEqual([0, 10, 20]);
  });

  test("has exactly as many seen cells as its result", () => {
    expect(run.seenAt(run.endS)).toBeCloseTo(result.explored * freeCells, 6);
    expect(run.seenAt(run.endS)).toBeGreaterThan(700);
  });

  test("has as many covered cells as its result, but for cut corners", () => {
    const visited = result.covered * freeCells;
    expect(Math.abs(run.coveredAt(run.endS) - visited)).toBeLessThanOrEqual(1);
    for (const { timeS, covered } of run.progress) {
      expect(Math.abs(run.coveredAt(timeS) - covered * freeCells)).toBeLessThanOrEqual(1);
    }
  });

  /** Number of free cells with a tick up to this one. */
  const freeUpTo = (times: CellTimes, tick: number): number => {
    let count = 0;
    times.forEach((cell, first) => {
      if (first <= tick && !run.terrain.walls.has(cell)) count++;
    });
    return count;
  };

  test("an update leaves earlier states as they were", () => {
    const statesAt = (part: RunModel, timeS: number) => [
      part.seenAt(timeS),
      part.coveredAt(timeS),
      ...[0, 1, 2].map((agent) => part.agentAt(agent, timeS)),
    ];
    let fromS = Infinity;
    let before: { timeS: number; states: unknown[] } | null = null;
    let checks = 0;
    readRun(CAVE, 3000, (part) => {
      if (before === null) part.onUpdate((update) => (fromS = update.fromS));
      else if (before.timeS < fromS) {
        expect(statesAt(part, before.timeS)).toEqual(before.states);
        checks++;
      }
      const timeS = part.endS / 2;
      before = { timeS, states: statesAt(part, timeS) };
    });
    expect(checks).toBeGreaterThan(2);
  });

  test("counts cells by the tick they were seen", () => {
    for (const timeS of [0, 3.3, 10, 19.98]) {
      const tick = Math.round(timeS * 50);
      expect(run.seenAt(timeS)).toBe(freeUpTo(run.firstSeenTick, tick));
    }
  });

  test("each agent knows as many cells as in its last command", async () => {
    for (const agent of [0, 1, 2]) {
      const belief = await run.follow(agent);
      const lastAnswer = run.agentAt(agent, run.endS - 0.02).observedS * 50;
      const known = freeUpTo(belief!.knownTick, lastAnswer);
      expect(known).toBeCloseTo(result.believedBy[agent]! * freeCells, 6);
      const knownAtEnd = freeUpTo(belief!.knownTick, NEVER - 1);
      expect(knownAtEnd).toBeGreaterThan(result.exploredBy[agent]! * freeCells);
    }
    expect(await run.follow(null)).toBeNull();
  });

  test("agents have travelled as far as in the result, but for cut corners", () => {
    for (const agent of [0, 1, 2]) {
      const { count, positions } = run.track(agent);
      let distanceM = 0;
      for (let at = 3; at < 3 * count; at += 3) {
        distanceM += Math.hypot(
          ...[0, 1, 2].map((axis) => positions[at + axis]! - positions[at - 3 + axis]!),
        );
      }
      expect(distanceM).toBeLessThanOrEqual(result.distanceM[agent]! + 1e-3);
      expect(distanceM).toBeGreaterThan(0.95 * result.distanceM[agent]!);
    }
  });

  test("scan hits are known walls", async () => {
    const hits = (await run.hitsAt(1, 12))!;
    expect(hits.isCast).toBe(true);
    expect(hits.timeS).toBeLessThanOrEqual(12);
    expect(hits.positions.length).toBeGreaterThan(3000);
    const { size, walls } = run.terrain;
    let unseen = 0;
    const [x, y, z] = run.agentAt(1, hits.timeS).position;
    for (let at = 0; at < hits.positions.length; at += 3) {
      const [hx, hy, hz] = hits.positions.subarray(at, at + 3) as unknown as [number, number, number];
      expect(Math.hypot(hx - x, hy - y, hz - z)).toBeLessThan(6.001);
      // The wall begins slightly behind the hit.
      const inside = [hx + (hx - x) * 1e-4, hy + (hy - y) * 1e-4, hz + (hz - z) * 1e-4].map(Math.floor);
      const cell = (inside[2]! * size[1] + inside[1]!) * size[0] + inside[0]!;
      expect(walls.has(cell)).toBe(true);
      unseen += run.firstSeenTick.get(cell) > 12 * 50 ? 1 : 0;
    }
    // The pose of the scan is interpolated, so some rays graze another wall than they did in the
    // run.
    expect(unseen).toBeLessThan(0.01 * (hits.positions.length / 3));
  });

  test("agent states do not depend on earlier queries", () => {
    const other = readRun(CAVE);
    const times = Array.from({ length: 400 }, (_, at) => (at * 7.3) % 20.5);
    const forwards = [...times].sort((a, b) => a - b).map((timeS) => [timeS, run.agentAt(2, timeS)] as const);
    const inOrder = new Map(forwards);
    for (const timeS of times) {
      expect(other.agentAt(2, timeS)).toEqual(inOrder.get(timeS));
    }
  });

  test("an agent on a path has ever fewer waypoints ahead", () => {
    let isOnAWay = 0;
    for (const agent of [0, 1, 2]) {
      for (let tick = 1; tick < 1000; tick++) {
        const [before, now] = [run.agentAt(agent, (tick - 1) / 50), run.agentAt(agent, tick / 50)];
        if (now.task === "path" && now.observedS === before.observedS) {
          isOnAWay += now.path.length > 0 ? 1 : 0;
          expect(now.path).toEqual(before.path.slice(before.path.length - now.path.length));
        }
      }
    }
    expect(isOnAWay).toBeGreaterThan(500);
  });
});

describe("a run is the same however its bytes arrive", () => {
  const expected = answersOf(readRun(CAVE));

  test.each([1, 7, 1000, 4096])("in pieces of %i bytes", (pieceBytes) => {
    expect(answersOf(readRun(CAVE, pieceBytes))).toEqual(expected);
  });

  test("as the stream of a live run", async () => {
    const stream = await make.asStream(CAVE, zstd);
    expect(answersOf(readRun(stream))).toEqual(expected);
    expect(answersOf(readRun(stream, 5000))).toEqual(expected);
  });

  test("with a belief followed from the start, or at the end", async () => {
    const known = (await readRun(CAVE).follow(1))!.knownTick;
    const followed = await new Promise<CellTimes>((resolve) => {
      readRun(CAVE, 2000, (run, isLast) => {
        const belief = run.follow(1);
        if (isLast) {
          void belief.then((all) => resolve(all!.knownTick));
        }
      });
    });
    expect(followed).toEqual(known);
    expect(known.flat!.some((tick) => tick > 900 && tick !== NEVER)).toBe(true);
  });

  test("with either decompressor", () => {
    const reader = new McapStreamReader({
      decompressHandlers: {
        zstd: (bytes, length) => {
          const content = zstd(bytes, Number(length));
          expect(slowZstd(bytes, Number(length))).toEqual(content);
          return content;
        },
      },
    });
    reader.append(CAVE);
    let chunks = 0;
    for (let record = reader.nextRecord(); record; record = reader.nextRecord()) {
      chunks += record.type === "MessageIndex" ? 1 : 0;
    }
    expect(chunks).toBeGreaterThan(0);
  });
});

describe("partly readable recordings are shown", () => {
  test("cut off, with the position", () => {
    const at = CAVE.length / 2;
    const run = readRun(CAVE.subarray(0, at));
    expect(run.problem).toMatch(/^test\.mcap is cut off after byte \d+\. It is shown up to \d+\.\d s\.$/);
    expect(run.problem).toContain(`byte ${at}.`);
    expect(run.isComplete).toBe(true);
    expect(run.result).toBeNull();
    const whole = readRun(CAVE);
    expect(run.endS).toBeLessThan(20);
    expect(run.endS).toBeGreaterThan(5);
    for (const timeS of [0, 2, run.endS - 1]) {
      expect(run.seenAt(timeS)).toBe(whole.seenAt(timeS));
      expect(run.agentAt(1, timeS)).toEqual(whole.agentAt(1, timeS));
    }
  });

  test("damaged, with the position and the reason", () => {
    const damaged = CAVE.slice();
    const at = Math.floor(0.4 * CAVE.length);
    damaged[at]! ^= 0x40;
    const run = readRun(damaged);
    const place = Number(/is damaged at byte (\d+): /.exec(run.problem!)![1]);
    expect(place).toBeLessThan(at);
    expect(run.result).toBeNull();
    expect(run.seenAt(2)).toBe(readRun(CAVE).seenAt(2));
  });

  test("incomplete", async () => {
    const messages = [make.scenario(1), make.join(0, "mine"), make.poses(0, [[1.5, 1.5, 1.5]])];
    const whole = await make.recordingOf(messages, { hasChunks: false });
    expect(readRun(withoutEnd(whole)).problem).toContain(
      "is incomplete: its server was killed, or is still recording",
    );
  });
});

/** A recording truncated before its data end record. */
function withoutEnd(recording: Uint8Array): Uint8Array {
  const DATA_END_BYTES = 13;
  let whole = recording.length;
  while (readRun(recording.subarray(0, whole - 1)).problem === null) {
    whole--;
  }
  return recording.subarray(0, whole - DATA_END_BYTES);
}

describe("other input is rejected, with what was found", () => {
  const refused = (bytes: Uint8Array) => {
    let message = "";
    try {
      readRun(bytes);
    } catch (error) {
      expect(error).toBeInstanceOf(UnreadableError);
      message = (error as Error).message;
    }
    return message;
  };

  test("other bytes", () => {
    const expected =
      "test.mcap is not a recording: expected an MCAP file, which begins with the bytes 89 4d 43 41 50";
    expect(refused(new Uint8Array(0))).toBe(`${expected}; found an empty file`);
    expect(refused(new Uint8Array(5))).toBe(`${expected}; found only 5 bytes`);
    expect(refused(new TextEncoder().encode("duration_s = 5"))).toBe(
      `${expected}; found the bytes 64 75 72 61 74 69 6f 6e`,
    );
  });

  test("other recordings", async () => {
    const other = { topic: "/camera/image", tick: 1, bytes: new Uint8Array(9) };
    expect(refused(await make.recordingOf([other], { attachments: {} }))).toBe(
      "test.mcap is an MCAP file, but not a recording of this simulator: it has the topics /camera/image, " +
        "but no attachment scenario.toml before them",
    );
    const toml = { "scenario.toml": new TextEncoder().encode(make.SCENARIO_TOML) };
    expect(refused(await make.recordingOf([], { attachments: toml }))).toContain("no attachment map.m3dm");
    const map = { ...toml, "map.m3dm": Uint8Array.of(1) };
    expect(refused(await make.recordingOf([], { attachments: map }))).toContain(
      "its attachment map.m3dm cannot be read",
    );
  });

  test("recordings without a scenario", async () => {
    expect(refused(await make.recordingOf([]))).toContain(
      "is a recording without a run: it has no message on /sim/scenario",
    );
    expect(refused(await make.recordingOf([make.scenario(2, 2)]))).toBe(
      "test.mcap is a recording of protocol version 2; this page reads version 3",
    );
  });
});

describe("no input fails in another way", () => {
  let forms: Uint8Array[] = [];

  beforeAll(async () => {
    const message = { kind: 1, data: Uint8Array.of(2, 0, 1, 1, 0) };
    const messages = [
      make.scenario(2),
      make.join(0, "one"),
      make.join(1, "other"),
      make.poses(0, [
        [1.5, 1.5, 1.5],
        [2.5, 1.5, 1.5],
      ]),
      make.observation(0, 0, {
        contacts: [1],
        messages: [message],
        scanTick: 0n,
        free: [[57, 3]],
        wall: [[49, 2]],
      }),
      make.command(0, 0, { kind: 4, path: [[3.5, 1.5, 1.5]], info: "goes", messages: [message] }),
      make.points(0, 0, [[1, 2, 3]]),
      make.placed(1, 5, [4.5, 2.5, 1.5]),
      make.progress(5, 2),
      make.result(5, 2, "interrupted"),
    ];
    const whole = [await make.recordingOf(messages), await make.recordingOf(messages, { hasChunks: false })];
    // Nothing behind the data end record is read.
    forms = whole.map(withoutEnd);
  });

  const readAnyhow = async (bytes: Uint8Array) => {
    try {
      const run = readRun(bytes, 500);
      for (const timeS of [0, 0.05, 1]) {
        run.agentAt(0, timeS);
        await run.hitsAt(0, timeS);
        run.seenAt(timeS);
      }
      await run.follow(0);
      return run.problem ?? "none";
    } catch (error) {
      expect(error).toBeInstanceOf(UnreadableError);
      return (error as Error).message;
    }
  };

  test("whole", async () => {
    for (const form of forms) {
      expect(await readAnyhow(form)).toContain("is incomplete");
    }
  });

  test("cut off anywhere", async () => {
    for (const form of forms) {
      for (let length = 0; length < form.length; length++) {
        await readAnyhow(form.subarray(0, length));
      }
    }
  });

  test("changed anywhere", async () => {
    for (const form of forms) {
      for (let at = 0; at < form.length; at++) {
        const changed = form.slice();
        changed[at]! ^= [0x01, 0x80, 0xff][at % 3]!;
        await readAnyhow(changed);
      }
    }
  });

  test("with an excessive record length", async () => {
    const long = forms[1]!.slice();
    long.fill(0x7f, 9, 17);
    expect(await readAnyhow(long)).toContain("above the limit of 268435456");
  });
});
