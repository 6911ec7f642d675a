import { CdrWriter } from "@foxglove/cdr";
import type { IWebSocket } from "@foxglove/ws-protocol";
import { beforeEach, describe, expect, it } from "vitest";
import { LiveConnection, socketAddress } from "./live.ts";
import type { ConnectionEnvironment } from "./live.ts";
import { SERVICES } from "./services.ts";

const URL_ = "ws://here:8765";
const FULL = 512 * 1024;

interface Sent {
  readonly op: string;
  readonly uri?: string;
  readonly requestId?: number;
  readonly parameters?: unknown;
}

/** A socket whose server side is driven by the tests. */
class Socket implements IWebSocket {
  binaryType = "";
  protocol = "";
  onerror = null;
  onopen = null;
  onclose: ((event: unknown) => void) | null = null;
  onmessage: ((event: { data: unknown }) => void) | null = null;
  isClosed = false;
  readonly sent: Sent[] = [];
  readonly calls: { serviceId: number; callId: number; data: Uint8Array }[] = [];

  close(): void {
    this.isClosed = true;
  }

  send(data: string | ArrayBuffer | ArrayBufferView): void {
    if (typeof data === "string") {
      this.sent.push(JSON.parse(data) as Sent);
      return;
    }
    const bytes = data as Uint8Array;
    const view = new DataView(bytes.buffer, bytes.byteOffset);
    const encoding = view.getUint32(9, true);
    this.calls.push({
      serviceId: view.getUint32(1, true),
      callId: view.getUint32(5, true),
      data: bytes.slice(13 + encoding),
    });
  }

  say(message: object): void {
    this.onmessage?.({ data: JSON.stringify(message) });
  }

  introduce(run: string, idle = "false"): void {
    const metadata = { maes: "1", idle };
    this.say({ op: "serverInfo", name: "MAES", sessionId: run || "idle-77", capabilities: [], metadata });
  }

  get lastFetch(): { uri: string; requestId: number } {
    return this.sent.filter(({ op }) => op === "fetchAsset").at(-1) as { uri: string; requestId: number };
  }

  get fetches(): string[] {
    return this.sent.filter(({ op }) => op === "fetchAsset").map(({ uri }) => uri!);
  }

  /** Answers the last asset request. */
  give(data: Uint8Array | string, requestId = this.lastFetch.requestId): void {
    const error = typeof data === "string" ? new TextEncoder().encode(data) : new Uint8Array();
    const body = typeof data === "string" ? new Uint8Array() : data;
    const bytes = new Uint8Array(10 + error.length + body.length);
    const view = new DataView(bytes.buffer);
    view.setUint8(0, 4);
    view.setUint32(1, requestId, true);
    view.setUint8(5, typeof data === "string" ? 1 : 0);
    view.setUint32(6, error.length, true);
    bytes.set(error, 10);
    bytes.set(body, 10 + error.length);
    this.onmessage?.({ data: bytes.buffer });
  }

  answer(call: { serviceId: number; callId: number }, data: Uint8Array): void {
    const bytes = new Uint8Array(13 + 3 + data.length);
    const view = new DataView(bytes.buffer);
    view.setUint8(0, 3);
    view.setUint32(1, call.serviceId, true);
    view.setUint32(5, call.callId, true);
    view.setUint32(9, 3, true);
    bytes.set(new TextEncoder().encode("cdr"), 13);
    bytes.set(data, 16);
    this.onmessage?.({ data: bytes.buffer });
  }
}

class Feed {
  readonly run = new Promise<never>(() => undefined);
  bytes: number[] = [];
  hasEnded = false;
  constructor(readonly id: string) {}
  push(bytes: Uint8Array): void {
    for (const byte of bytes) this.bytes.push(byte);
  }
  end(): void {
    this.hasEnded = true;
  }
}

let sockets: Socket[];
let feeds: Feed[];
let timers: { at: number; then: () => void }[];
let now: number;
let changes: number;
let environment: ConnectionEnvironment;
/** Whether the server asks for its token. */
let wantsToken: boolean;

/** Advances the time and runs due timers in order. */
function pass(milliseconds: number): void {
  const end = now + milliseconds;
  for (;;) {
    const due = timers.filter(({ at }) => at <= end).sort((a, b) => a.at - b.at)[0];
    if (!due) break;
    timers.splice(timers.indexOf(due), 1);
    now = due.at;
    due.then();
  }
  now = end;
}

function connect(options?: { once?: boolean }): LiveConnection {
  const listener = { changed: () => changes++, feedOpened: () => undefined };
  return new LiveConnection(URL_, listener, environment, options);
}

const socket = () => sockets.at(-1)!;
const feed = () => feeds.at(-1)!;
const settled = () => new Promise<void>((resolve) => setImmediate(resolve));

beforeEach(() => {
  sockets = [];
  feeds = [];
  timers = [];
  now = 0;
  changes = 0;
  wantsToken = false;
  environment = {
    wantsToken: () => Promise.resolve(wantsToken),
    openSocket: () => {
      sockets.push(new Socket());
      return socket();
    },
    later: (milliseconds, then) => {
      const timer = { at: now + milliseconds, then };
      timers.push(timer);
      return () => {
        timers = timers.filter((other) => other !== timer);
      };
    },
    openFeed: (id) => {
      feeds.push(new Feed(id));
      return feed();
    },
  };
});

describe("pulling a run", () => {
  it("requests the next bytes, one request at a time", () => {
    const live = connect();
    socket().introduce("a1");
    expect(live.state).toBe("open");
    expect(feed().id).toBe("a1");
    expect(socket().fetches).toEqual(["maes://run/a1/0"]);
    pass(900);
    expect(socket().fetches).toHaveLength(1);
    socket().give(Uint8Array.of(1, 2, 3));
    expect(socket().fetches).toHaveLength(1);
    pass(50);
    expect(socket().fetches).toEqual(["maes://run/a1/0", "maes://run/a1/3"]);
    socket().give(new Uint8Array());
    pass(50);
    expect(socket().fetches.at(-1)).toBe("maes://run/a1/3");
    socket().give(Uint8Array.of(4));
    expect(feed().bytes).toEqual([1, 2, 3, 4]);
  });

  it("requests at once while responses are full", () => {
    connect();
    socket().introduce("a1");
    socket().give(new Uint8Array(FULL));
    expect(socket().fetches.at(-1)).toBe(`maes://run/a1/${FULL}`);
    socket().give(new Uint8Array(FULL - 1));
    expect(socket().fetches).toHaveLength(2);
  });

  it("ignores unrequested responses", () => {
    connect();
    socket().introduce("a1");
    socket().give(Uint8Array.of(1));
    socket().give(Uint8Array.of(1));
    socket().give(Uint8Array.of(9), 77);
    expect(feed().bytes).toEqual([1]);
  });

  it("ends when all is received, and stops requesting", () => {
    const live = connect();
    socket().introduce("a1");
    socket().give("ended");
    expect(live.hasEnded).toBe(true);
    expect(feed().hasEnded).toBe(true);
    pass(5000);
    expect(socket().fetches).toHaveLength(1);
    expect(live.canControl).toBe(false);
    expect(live.canStart).toBe(false);
  });

  it("reports an error and retries", () => {
    const live = connect();
    socket().introduce("a1");
    socket().give("no such thing");
    expect(live.problem).toContain("no such thing");
    pass(1000);
    expect(socket().fetches).toEqual(["maes://run/a1/0", "maes://run/a1/0"]);
  });
});

describe("another run", () => {
  it("starts when the server announces it", () => {
    connect();
    socket().introduce("a1");
    socket().give(Uint8Array.of(1, 2));
    pass(50);
    const late = socket().lastFetch.requestId;
    socket().introduce("b2");
    expect(feeds.map(({ id }) => id)).toEqual(["a1", "b2"]);
    expect(feeds[0]!.hasEnded).toBe(true);
    expect(socket().fetches.at(-1)).toBe("maes://run/b2/0");
    socket().give(Uint8Array.of(3), late);
    expect(feed().bytes).toEqual([]);
    socket().give(Uint8Array.of(7));
    expect(feed().bytes).toEqual([7]);
  });

  it("is awaited when the present one is gone", () => {
    const live = connect();
    socket().introduce("a1");
    socket().give("gone");
    expect(feed().hasEnded).toBe(true);
    expect(live.canControl).toBe(false);
    socket().introduce("b2");
    expect(socket().fetches.at(-1)).toBe("maes://run/b2/0");
    pass(5000);
    expect(sockets).toHaveLength(1);
  });

  it("is requested by reconnecting if the server does not announce it", () => {
    connect();
    socket().introduce("a1");
    socket().give("gone");
    pass(2000);
    expect(sockets).toHaveLength(2);
    socket().introduce("b2");
    expect(socket().fetches).toEqual(["maes://run/b2/0"]);
  });

  it("may be missing", () => {
    const live = connect();
    socket().introduce("", "true");
    expect(live.canStart).toBe(true);
    expect(feeds).toEqual([]);
    expect(socket().fetches).toEqual([]);
  });
});

describe("a lost connection", () => {
  it("asks for the new address if the token is refused, and tries again", async () => {
    const live = connect();
    socket().introduce("a1");
    wantsToken = true;
    socket().onclose?.({});
    await settled();
    expect(live.problem).toContain("?token=");
    expect(live.state).toBe("lost");
    pass(1000);
    expect(sockets).toHaveLength(2);
    socket().introduce("b2");
    await settled();
    expect(live.problem).toBeNull();
  });

  it("resumes at the same offset, even during a request", () => {
    const live = connect();
    socket().introduce("a1");
    socket().give(Uint8Array.of(1, 2));
    pass(50);
    socket().onclose?.({});
    expect(live.state).toBe("lost");
    expect(live.problem).toContain("lost");
    pass(999);
    expect(sockets).toHaveLength(1);
    pass(1);
    expect(sockets).toHaveLength(2);
    socket().introduce("a1");
    expect(live.state).toBe("open");
    expect(live.problem).toBeNull();
    expect(feeds).toHaveLength(1);
    expect(socket().fetches).toEqual(["maes://run/a1/2"]);
    socket().give(Uint8Array.of(3));
    expect(feed().bytes).toEqual([1, 2, 3]);
  });

  it("is retried indefinitely; late events of the old one are ignored", () => {
    connect();
    const first = socket();
    first.introduce("a1");
    first.onclose?.({});
    for (let attempt = 0; attempt < 20; attempt++) {
      pass(1000);
      socket().onclose?.({});
    }
    expect(sockets).toHaveLength(21);
    first.introduce("b2");
    expect(feeds).toHaveLength(1);
  });

  it("is given up if the only attempt fails", () => {
    const live = connect({ once: true });
    socket().onclose?.({});
    expect(live.state).toBe("closed");
    pass(60_000);
    expect(sockets).toHaveLength(1);
  });

  it("is given up if the first attempt times out", () => {
    const live = connect({ once: true });
    pass(4000);
    expect(live.state).toBe("closed");
    expect(socket().isClosed).toBe(true);
  });

  it("is not established with another kind of server", () => {
    const live = connect();
    socket().say({ op: "serverInfo", name: "robot", capabilities: [] });
    expect(live.state).toBe("closed");
    expect(live.problem).toContain('"robot"');
    pass(60_000);
    expect(sockets).toHaveLength(1);
  });

  it("stays closed after close()", () => {
    const live = connect();
    socket().introduce("a1");
    live.close();
    expect(feed().hasEnded).toBe(true);
    pass(60_000);
    expect(sockets).toHaveLength(1);
  });
});

describe("commands", () => {
  const advertised = Object.values(SERVICES).map((name, id) => ({ id, name, type: "" }));
  const idOf = (name: string) => advertised.find((service) => service.name === name)!.id;
  const outcome = (code: number, message: string) => {
    const writer = new CdrWriter();
    writer.uint8(code);
    writer.string(message);
    return writer.data;
  };

  function open(): LiveConnection {
    const live = connect();
    socket().introduce("a1");
    socket().say({ op: "advertiseServices", services: advertised });
    return live;
  }

  const callOf = (name: string) =>
    socket()
      .calls.filter(({ serviceId }) => serviceId === idOf(name))
      .at(-1)!;

  it("are CDR service calls", async () => {
    const live = open();
    const done = live.step(50);
    const call = callOf(SERVICES.step);
    expect([...call.data.subarray(4)]).toEqual([50, 0, 0, 0, 0, 0, 0, 0]);
    expect([...call.data.subarray(0, 4)]).toEqual([0, 1, 0, 0]);
    socket().answer(call, outcome(1, ""));
    await expect(done).resolves.toBeUndefined();
  });

  it("that are refused report the reason", async () => {
    const live = open();
    const done = live.pause();
    socket().answer(callOf(SERVICES.setState), outcome(103, "invalid transition"));
    await expect(done).rejects.toThrow("invalid transition");
    const failed = live.restart();
    const { serviceId, callId } = callOf(SERVICES.reset);
    socket().say({ op: "serviceCallFailure", serviceId, callId, message: "busy" });
    await expect(failed).rejects.toThrow("busy");
  });

  it("succeed if the state is already reached", async () => {
    const live = open();
    const done = live.play();
    socket().answer(callOf(SERVICES.setState), outcome(101, "already in that state"));
    await expect(done).resolves.toBeUndefined();
  });

  it("fail with the connection", async () => {
    const live = open();
    const done = live.play();
    socket().onclose?.({});
    await expect(done).rejects.toThrow("lost");
    await expect(live.play()).rejects.toThrow("does not offer");
  });

  it("poll the simulation state", async () => {
    const live = open();
    expect(live.canControl).toBe(true);
    const writer = new CdrWriter();
    writer.uint8(2);
    writer.uint8(1);
    writer.string("");
    socket().answer(callOf(SERVICES.getState), writer.data);
    await settled();
    expect(live.simulationState).toBe(2);
    const calls = socket().calls.length;
    pass(1000);
    expect(socket().calls.length).toBe(calls + 1);
  });

  it("set the real-time factor", () => {
    const live = open();
    live.setRtf(20);
    expect(socket().sent.at(-1)!.parameters).toEqual([{ name: "execution.rtf", value: 20, type: "float64" }]);
    socket().say({ op: "parameterValues", parameters: [{ name: "execution.rtf", value: 5 }] });
    expect(live.rtf).toBe(5);
  });

  it("start a run, or report the error in the scenario", async () => {
    const live = open();
    const json = (value: object) => new TextEncoder().encode(JSON.stringify(value));
    const refused = live.start("seed = -1", false);
    const call = callOf(SERVICES.startRun);
    expect(JSON.parse(new TextDecoder().decode(call.data))).toEqual({
      scenario: "seed = -1",
      record: false,
    });
    socket().answer(call, json({ started: false, message: "seed: 0 to 2^63 - 1" }));
    expect(await refused).toEqual({ refusal: "seed: 0 to 2^63 - 1", recording: null });
    const started = live.start("seed = 1", true);
    const second = callOf(SERVICES.startRun);
    expect(JSON.parse(new TextDecoder().decode(second.data))).toEqual({ scenario: "seed = 1", record: true });
    socket().answer(second, json({ started: true, message: "", recording: "run_1.mcap" }));
    expect(await started).toEqual({ refusal: null, recording: "run_1.mcap" });
  });
});

describe("addresses", () => {
  it("are normalised", () => {
    expect(socketAddress(" cave:8765 ")).toBe("ws://cave:8765");
    expect(socketAddress("https://cave/x")).toBe("wss://cave/x");
    expect(socketAddress("wss://cave")).toBe("wss://cave");
  });
});
