import { describe, expect, it } from "vitest";
import { InvalidRequest } from "./errors.mjs";
import { frameTimesOf, frameTimes, idleLayers, parseRequest } from "./request.mjs";

const PICTURE = {
  url: "http://127.0.0.1:1234/?recording=r.mcap",
  out: "/tmp/a.png",
  size: [640, 360],
  at: 12,
};
const MOVIE = {
  url: PICTURE.url,
  out: "/tmp/a.mp4",
  size: [640, 360],
  from: null,
  to: null,
  seconds: 2,
  fps: 10,
};
const RECORDING = { endS: 407.42, agents: 5, layers: ["walls", "trails", "hits"] };

/** @param {object} value */
const request = (value) => parseRequest(JSON.stringify(value));
/** @param {object} value */
const times = (value) => frameTimesOf(request(value), RECORDING);

describe("a request", () => {
  it("for an image", () => {
    const cut = { axis: "z", share: 0.5 };
    const onWhite = { camera: "top", background: "white" };
    expect(request({ ...PICTURE, agent: 3, layers: ["walls"], cut, ...onWhite })).toEqual({
      kind: "png",
      url: PICTURE.url,
      out: "/tmp/a.png",
      size: [640, 360],
      agent: 3,
      layers: ["walls"],
      cut,
      ...onWhite,
      atS: 12,
    });
  });

  it("for a movie", () => {
    expect(request({ ...MOVIE, to: 300, agent: null, layers: null })).toEqual({
      kind: "mp4",
      url: PICTURE.url,
      out: "/tmp/a.mp4",
      size: [640, 360],
      agent: null,
      layers: null,
      cut: null,
      camera: "corner",
      background: "dark",
      fromS: null,
      toS: 300,
      lengthS: 2,
      fps: 10,
    });
    expect(request({ ...MOVIE, out: "/tmp/A.GIF" }).kind).toBe("gif");
  });

  it.each([
    ["{", "expected one argument: a JSON object"],
    ["[1]", "expected one argument: a JSON object"],
    [undefined, "expected one argument: a JSON object"],
  ])("that is not a JSON object is rejected: %s", (text, message) => {
    expect(() => parseRequest(text)).toThrow(message);
  });

  it.each([
    [{ ...PICTURE, url: "file:///etc/passwd" }, 'url "file:///etc/passwd": expected the address of the page'],
    [{ ...PICTURE, out: "a.png" }, '--out "a.png": expected an absolute path'],
    [{ ...PICTURE, out: "/tmp/a.mp4" }, "--out /tmp/a.mp4: an image ends in .png"],
    [{ ...PICTURE, out: "/tmp/.png" }, "--out /tmp/.png: an image ends in .png"],
    [{ ...MOVIE, out: "/tmp/a.png" }, "--out /tmp/a.png: a movie ends in .mp4 or .gif"],
    [{ ...MOVIE, out: "/tmp.gif/a" }, "--out /tmp.gif/a: a movie ends in .mp4 or .gif"],
    [{ ...PICTURE, size: [640] }, "--size 640: expected WIDTHxHEIGHT in pixels, each from 16 to 8192"],
    [{ ...PICTURE, size: [640, 15] }, "--size 640x15: expected"],
    [{ ...PICTURE, size: [8193, 640] }, "--size 8193x640: expected"],
    [{ ...PICTURE, size: [640.5, 640] }, "--size 640.5x640: expected"],
    [{ ...PICTURE, agent: -1 }, "--agent -1: expected an agent id"],
    [
      { ...PICTURE, cut: { axis: "w", share: 1 } },
      'cut {"axis":"w","share":1}: expected an axis and a share',
    ],
    [{ ...PICTURE, cut: { axis: "x", share: 0 } }, "expected an axis and a share above 0"],
    [{ ...PICTURE, agent: 1.5 }, "--agent 1.5: expected an agent id"],
    [{ ...PICTURE, layers: [] }, "--layers []: expected layer names"],
    [{ ...PICTURE, layers: "walls" }, '--layers "walls": expected layer names'],
    [{ ...PICTURE, at: "12" }, '--at "12": expected a number'],
    [{ ...MOVIE, from: "0" }, '--from "0": expected a number'],
    [{ ...MOVIE, seconds: 0 }, "--seconds 0: expected a number above 0"],
    [{ ...MOVIE, fps: undefined }, "--fps undefined: expected a number above 0 up to 120"],
    [{ ...MOVIE, fps: 121 }, "--fps 121: expected a number above 0 up to 120"],
    [{ ...MOVIE, out: "/tmp/a.gif", fps: 51 }, "--fps 51: expected a number above 0 up to 50"],
    [{ ...MOVIE, size: [641, 360] }, "--size 641x360: an MP4 needs an even width and height"],
  ])("with invalid values is rejected: %o", (value, message) => {
    expect(() => request(value)).toThrow(InvalidRequest);
    expect(() => request(value)).toThrow(message);
  });

  it("for a GIF or an image may have odd sides", () => {
    expect(request({ ...MOVIE, out: "/tmp/a.gif", size: [641, 361] }).size).toEqual([641, 361]);
    expect(request({ ...PICTURE, size: [641, 361] }).size).toEqual([641, 361]);
  });
});

describe("limits of a recording", () => {
  it("the end has a tolerance of half a tick", () => {
    expect(times({ ...PICTURE, at: 0 })).toEqual([0]);
    expect(times({ ...PICTURE, at: 407.42 })).toEqual([407.42]);
    expect(frameTimesOf(request({ ...PICTURE, at: 407.42 }), { ...RECORDING, endS: 407.4166 })).toEqual([
      407.4166,
    ]);
  });

  it.each([
    [{ ...PICTURE, at: 500 }, "--at 500: the recording goes from 0 to 407.42 s"],
    [{ ...PICTURE, at: 407.44 }, "--at 407.44: the recording goes from 0 to 407.42 s"],
    [{ ...PICTURE, at: -0.02 }, "--at -0.02: the recording goes from 0 to 407.42 s"],
    [{ ...MOVIE, from: -1 }, "--from -1: the recording goes from 0 to 407.42 s"],
    [{ ...MOVIE, to: 408 }, "--to 408: the recording goes from 0 to 407.42 s"],
    [{ ...MOVIE, from: 407.42 }, "--from 407.42 --to 407.42: the movie must end after it begins"],
    [{ ...MOVIE, from: 30, to: 20 }, "--from 30 --to 20: the movie must end after it begins"],
    [{ ...PICTURE, agent: 5 }, "--agent 5: the agents are 0 to 4"],
    [{ ...PICTURE, layers: ["walls", "fog"] }, "--layers fog: the layers are walls, trails, hits"],
  ])("requests beyond them are rejected: %o", (value, message) => {
    expect(() => times(value)).toThrow(InvalidRequest);
    expect(() => times(value)).toThrow(message);
  });

  it("a single agent", () => {
    const alone = { ...RECORDING, agents: 1 };
    expect(() => frameTimesOf(request({ ...PICTURE, agent: 1 }), alone)).toThrow(
      "--agent 1: the only agent is 0",
    );
    expect(frameTimesOf(request({ ...PICTURE, agent: 0 }), alone)).toEqual([12]);
  });
});

describe("frames", () => {
  it("have equal steps from the first time to the last", () => {
    expect(frameTimes(10, 20, 1, 5)).toEqual([10, 12.5, 15, 17.5, 20]);
  });

  it("of a whole recording fill the length of the movie", () => {
    const all = times(MOVIE);
    expect(all).toHaveLength(20);
    expect(all[0]).toBe(0);
    expect(all.at(-1)).toBe(407.42);
    const steps = all.slice(1).map((timeS, frame) => timeS - (all[frame] ?? NaN));
    for (const step of steps) expect(step).toBeCloseTo(407.42 / 19, 9);
  });

  it("never exceed the interval", () => {
    for (const timeS of frameTimes(0.1, 0.3, 33, 7)) {
      expect(timeS).toBeGreaterThanOrEqual(0.1);
      expect(timeS).toBeLessThanOrEqual(0.3);
    }
  });

  it("are at least two", () => {
    expect(frameTimes(0, 1, 0.2, 10)).toEqual([0, 1]);
    expect(() => frameTimes(0, 1, 0.1, 10)).toThrow("--seconds 0.1 --fps 10: that is 1 frames");
  });
});

it("knows the layers that need an agent", () => {
  expect(idleLayers(request({ ...PICTURE, layers: ["walls", "hits"] }))).toEqual(["hits"]);
  expect(idleLayers(request({ ...PICTURE, layers: ["walls", "hits"], agent: 0 }))).toEqual([]);
  expect(idleLayers(request(PICTURE))).toEqual([]);
});
