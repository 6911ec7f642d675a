/**
 * Where the wall time of a simulator goes: the status `loop` of its topic `/sim/info`, which is
 * subscribed to only while a panel shows it.
 */
import type { Channel, FoxgloveClient, MessageData } from "@foxglove/ws-protocol";
import { CdrReader } from "../data/cdr.ts";

const TOPIC = "/sim/info";
const STATUS = "loop";
/** Wall time that shares are of, seconds. */
const WINDOW_S = 2;
/** Least bytes of a status, and of a pair of key and value. */
const STATUS_BYTES = 17;
const PAIR_BYTES = 10;

/** A phase of the loop, and its share of the wall time. */
export interface PhaseShare {
  readonly name: string;
  readonly share: number;
}

/** Seconds of wall time by phase. */
type Times = ReadonlyMap<string, number>;

/** The times of the phases in a `diagnostic_msgs/DiagnosticArray`; null if it has none. */
export function readTimes(bytes: Uint8Array): Times | null {
  const reader = new CdrReader(bytes);
  // The stamp and the frame.
  reader.skip(2, 4);
  reader.string();
  for (let left = reader.count(STATUS_BYTES); left > 0; left--) {
    reader.u8();
    const name = reader.string();
    // The message and the hardware.
    reader.string();
    reader.string();
    const pairs: [string, number][] = [];
    for (let more = reader.count(PAIR_BYTES); more > 0; more--) {
      const key = reader.string();
      pairs.push([key, Number(reader.string())]);
    }
    if (name !== STATUS) continue;
    return pairs.every(([, seconds]) => Number.isFinite(seconds)) ? new Map(pairs) : null;
  }
  return null;
}

/** Shares of the last seconds of wall time, from messages with times since some moment. */
export class LoopShares {
  #past: { readonly wholeS: number; readonly times: Times }[] = [];

  add(times: Times): void {
    const wholeS = [...times.values()].reduce((sum, seconds) => sum + seconds, 0);
    const last = this.#past.at(-1);
    // The clock of the phases was restarted.
    if (last && wholeS < last.wholeS) this.#past = [];
    this.#past.push({ wholeS, times });
    while (this.#past.length > 2 && this.#past[1]!.wholeS <= wholeS - WINDOW_S) this.#past.shift();
  }

  /** In the order of the loop; empty before the second message. */
  get shares(): PhaseShare[] {
    const [first, last] = [this.#past[0], this.#past.at(-1)];
    if (!first || !last || last.wholeS === first.wholeS) return [];
    const share = ([name, seconds]: [string, number]): PhaseShare => ({
      name,
      share: (seconds - (first.times.get(name) ?? 0)) / (last.wholeS - first.wholeS),
    });
    return [...last.times].map(share);
  }
}

/** The subscription of a connection to the times of the loop. */
export class LoopSubscription {
  readonly #changed: () => void;
  #client: FoxgloveClient | null = null;
  #channel: number | null = null;
  #subscription: number | null = null;
  #isEnabled = false;
  #shares = new LoopShares();

  /** `changed` is called when there are other shares. */
  constructor(changed: () => void) {
    this.#changed = changed;
  }

  get shares(): PhaseShare[] {
    return this.#shares.shares;
  }

  /** Subscribes, or ends the subscription. */
  setEnabled(isEnabled: boolean): void {
    this.#isEnabled = isEnabled;
    this.#update();
  }

  connect(client: FoxgloveClient): void {
    this.disconnect();
    this.#client = client;
  }

  disconnect(): void {
    this.#client = null;
    this.#channel = null;
    this.#forget();
  }

  onAdvertise(channels: readonly Channel[]): void {
    const channel = channels.find(({ topic }) => topic === TOPIC);
    if (!channel) return;
    this.#end();
    this.#channel = channel.id;
    this.#update();
  }

  onUnadvertise(channels: readonly number[]): void {
    if (this.#channel === null || !channels.includes(this.#channel)) return;
    this.#channel = null;
    this.#forget();
  }

  onMessage({ subscriptionId, data }: MessageData): void {
    if (subscriptionId !== this.#subscription) return;
    let times: Times | null;
    try {
      times = readTimes(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    } catch {
      // A message of another type, or a damaged one.
      return;
    }
    if (!times) return;
    this.#shares.add(times);
    this.#changed();
  }

  #update(): void {
    if (!this.#client || this.#channel === null) return;
    if (!this.#isEnabled) this.#end();
    else this.#subscription ??= this.#client.subscribe(this.#channel);
  }

  #end(): void {
    if (this.#subscription === null) return;
    this.#client?.unsubscribe(this.#subscription);
    this.#forget();
  }

  #forget(): void {
    this.#subscription = null;
    this.#shares = new LoopShares();
  }
}
