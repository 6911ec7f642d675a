/**
 * Client connection to a simulator: pulls the bytes of the live run, calls services, sets the
 * real-time factor, and reconnects after the connection was lost.
 *
 * A run is pulled piece by piece, one request at a time, so nothing is lost and a slow page only
 * lags behind. Bytes go to a feed in order and without gaps, across reconnections; another run of
 * the simulator gets another feed. The connection is independent of the user interface, which it
 * notifies through a listener.
 */
import { FoxgloveClient } from "@foxglove/ws-protocol";
import type { FetchAssetResponse, IWebSocket, ServerInfo, Service } from "@foxglove/ws-protocol";
import type { LiveFeed } from "../data/sources.ts";
import { LoopSubscription } from "./loop-times.ts";
import type { EditBox } from "./map-edit.ts";
import { ServiceCalls } from "./service-calls.ts";
import * as services from "./services.ts";

/** WebSocket subprotocol of the simulator. */
export const SUBPROTOCOL = "foxglove.sdk.v1";

/** A response of at least this size means that more is available now. */
const FULL_BYTES = 512 * 1024;
const PULL_PERIOD_MS = 50;
const RECONNECT_MS = 1000;
const STATE_POLL_MS = 1000;
/** Time after which an unanswered connection attempt has failed. */
const CONNECT_TIMEOUT_MS = 4000;
const RTF = "execution.rtf";
/** HTTP status of a request without the token of this start of the simulator. */
const UNAUTHORIZED = 401;
/** Session prefix of a server without a run. */
const IDLE_PREFIX = "idle-";

export type ConnectionState =
  /** The first attempt is in progress. */
  | "connecting"
  | "open"
  /** The connection was lost and is being retried. */
  | "lost"
  /** Given up: there is no simulator, or the page has closed the connection. */
  | "closed";

/** I/O of a connection, replaced in tests. */
export interface ConnectionEnvironment {
  openSocket(url: string): IWebSocket;
  /** Whether the server at this address refuses the page for want of its token, as far as known. */
  wantsToken(url: string): Promise<boolean>;
  /** Starts a timer; the returned function cancels it. */
  later(milliseconds: number, then: () => void): () => void;
  openFeed(id: string, title: string): LiveFeed;
}

export interface ConnectionListener {
  /** Some public state of the connection has changed. */
  changed(): void;
  /** A run of the simulator starts to arrive. */
  feedOpened(feed: LiveFeed): void;
}

export class LiveConnection {
  readonly url: string;
  state: ConnectionState = "connecting";
  /** Why the connection is not open, for people; null if it is. */
  problem: string | null = null;
  /** Session of the live run; empty: none. */
  session = "";
  /** Whether the server can start runs. */
  isIdleServer = false;
  /** Whether the whole run has been received. */
  hasEnded = false;
  /** State reported by the server, see `STATE`; null: not known. */
  simulationState: number | null = null;
  /** Requested real-time factor; 0: as fast as possible; null: not known. */
  rtf: number | null = null;
  /** Where the wall time of the simulator goes. */
  readonly loop = new LoopSubscription(() => this.#listener.changed());

  readonly #listener: ConnectionListener;
  readonly #environment: ConnectionEnvironment;
  readonly #calls = new ServiceCalls();
  readonly #isOnce: boolean;
  #client: FoxgloveClient | null = null;
  #feed: LiveFeed | null = null;
  #offset = 0;
  #lastRequest = 0;
  /** Id of the pending asset request, or 0. */
  #pending = 0;
  #wasOpen = false;
  #cancels = new Map<string, () => void>();

  /** `once`: do not retry the first attempt. */
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

  /** Calls a service; throws the server's message if it was refused. */
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

  /** Ends the run. */
  stop(): Promise<void> {
    return this.#request(services.SERVICES.setState, services.setStateRequest(services.STATE.quitting));
  }

  /** Makes the cells of a box wall or free; how many have changed. */
  async changeMap(isWall: boolean, box: EditBox): Promise<number> {
    const request = services.changeMapRequest(isWall, box);
    return services.readChangedCells(await this.#calls.call(services.SERVICES.changeMap, request));
  }

  setRtf(rtf: number): void {
    if (!this.#client || this.state !== "open") throw new Error("Not connected to the simulator.");
    this.rtf = rtf;
    this.#client.setParameters([{ name: RTF, value: rtf, type: "float64" }]);
    this.#listener.changed();
  }

  /** Starts a run. */
  async start(scenario: string, isRecorded: boolean): Promise<services.StartAnswer> {
    const request = services.startRequest(scenario, isRecorded);
    return services.readStart(await this.#calls.call(services.SERVICES.startRun, request));
  }

  /** Whether there is a run to control. */
  get canControl(): boolean {
    return (
      this.state === "open" &&
      this.session !== "" &&
      !this.hasEnded &&
      this.#calls.has(services.SERVICES.setState)
    );
  }

  /** Whether there is a run whose map can be changed. */
  get canChangeMap(): boolean {
    return this.canControl && this.#calls.has(services.SERVICES.changeMap);
  }

  /** Whether the run that has ended can be started again. */
  get canRestart(): boolean {
    return this.canStart && this.session !== "";
  }

  /** Whether a run can be started: the server is idle. */
  get canStart(): boolean {
    return this.state === "open" && this.isIdleServer && (this.session === "" || this.hasEnded);
  }

  #connect(): void {
    let socket: IWebSocket;
    try {
      socket = this.#environment.openSocket(this.url);
    } catch (error) {
      this.#abandon(
        `${this.url} is not the address of a simulator: ${(error as Error).message} Expected ws://host:port.`,
      );
      return;
    }
    const client = new FoxgloveClient({ ws: socket });
    this.#client = client;
    // Events of a superseded connection are ignored.
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
      ifPresent((answer) => this.#calls.onResponse(answer)),
    );
    client.on(
      "serviceCallFailure",
      ifPresent((failure) => this.#calls.onFailure(failure)),
    );
    client.on(
      "advertise",
      ifPresent((channels) => this.loop.onAdvertise(channels)),
    );
    client.on(
      "unadvertise",
      ifPresent((channels) => this.loop.onUnadvertise(channels)),
    );
    client.on(
      "message",
      ifPresent((message) => this.loop.onMessage(message)),
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
    // A close event always follows; browsers do not reveal the cause of the error.
    client.on("error", () => undefined);
    this.loop.connect(client);
    this.#calls.connect((request) => client.sendServiceCallRequest(request));
    this.#after("attempt", CONNECT_TIMEOUT_MS, () => this.#onClose());
  }

  #onServerInfo(info: ServerInfo): void {
    this.#cancel("attempt");
    const metadata = info.metadata ?? {};
    if (metadata["maes"] === undefined) {
      this.#abandon(
        `${this.url} is the server "${info.name}", not a MAES simulator (its metadata has no key "maes").`,
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
      // The server announces its present run; if it does not, reconnecting asks for it.
      this.#endFeed();
      this.session = "";
      this.#after("pull", RECONNECT_MS, () => this.#onClose());
      this.#listener.changed();
    } else {
      this.problem = `The simulator does not send its run: ${answer.error}`;
      this.#after("pull", RECONNECT_MS, () => this.#pull());
      this.#listener.changed();
    }
  }

  /** Ends the feed of the present run. */
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
      // The state is polled again.
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
      ? `The connection to ${this.url} was lost. Reconnecting.`
      : `No simulator answers at ${this.url}. Retrying.`;
    this.simulationState = null;
    this.#after("reconnect", RECONNECT_MS, () => this.#connect());
    this.#listener.changed();
    void this.#explainRefusal();
  }

  /**
   * A server that was started again has another token, and refuses the page. Browsers do not tell
   * why a WebSocket was refused, so it is asked for with a request of its own.
   */
  async #explainRefusal(): Promise<void> {
    if (!(await this.#environment.wantsToken(this.url))) return;
    if (this.state !== "lost" && this.state !== "connecting") return;
    this.problem =
      `The simulator at ${this.url} was started again and has a new token: ` +
      "open the address that it has printed, with ?token=...";
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
    this.loop.disconnect();
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

/** The session of the server's run; empty: none. */
function sessionOf({ sessionId }: ServerInfo): string {
  return sessionId === undefined || sessionId.startsWith(IDLE_PREFIX) ? "" : sessionId;
}

/** The I/O of a browser page. */
export function browserEnvironment(openFeed: ConnectionEnvironment["openFeed"]): ConnectionEnvironment {
  return {
    openSocket: (url) => new WebSocket(url, [SUBPROTOCOL]) as IWebSocket,
    async wantsToken(url) {
      const address = new URL(url.replace(/^ws/i, "http"));
      // Others do not show their responses to this page.
      if (address.origin !== window.location.origin) return false;
      try {
        const { status } = await fetch(address, { method: "HEAD", cache: "no-store" });
        return status === UNAUTHORIZED;
      } catch {
        return false;
      }
    },
    later(milliseconds, then) {
      const timer = setTimeout(then, milliseconds);
      return () => clearTimeout(timer);
    },
    openFeed,
  };
}

/** Normalises a WebSocket address: `host:port` and `http://host:port` are accepted as well. */
export function socketAddress(text: string): string {
  const trimmed = text.trim();
  if (/^wss?:\/\//i.test(trimmed)) return trimmed;
  if (/^https?:\/\//i.test(trimmed)) return trimmed.replace(/^http/i, "ws");
  return `ws://${trimmed}`;
}
