/**
 * The connection with a simulator: pulls the bytes of the run under way, calls services, sets the speed, and comes back after the
 * connection was lost.
 *
 * A run is pulled piece by piece, one request at a time, so nothing is lost, and a page that is slow only lags. Bytes go to a feed
 * in order and without gaps, over however many connections; another run of the simulator is another feed. The machine knows
 * nothing of the screen: whoever wants to know what has changed is told by `changed`.
 */
import { FoxgloveClient } from "@foxglove/ws-protocol";
import type { FetchAssetResponse, IWebSocket, ServerInfo, Service } from "@foxglove/ws-protocol";
import type { LiveFeed } from "../data/sources.ts";
import { ServiceCalls } from "./service-calls.ts";
import * as services from "./services.ts";

/** The subprotocol that the simulator speaks. */
export const SUBPROTOCOL = "foxglove.sdk.v1";

/** An answer at least so long means that more is there already. */
const FULL_BYTES = 512 * 1024;
const PULL_PERIOD_MS = 50;
const RECONNECT_MS = 1000;
const STATE_POLL_MS = 1000;
/** A server that does not answer a first attempt within this time is not there. */
const CONNECT_TIMEOUT_MS = 4000;
const RTF = "execution.rtf";
/** What the sessions of a server without a run begin with. */
const IDLE_PREFIX = "idle-";

export type ConnectionState =
  /** The first attempt is under way. */
  | "connecting"
  | "open"
  /** It was lost, and is tried again. */
  | "lost"
  /** Nobody will try any more: there is no simulator, or the page has closed it. */
  | "closed";

/** What the machine needs of its environment; tests give it others. */
export interface ConnectionEnvironment {
  openSocket(url: string): IWebSocket;
  /** Calls back after a time, unless the function it returns was called before. */
  later(milliseconds: number, then: () => void): () => void;
  openFeed(id: string, title: string): LiveFeed;
}

export interface ConnectionListener {
  /** Something that `LiveConnection` shows is another. */
  changed(): void;
  /** A run of the simulator begins to come. */
  feedOpened(feed: LiveFeed): void;
}

export class LiveConnection {
  readonly url: string;
  state: ConnectionState = "connecting";
  /** Why the connection is not open, in words; null if it is. */
  problem: string | null = null;
  /** The run under way; empty: none. */
  session = "";
  /** Whether runs can be started from here. */
  isIdleServer = false;
  /** Whether everything of the run has come, and no more will. */
  hasEnded = false;
  /** What the server says of its clock; null: not known. */
  simulationState: number | null = null;
  /** Sim seconds for each second; 0: as fast as possible; null: not known. */
  rtf: number | null = null;

  readonly #listener: ConnectionListener;
  readonly #environment: ConnectionEnvironment;
  readonly #calls = new ServiceCalls();
  readonly #isOnce: boolean;
  #client: FoxgloveClient | null = null;
  #feed: LiveFeed | null = null;
  #offset = 0;
  #lastRequest = 0;
  /** The request that is under way, or 0. */
  #pending = 0;
  #wasOpen = false;
  #cancels = new Map<string, () => void>();

  /** `once`: a first attempt that fails is not repeated. */
  constructor(
    url: string,
    listener: ConnectionListener,
    environment: ConnectionEnvironment,
    options?: { once?: boolean },
  ) {
    this.url = url;
    this.#listener = listener;
    this.#environment = environment;
    this.#isOnce = options?.once ?? false;
    this.#connect();
  }

  close(): void {
    this.state = "closed";
    this.#drop();
    this.#endFeed();
  }

  /** Calls a service; throws with the server's words if it was refused. */
  async #request(name: string, data: Uint8Array): Promise<void> {
    const outcome = services.readOutcome(await this.#calls.call(name, data));
    this.#pollState();
    if (!services.isSuccess(outcome)) {
      throw new Error(outcome.message || `The simulator refused ${name} with code ${outcome.code}.`);
    }
  }

  play(): Promise<void> {
    return this.#request(services.SERVICES.setState, services.setStateRequest(services.STATE.playing));
  }

  pause(): Promise<void> {
    return this.#request(services.SERVICES.setState, services.setStateRequest(services.STATE.paused));
  }

  step(ticks: number): Promise<void> {
    return this.#request(services.SERVICES.step, services.stepRequest(ticks));
  }

  restart(): Promise<void> {
    return this.#request(services.SERVICES.reset, services.resetRequest());
  }

  /** Ends the run for good. */
  stop(): Promise<void> {
    return this.#request(services.SERVICES.setState, services.setStateRequest(services.STATE.quitting));
  }

  setRtf(rtf: number): void {
    if (!this.#client || this.state !== "open") throw new Error("There is no connection with the simulator.");
    this.rtf = rtf;
    this.#client.setParameters([{ name: RTF, value: rtf, type: "float64" }]);
    this.#listener.changed();
  }

  /** Starts a run; returns what is wrong with the scenario, or null if it has started. */
  async start(scenario: string): Promise<string | null> {
    const data = await this.#calls.call(services.SERVICES.startRun, services.startRequest(scenario));
    const answer = services.readStart(data);
    return answer.started ? null : answer.message || "The simulator did not start the run.";
  }

  /** Whether there is a run to be controlled. */
  get canControl(): boolean {
    return (
      this.state === "open" &&
      this.session !== "" &&
      !this.hasEnded &&
      this.#calls.has(services.SERVICES.setState)
    );
  }

  /** Whether a run can be started: there is none, or it is over. */
  get canStart(): boolean {
    return this.state === "open" && this.isIdleServer && (this.session === "" || this.hasEnded);
  }

  #connect(): void {
    let socket: IWebSocket;
    try {
      socket = this.#environment.openSocket(this.url);
    } catch (error) {
      this.#abandon(
        `${this.url} is no address of a simulator: ${(error as Error).message} Expected: ws://host:port.`,
      );
      return;
    }
    const client = new FoxgloveClient({ ws: socket });
    this.#client = client;
    // What an old connection still has to say is of no interest.
    const ifPresent =
      <Args extends unknown[]>(then: (...args: Args) => void) =>
      (...args: Args) => {
        if (this.#client === client) then(...args);
      };
    client.on(
      "serverInfo",
      ifPresent((info: ServerInfo) => this.#onServerInfo(info)),
    );
    client.on(
      "fetchAssetResponse",
      ifPresent((answer: FetchAssetResponse) => this.#onAsset(answer)),
    );
    client.on(
      "advertiseServices",
      ifPresent((added: Service[]) => this.#onServices(added)),
    );
    client.on(
      "unadvertiseServices",
      ifPresent((ids: number[]) => this.#calls.remove(ids)),
    );
    client.on(
      "serviceCallResponse",
      ifPresent((answer) => this.#calls.answered(answer)),
    );
    client.on(
      "serviceCallFailure",
      ifPresent((failure) => this.#calls.failed(failure)),
    );
    client.on(
      "parameterValues",
      ifPresent(({ parameters }) => {
        const value = parameters.find((parameter) => parameter.name === RTF)?.value;
        if (typeof value !== "number" || value === this.rtf) return;
        this.rtf = value;
        this.#listener.changed();
      }),
    );
    client.on(
      "close",
      ifPresent(() => this.#onClose()),
    );
    // A close always follows; what the error was, a browser does not tell.
    client.on("error", () => undefined);
    this.#calls.connect((request) => client.sendServiceCallRequest(request));
    this.#after("attempt", CONNECT_TIMEOUT_MS, () => this.#onClose());
  }

  #onServerInfo(info: ServerInfo): void {
    this.#cancel("attempt");
    const metadata = info.metadata ?? {};
    if (metadata["maes"] === undefined) {
      this.#abandon(
        `${this.url} answers as "${info.name}", which is not a simulator of this page (no "maes" in what it says of itself).`,
      );
      return;
    }
    const isNew = this.state !== "open";
    this.state = "open";
    this.#wasOpen = true;
    this.problem = null;
    this.isIdleServer = metadata["idle"] === "true";
    const session = sessionOf(info);
    if (session !== this.session) this.#begin(session);
    if (isNew) {
      this.#client?.subscribeParameterUpdates([RTF]);
      this.#client?.getParameters([RTF]);
    }
    if (this.#pending === 0) this.#pull();
    this.#listener.changed();
  }

  #begin(session: string): void {
    this.session = session;
    this.#endFeed();
    this.#offset = 0;
    this.#pending = 0;
    this.#cancel("pull");
    this.hasEnded = false;
    this.simulationState = null;
    if (session === "") return;
    this.#feed = this.#environment.openFeed(session, `Run at ${new URL(this.url).host}`);
    this.#listener.feedOpened(this.#feed);
    this.#pollState();
  }

  #pull(): void {
    this.#cancel("pull");
    if (this.state !== "open" || !this.#feed || this.hasEnded || this.#pending !== 0) return;
    this.#lastRequest += 1;
    this.#pending = this.#lastRequest;
    this.#client?.fetchAsset(`maes://run/${this.session}/${this.#offset}`, this.#pending);
  }

  #onAsset(answer: FetchAssetResponse): void {
    if (answer.requestId !== this.#pending || !this.#feed) return;
    this.#pending = 0;
    if ("data" in answer) {
      const { buffer, byteOffset, byteLength } = answer.data;
      if (byteLength > 0) this.#feed.push(new Uint8Array(buffer as ArrayBuffer, byteOffset, byteLength));
      this.#offset += byteLength;
      if (byteLength >= FULL_BYTES) this.#pull();
      else this.#after("pull", PULL_PERIOD_MS, () => this.#pull());
      return;
    }
    if (answer.error.startsWith("ended")) {
      this.hasEnded = true;
      this.#endFeed();
      this.#listener.changed();
    } else if (answer.error.startsWith("gone")) {
      // The server says which run it is now; if it does not, a new connection asks.
      this.#endFeed();
      this.session = "";
      this.#after("pull", RECONNECT_MS, () => this.#onClose());
      this.#listener.changed();
    } else {
      this.problem = `The simulator does not hand over its run: ${answer.error}`;
      this.#after("pull", RECONNECT_MS, () => this.#pull());
      this.#listener.changed();
    }
  }

  /** Nothing more of this run will come. */
  #endFeed(): void {
    this.#feed?.end();
    this.#feed = null;
  }

  #onServices(added: readonly Service[]): void {
    this.#calls.add(added);
    this.#pollState();
    this.#listener.changed();
  }

  #pollState(): void {
    this.#after("state", STATE_POLL_MS, () => this.#pollState());
    if (this.state !== "open" || this.hasEnded || !this.#calls.has(services.SERVICES.getState)) return;
    this.#calls
      .call(services.SERVICES.getState, services.emptyRequest())
      .then((data) => {
        const { state } = services.readState(data);
        if (state === this.simulationState) return;
        this.simulationState = state;
        this.#listener.changed();
      })
      // Whoever is too busy to answer is asked again.
      .catch(() => undefined);
  }

  #onClose(): void {
    this.#drop();
    if (this.#isOnce && !this.#wasOpen) {
      this.#abandon(`No simulator answers at ${this.url}.`);
      return;
    }
    this.state = this.#wasOpen ? "lost" : "connecting";
    this.problem = this.#wasOpen
      ? `The connection with ${this.url} was lost. Trying again.`
      : `No simulator answers at ${this.url}. Trying again.`;
    this.simulationState = null;
    this.#after("reconnect", RECONNECT_MS, () => this.#connect());
    this.#listener.changed();
  }

  #abandon(problem: string): void {
    this.close();
    this.problem = problem;
    this.#listener.changed();
  }

  #drop(): void {
    for (const name of [...this.#cancels.keys()]) this.#cancel(name);
    this.#pending = 0;
    const client = this.#client;
    this.#client = null;
    this.#calls.disconnect();
    client?.close();
  }

  #after(name: string, milliseconds: number, then: () => void): void {
    this.#cancel(name);
    const cancel = this.#environment.later(milliseconds, () => {
      this.#cancels.delete(name);
      then();
    });
    this.#cancels.set(name, cancel);
  }

  #cancel(name: string): void {
    this.#cancels.get(name)?.();
    this.#cancels.delete(name);
  }
}

/** The run that a server has; empty: none. */
function sessionOf({ sessionId }: ServerInfo): string {
  return sessionId === undefined || sessionId.startsWith(IDLE_PREFIX) ? "" : sessionId;
}

/** The environment of a page. */
export function browserEnvironment(openFeed: ConnectionEnvironment["openFeed"]): ConnectionEnvironment {
  return {
    openSocket: (url) => new WebSocket(url, [SUBPROTOCOL]) as IWebSocket,
    later(milliseconds, then) {
      const timer = setTimeout(then, milliseconds);
      return () => clearTimeout(timer);
    },
    openFeed,
  };
}

/** An address as people write it, as one of a WebSocket: `host:port` and `http://host:port` are fine, too. */
export function socketAddress(text: string): string {
  const trimmed = text.trim();
  if (/^wss?:\/\//i.test(trimmed)) return trimmed;
  if (/^https?:\/\//i.test(trimmed)) return trimmed.replace(/^http/i, "ws");
  return `ws://${trimmed}`;
}
