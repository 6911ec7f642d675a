import { describe, expect, test } from "vitest";
import { DEFAULT_LAYERS } from "../scene/view.ts";
import { besideOf, isComparison, linkTo, parseLink, type SharedView } from "./shared-link.ts";

const VIEW: SharedView = {
  timeS: 12.34,
  agent: 3,
  layers: { ...DEFAULT_LAYERS, heat: true, labels: false },
  camera: { centre: [1, -2.5, 0], yawRad: Math.PI / 3, pitchRad: -Math.PI / 6, distanceM: 40 },
};

describe("links", () => {
  test("hold what is shown", () => {
    const link = linkTo("http://localhost:8765/?recording=recording/run.mcap&picture=1#x", VIEW);
    expect(link).toBe(
      "http://localhost:8765/?recording=recording/run.mcap&time=12.34&agent=3" +
        "&layers=walls,unexplored,heat,trails,paths&camera=1,-2.5,0,60,-30,40",
    );
    const read = parseLink(new URL(link).search);
    expect(read.timeS).toBe(VIEW.timeS);
    expect(read.agent).toBe(VIEW.agent);
    expect(read.layers).toEqual(VIEW.layers);
    expect(read.camera!.centre).toEqual(VIEW.camera!.centre);
    expect(read.camera!.yawRad).toBeCloseTo(VIEW.camera!.yawRad, 9);
    expect(read.camera!.distanceM).toBe(40);
  });

  test("name two recordings", () => {
    const search = "?recording=recording/a.mcap&beside=beside/b.mcap&time=5";
    expect(isComparison(search)).toBe(true);
    expect(isComparison(`${search}&side=1`)).toBe(false);
    expect(isComparison("?recording=recording/a.mcap")).toBe(false);
    expect(isComparison("?beside=beside/b.mcap")).toBe(false);
    expect(decodeURIComponent(besideOf(search))).toBe(
      "recording=beside/b.mcap&beside=recording/a.mcap&time=5",
    );
    const link = linkTo(`http://localhost/${search}&side=1`, {
      timeS: 7,
      agent: null,
      layers: null,
      camera: null,
    });
    expect(link).toBe("http://localhost/?recording=recording/a.mcap&beside=beside/b.mcap&time=7");
  });

  test("hold no token", () => {
    const server = "ws://127.0.0.1:8765/?token=0123456789abcdef";
    const page = `http://127.0.0.1/?server=${encodeURIComponent(server)}&token=0123456789abcdef`;
    const link = linkTo(page, { timeS: null, agent: null, layers: null, camera: null });
    expect(link).toBe("http://127.0.0.1/?server=ws://127.0.0.1:8765/");
  });

  test("with errors say nothing", () => {
    for (const search of [
      "",
      "?time=-1&agent=x&camera=1,2,3",
      "?camera=0,0,0,0,95,3&time=",
      "?camera=0,0,0,0,0,0",
    ]) {
      expect(parseLink(search)).toEqual({ timeS: null, agent: null, layers: null, camera: null });
    }
  });
});
