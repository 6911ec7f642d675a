import { describe, expect, test } from "vitest";
import { RunModel } from "./run-model.ts";
import { mapRun } from "./map-run.ts";
import type { Request } from "./protocol.ts";
import { NEVER, type Vec3 } from "./run.ts";
import { readRun } from "./testing.ts";
import * as make from "./testing-recording.ts";
import { roomCell } from "./testing-recording.ts";

const POSITION: Vec3 = [1.5, 1.5, 1.5];

async function runOf(messages: readonly make.RecordedMessage[], agents = 1) {
  return readRun(await make.recordingOf([make.scenario(agents), ...messages]));
}

describe("poses", () => {
  test("are interpolated, the heading along the shorter arc", async () => {
    const run = await runOf([
      make.poses(0, [[1.5, 1.5, 1.5]], 3),
      make.poses(10, [[3.5, 1.5, 1.5]], -3),
      make.poses(20, [[3.5, 1.5, 1.5]], -3),
    ]);
    const middle = run.agentAt(0, 0.1);
    expect(middle.position[0]).toBeCloseTo(2.5, 6);
    expect(Math.abs(middle.yawRad)).toBeCloseTo(Math.PI, 5);
    expect(middle.speedMS).toBeCloseTo(10, 5);
    expect(run.agentAt(0, 0.3).speedMS).toBe(0);
    expect(run.agentAt(0, 99).position).toEqual([3.5, 1.5, 1.5]);
    expect(run.track(0).count).toBe(3);
  });

  test("that drift are true by way of all frames", async () => {
    const run = await runOf([
      make.chainedPose(0, [
        [[1, 0, 0], 0],
        [[1, 1, 0.5], Math.PI / 2],
        [[1, -1, 1], -Math.PI / 2],
      ]),
    ]);
    const { position, yawRad } = run.agentAt(0, 0);
    position.forEach((along, axis) => expect(along).toBeCloseTo([3, 2, 1.5][axis]!, 6));
    expect(yawRad).toBeCloseTo(0, 6);
  });

  test("of observations are included, once per tick", async () => {
    const run = await runOf([
      make.poses(0, [POSITION]),
      make.observation(0, 0, { position: POSITION }),
      make.observation(0, 4, { position: [2.5, 1.5, 1.5] }),
      make.poses(10, [[2.5, 3.5, 1.5]]),
    ]);
    expect(Array.from(run.track(0).timeS.subarray(0, 3))).toEqual([0, 0.08, 0.2]);
    expect(run.track(0).count).toBe(3);
  });

  test("a placed body has not travelled", async () => {
    const run = await runOf([
      make.poses(0, [POSITION]),
      make.placed(0, 5, [6.5, 4.5, 2.5]),
      make.poses(10, [[6.5, 4.5, 2.5]]),
    ]);
    expect(run.agentAt(0, 0.08).position).toEqual(POSITION);
    expect(run.agentAt(0, 0.1).position).toEqual([6.5, 4.5, 2.5]);
    expect(run.coveredAt(1)).toBe(2);
  });
});

describe("moving obstacles", () => {
  const TOML = `[[obstacle]]
    kind = "sphere"
    radius_m = 0.5
    [[obstacle]]
    kind = "box"
    size_m = [1.0, 1.0, 1.0]`;

  async function withObstacles(messages: readonly make.RecordedMessage[]) {
    const attachments = { "scenario.toml": new TextEncoder().encode(TOML), "map.m3dm": make.roomMap() };
    return make.recordingOf([make.scenario(1), ...messages], { attachments });
  }

  test("are interpolated between their frames, and are no agents", async () => {
    const run = readRun(
      await withObstacles([
        make.namedPoses(0, { "agent_0/base_link": POSITION, obstacle_0: [2, 2, 2] }),
        make.namedPoses(10, { obstacle_0b: POSITION, obstacle_0: [4, 2, 2], obstacle_7: POSITION }),
        make.namedPoses(20, { "agent_0/base_link": POSITION, obstacle_0: [4, 3, 2] }),
      ]),
    );
    expect(run.setup.agents).toBe(1);
    expect(run.setup.obstacles.map((shape) => shape?.kind)).toEqual(["sphere", "box"]);
    expect(run.obstacleAt(0, 0.1)![0]).toBeCloseTo(3, 6);
    expect(run.obstacleAt(0, 0.3)![1]).toBeCloseTo(2.5, 6);
    expect(run.obstacleAt(0, 99)).toEqual([4, 3, 2]);
    expect(run.obstacleAt(1, 0.1)).toBeNull();
    expect(() => run.obstacleAt(2, 0)).toThrow("there is no obstacle 2, expected 0 to 1");
    expect(run.track(0).count).toBe(2);
    expect(run.coveredAt(1)).toBe(1);
  });

  test("change the past back to the pose before a new one", async () => {
    const { setup, terrain } = readRun(await withObstacles([]));
    const fromS: number[] = [];
    const model = new RunModel("test", "test", setup, terrain, { send: () => {}, close: () => {} });
    model.onUpdate((update) => fromS.push(update.fromS));
    const nothing = mapRun("empty.m3dm", make.roomMap()).batch;
    const batch = { ...nothing, seen: new Uint32Array(0), endTick: 20 };
    model.take({ kind: "batch", batch: { ...batch, obstacles: Float64Array.of(0, 10, 4, 2, 2) } });
    model.take({
      kind: "batch",
      batch: { ...batch, endTick: 30, obstacles: Float64Array.of(0, 30, 4, 3, 2) },
    });
    expect(fromS).toEqual([0, 0.2]);
  });
});

describe("the map", () => {
  test("changes at its ticks", async () => {
    const [door, beside] = [roomCell(3, 2, 1), roomCell(4, 2, 1)];
    const run = await runOf([
      make.poses(0, [POSITION]),
      make.mapChange(10, true, [3, 1, 1], [3, 4, 2]),
      make.poses(20, [POSITION]),
      make.mapChange(30, false, [3, 2, 1], [3, 2, 1]),
      make.poses(40, [POSITION]),
    ]);
    const isWall = (timeS: number, cell: number) => run.terrainAt(timeS).walls.has(cell);
    expect([0, 0.18, 0.2, 0.58, 0.6].map((timeS) => isWall(timeS, door))).toEqual([
      false,
      false,
      true,
      true,
      false,
    ]);
    expect(isWall(0.4, beside)).toBe(false);
    expect(run.terrainAt(0.1)).toBe(run.terrain);
    expect(run.terrainAt(0.4).freeCells).toBe(run.terrain.freeCells - 8);
    expect(run.terrainAt(0.8).freeCells).toBe(run.terrain.freeCells - 7);
  });

  test("is not changed by a box outside it", async () => {
    const run = await runOf([make.poses(0, [POSITION]), make.mapChange(1, true, [7, 1, 1], [8, 1, 1])]);
    expect(run.problem).toContain("7 1 1 to 8 1 1 are no box in the map");
    expect(run.terrainAt(1)).toBe(run.terrain);
  });
});

describe("cells", () => {
  test("have the tick of the earliest scan that saw them", async () => {
    const [a, b] = [roomCell(1, 1, 1), roomCell(4, 1, 1)];
    const run = await runOf(
      [
        make.observation(0, 10, { scanTick: 10n, free: [[a, 3]], wall: [[roomCell(0, 1, 1), 1]] }),
        make.observation(1, 11, {
          scanTick: 8n,
          free: [
            [a, 1],
            [b, 1],
          ],
        }),
        make.observation(1, 20, { free: [[b + 1, 1]] }),
      ],
      2,
    );
    expect([a, a + 1, b, b + 1, roomCell(0, 1, 1)].map((cell) => run.firstSeenTick.get(cell))).toEqual([
      8, 10, 8, 20, 10,
    ]);
    expect(run.firstSeenTick.get(roomCell(6, 4, 2))).toBe(NEVER);
    expect([7, 8, 10, 20].map((tick) => run.seenAt(tick / 50))).toEqual([0, 2, 4, 5]);
  });

  test("of all fragments count, with the scan tick of the first", async () => {
    const run = await runOf([
      make.observation(0, 10, {
        part: 0,
        parts: 2,
        scanTick: 9n,
        free: [[roomCell(1, 1, 1), 1]],
        contacts: [3],
      }),
      make.observation(0, 10, {
        part: 1,
        parts: 2,
        free: [[roomCell(2, 1, 1), 1]],
        messages: [{ kind: 9, data: new Uint8Array(7) }],
      }),
    ]);
    expect(run.seenAt(0.18)).toBe(2);
    expect(run.agentAt(0, 0.2)).toMatchObject({
      contacts: [3],
      received: { messages: 1, bytes: 7 },
      observedS: 0.2,
    });
  });

  test("are covered in the tick in which a body first entered them", async () => {
    const run = await runOf([make.poses(0, [POSITION]), make.poses(10, [[3.5, 1.5, 1.5]])]);
    expect([1, 2, 3].map((x) => run.coveredTick.get(roomCell(x, 1, 1)))).toEqual([0, 3, 8]);
    expect([0, 0.05, 0.06, 1].map((timeS) => run.coveredAt(timeS))).toEqual([1, 1, 2, 3]);
  });
});

describe("tasks", () => {
  const observed = (tick: number, of: make.ObservationOf = {}) =>
    make.observation(0, tick, { position: POSITION, ...of });

  test("hold until they are replaced or done", async () => {
    const run = await runOf([
      observed(0),
      make.command(0, 0, { kind: 3, info: "looks" }),
      observed(5, { isActive: true }),
      make.command(0, 5),
      observed(10),
      make.command(0, 10),
      observed(15),
      make.command(0, 15, { kind: 5, info: "drifts" }),
      observed(20, { isActive: true, collision: 2 }),
      make.command(0, 20, { kind: 1 }),
    ]);
    const states = [0, 4, 5, 9, 10, 15, 20].map((tick) => run.agentAt(0, tick / 50));
    expect(states.map(({ task }) => task)).toEqual([
      "turn",
      "turn",
      "turn",
      "turn",
      "idle",
      "velocity",
      "stop",
    ]);
    expect(states.map(({ info }) => info)).toEqual([
      "looks",
      "looks",
      "looks",
      "looks",
      "looks",
      "drifts",
      "drifts",
    ]);
    expect(states.at(-1)).toMatchObject({ collision: "floor", observedS: 0.4 });
    expect(run.agentAt(0, 0.399).collision).toBe("none");
  });

  test("a path has the waypoints ahead", async () => {
    const path: Vec3[] = [
      [3.5, 1.5, 1.5],
      [3.5, 3.5, 1.5],
    ];
    const run = await runOf([
      observed(0),
      make.command(0, 0, { kind: 4, path }),
      make.poses(50, [[3.5, 1.5, 1.5]]),
      make.poses(100, [[3.5, 3, 1.5]]),
      observed(110, { position: [3.5, 3.5, 1.5] }),
    ]);
    expect([0.5, 1.5, 2.19, 2.2].map((timeS) => run.agentAt(0, timeS).path)).toEqual([
      path,
      path.slice(1),
      path.slice(1),
      [],
    ]);
    expect(run.agentAt(0, 2.2).task).toBe("idle");
    expect(run.agentAt(0, 0.5).path).toEqual(path);
  });

  test("a velocity has the waypoints to which it is to lead", async () => {
    const path: Vec3[] = [[3.5, 1.5, 1.5]];
    const run = await runOf([
      observed(0),
      make.command(0, 0, { kind: 5, path }),
      make.poses(50, [[3, 1.5, 1.5]]),
      make.command(0, 60, { kind: 5 }),
    ]);
    expect([0.5, 1.1, 1.3].map((timeS) => run.agentAt(0, timeS).path)).toEqual([path, path, []]);
    expect(run.agentAt(0, 0.5).task).toBe("velocity");
  });

  test("an unlimited move ends at the next wall, along heading and pitch", async () => {
    const run = await runOf([
      observed(0, { yawRad: Math.PI / 2 }),
      make.command(0, 0, { kind: 2, distanceM: Infinity }),
      observed(10, { isActive: true, yawRad: 0 }),
      make.command(0, 10, { kind: 2, distanceM: 2, pitchRad: Math.PI / 6 }),
      observed(20, { isActive: true, yawRad: 0 }),
      make.command(0, 20),
      observed(30, { collision: 1 }),
    ]);
    const target = (timeS: number) =>
      run.agentAt(0, timeS).path.map((point) => point.map((at) => Math.round(at * 1e4) / 1e4));
    expect(target(0)).toEqual([[1.5, 5, 1.5]]);
    // The ceiling is one metre above.
    expect(target(0.3)).toEqual([[3.2321, 1.5, 2.5]]);
    expect(target(0.5)).toEqual(target(0.3));
    expect(run.agentAt(0, 0.6)).toMatchObject({ task: "idle", path: [], collision: "wall" });
  });

  test("messages are counted, and relays are not agents", async () => {
    const message = (bytes: number) => ({ kind: 2, data: new Uint8Array(bytes) });
    const run = await runOf([
      observed(0, { contacts: [1, 0x80000000], messages: [message(3)] }),
      make.command(0, 0, { messages: [message(10), message(20)] }),
      observed(50, { messages: [message(4), message(5)] }),
      make.command(0, 50, { messages: [message(1)] }),
    ]);
    expect(run.agentAt(0, 0.5)).toMatchObject({
      contacts: [1],
      sent: { messages: 2, bytes: 30 },
      received: { messages: 1, bytes: 3 },
    });
    expect(run.agentAt(0, 1)).toMatchObject({
      sent: { messages: 3, bytes: 31 },
      received: { messages: 3, bytes: 12 },
    });
  });
});

describe("hits", () => {
  test("are the recorded ones, in the map frame", async () => {
    const run = await runOf([
      make.poses(0, [POSITION], Math.PI / 2),
      make.points(0, 0, [
        [2, 0, 0],
        [0, 1, 0.5],
      ]),
      make.poses(10, [[2.5, 1.5, 1.5]], Math.PI / 2),
      make.points(0, 10, [[1, 0, 0]], ["intensity", "time"]),
    ]);
    const early = (await run.hitsAt(0, 0.1))!;
    expect(early).toMatchObject({ timeS: 0, isCast: false });
    const rounded = (positions: Float32Array) => Array.from(positions, (at) => Math.round(at * 1e4) / 1e4);
    expect(rounded(early.positions)).toEqual([1.5, 3.5, 1.5, 0.5, 1.5, 2]);
    expect(rounded((await run.hitsAt(0, 0.2))!.positions)).toEqual([2.5, 2.5, 1.5]);
  });

  test("are those of all LiDARs of an agent", async () => {
    const named = (name: string, tick: number, x: number) => {
      const one = make.points(0, tick, [[x, 0, 0]]);
      return { ...one, topic: one.topic.replace("points", `${name}/points`) };
    };
    const run = await runOf([
      make.poses(0, [POSITION]),
      named("top", 0, 3),
      named("front_low", 0, 4),
      make.poses(10, [POSITION]),
      named("top", 10, 1),
      named("front_low", 10, 2),
    ]);
    const xs = async (timeS: number) =>
      Array.from((await run.hitsAt(0, timeS))!.positions.filter((_, at) => at % 3 === 0)).sort();
    expect(await xs(0.1)).toEqual([3, 4].map((x) => POSITION[0] + x));
    expect(await xs(0.2)).toEqual([1, 2].map((x) => POSITION[0] + x));
  });

  test("are ray-cast from the last scan if none were recorded", async () => {
    const run = await runOf([
      make.observation(0, 0, { position: POSITION }),
      make.observation(0, 10, { position: [3.5, 1.5, 1.5], scanTick: 5n }),
    ]);
    expect(await run.hitsAt(0, 0.1)).toBeNull();
    const hits = (await run.hitsAt(0, 0.3))!;
    expect(hits).toMatchObject({ timeS: 0.1, isCast: true });
    expect(hits.positions).toHaveLength(300);
  });
});

describe("listeners and queries", () => {
  test("updates have the new cells and the end", async () => {
    const cell = roomCell(2, 2, 1);
    const bytes = await make.recordingOf(
      [
        make.scenario(1),
        make.poses(0, [POSITION]),
        make.observation(0, 10, { scanTick: 10n, free: [[cell, 2]] }),
        make.result(20, 1, "explored"),
      ],
      { hasChunks: false },
    );
    const updates: { cells: number[]; hasEnded: boolean }[] = [];
    let isListening = false;
    const run = readRun(bytes, 200, (growing) => {
      if (!isListening) {
        isListening = true;
        growing.onUpdate(({ cells, hasEnded }) => updates.push({ cells: Array.from(cells), hasEnded }));
      }
    });
    expect(updates.flatMap(({ cells }) => cells).sort((a, b) => a - b)).toEqual([cell, cell + 1]);
    expect(updates.filter(({ hasEnded }) => hasEnded)).toHaveLength(1);
    expect(run.result).toMatchObject({ reason: "explored", timeS: 0.4, digest: "ab".repeat(32) });
  });

  test("unknown agents are rejected", async () => {
    const run = await runOf([make.poses(0, [POSITION])]);
    expect(() => run.agentAt(1, 0)).toThrow("there is no agent 1, expected 0 to 0");
  });

  test("follow one agent at a time", async () => {
    const { setup, terrain } = await runOf([make.poses(0, [POSITION, POSITION])], 2);
    const requests: Request[] = [];
    const run = new RunModel("run", "run", setup, terrain, {
      send: (request) => requests.push(request),
      close: () => {},
    });
    const answer = (request: Request) => {
      const learned = Uint32Array.of(9, 1);
      run.take({ kind: "belief", request: (request as { request: number }).request, learned });
    };
    const [first, second] = [run.follow(0), run.follow(1)];
    expect(run.follow(1)).toBe(second);
    expect(requests).toMatchObject([{ agent: 0 }, { agent: 1 }]);
    requests.forEach(answer);
    expect(await first).toBeNull();
    const belief = (await second)!;
    expect(belief).toMatchObject({ agent: 1, revision: 0 });
    const [third, hits] = [run.follow(0), run.hitsAt(0, 0)];
    run.close();
    expect([await third, await hits, await run.follow(1), await run.hitsAt(0, 0)]).toEqual([
      null,
      null,
      null,
      null,
    ]);
  });

  test("a failure of the reader is reported", async () => {
    const { setup, terrain } = await runOf([make.poses(0, [POSITION])]);
    const run = new RunModel("run", "run", setup, terrain, { send: () => {}, close: () => {} });
    let updates = 0;
    run.onUpdate(() => updates++);
    const hits = run.hitsAt(0, 0);
    run.fail("the reader is gone");
    expect(run).toMatchObject({ problem: "the reader is gone", isComplete: true });
    expect([await hits, updates]).toEqual([null, 1]);
  });
});
