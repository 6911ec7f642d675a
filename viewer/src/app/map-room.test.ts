import { describe, expect, it } from "vitest";
import { cellsOf, queryOf, type RoomAnswer, type RoomQuestion } from "../data/map-room.ts";
import type { Vec3 } from "../data/run.ts";
import { distanceText, MapRoom } from "./map-room.ts";

const HIT = { point: [1, 2, 0.5], free: [1, 2, 0.75] } as { point: Vec3; free: Vec3 };

/** A server whose answers wait until they are given. */
class Server {
  readonly questions: RoomQuestion[] = [];
  readonly #waiting: ((answer: RoomAnswer | Error) => void)[] = [];

  readonly ask = (question: RoomQuestion): Promise<RoomAnswer> => {
    this.questions.push(question);
    return new Promise((resolve, reject) =>
      this.#waiting.push((answer) => (answer instanceof Error ? reject(answer) : resolve(answer))),
    );
  };

  /** Answers a question with its places as starts. */
  async answer(at: number, change: Partial<RoomAnswer> | Error = {}): Promise<void> {
    const starts = this.questions[at]!.near;
    const right = { fits: 0.9, reached: 0.8, runs: [[2], [3]], starts, problem: null, scenario: null };
    this.#waiting[at]!(change instanceof Error ? change : ({ ...right, ...change } as RoomAnswer));
    await new Promise((resolve) => setTimeout(resolve));
  }
}

function roomOf(server: Server | null): { room: MapRoom; changes: () => number } {
  let changes = 0;
  return { room: new MapRoom(server?.ask ?? null, 8, () => changes++), changes: () => changes };
}

describe("questions", () => {
  it("have a radius and places", () => {
    const near: Vec3[] = [
      [1, 2.5, 3],
      [4, 5, 6],
    ];
    expect(queryOf({ radiusM: 0.4, near })).toBe("radius_m=0.4&near=1,2.5,3&near=4,5,6");
  });

  it("are answered with runs of cells", () => {
    const cells = cellsOf(
      [
        [1, 6],
        [2, 1],
      ],
      8,
    );
    expect([0, 1, 2, 3, 6, 7].filter((cell) => cells.has(cell))).toEqual([1, 2, 6]);
  });
});

describe("measuring", () => {
  it("goes from click to click", () => {
    const { room } = roomOf(null);
    room.clicked(HIT);
    expect(room.measured).toEqual([]);
    room.setTool("measure");
    room.clicked(null);
    room.clicked(HIT);
    expect(distanceText(room.measured)).toBeNull();
    room.clicked({ ...HIT, point: [4, 6, 0.5] });
    expect(distanceText(room.measured)).toBe("5.00 m (x 3.00, y 4.00, z 0.00)");
    room.clicked(HIT);
    expect(room.measured).toEqual([HIT.point]);
  });
});

describe("starts and reach", () => {
  it("are those of the answer", async () => {
    const server = new Server();
    const { room } = roomOf(server);
    room.setTool("start");
    room.clicked(HIT);
    expect(server.questions[0]).toEqual({ radiusM: 0.4, near: [HIT.free] });
    await server.answer(0, { starts: [[1, 2, 1]], scenario: "text" });
    expect(room.starts).toEqual([[1, 2, 1]]);
    expect(room.reach).toBeNull();
    void room.showReach(true);
    expect(server.questions[1]!.near).toEqual([[1, 2, 1]]);
    await server.answer(1);
    expect(room.reach!.count).toBe(3);
    void room.removeStart(0);
    expect(server.questions[2]!.near).toEqual([]);
  });

  it("drop late answers", async () => {
    const server = new Server();
    const { room } = roomOf(server);
    void room.setRadius(0.5);
    void room.setRadius(0.6);
    await server.answer(1, { fits: 0.5 });
    await server.answer(0, { fits: 0.7 });
    expect(room.answer!.fits).toBe(0.5);
    expect(room.isAsking).toBe(false);
  });

  it("name the reason of a refusal", async () => {
    const server = new Server();
    const { room } = roomOf(server);
    void room.setRadius(90);
    await server.answer(0, new Error("a radius of 90 m: allowed is above 0 to 8 m, eight cells"));
    expect(room.problem).toContain("allowed is above 0 to 8 m");
    expect(room.answer).toBeNull();
  });

  it("need somebody who answers", () => {
    const { room } = roomOf(null);
    room.setTool("start");
    room.clicked(HIT);
    expect(room.canAsk).toBe(false);
    expect(room.isAsking).toBe(false);
  });
});
