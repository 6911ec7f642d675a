import { CdrWriter } from "@foxglove/cdr";
import type { FoxgloveClient } from "@foxglove/ws-protocol";
import { describe, expect, it } from "vitest";
import { LoopShares, LoopSubscription, readTimes } from "./loop-times.ts";

/** A `diagnostic_msgs/DiagnosticArray` with these statuses: name, and pairs of key and value. */
function message(statuses: Record<string, Record<string, string>>): Uint8Array {
  const writer = new CdrWriter();
  writer.int32(7).uint32(0).string("map");
  writer.uint32(Object.keys(statuses).length);
  for (const [name, values] of Object.entries(statuses)) {
    writer.uint8(0).string(name).string("some text").string("");
    writer.uint32(Object.keys(values).length);
    for (const [key, value] of Object.entries(values)) writer.string(key).string(value);
  }
  return writer.data;
}

const times = (scan: number, agents: number) =>
  new Map([
    ["scan", scan],
    ["agents", agents],
  ]);

describe("times of the loop", () => {
  it("are read from the status of the loop", () => {
    const bytes = message({ run: { tick: "50" }, loop: { scan: "1.500", agents: "0.250" } });
    expect([...readTimes(bytes)!]).toEqual([
      ["scan", 1.5],
      ["agents", 0.25],
    ]);
    expect(readTimes(message({ agent_70: { task: "idle" } }))).toBeNull();
    expect(() => readTimes(bytes.slice(0, 40))).toThrow(RangeError);
  });

  it("are shares of the last seconds", () => {
    const shares = new LoopShares();
    shares.add(times(1, 1));
    expect(shares.shares).toEqual([]);
    shares.add(times(2, 4));
    expect(shares.shares).toEqual([
      { name: "scan", share: 0.25 },
      { name: "agents", share: 0.75 },
    ]);
    // The first message is older than the window, the second one just as old.
    shares.add(times(4, 4));
    expect(shares.shares.map(({ share }) => share)).toEqual([1, 0]);
    // The clock was restarted.
    shares.add(times(0.1, 0));
    expect(shares.shares).toEqual([]);
    shares.add(times(0.1, 0.4));
    expect(shares.shares.map(({ share }) => share)).toEqual([0, 1]);
  });
});

describe("the subscription", () => {
  it("lasts while the times are wanted, over channels that come and go", () => {
    const calls: string[] = [];
    const client = {
      subscribe: (channel: number) => (calls.push(`+${channel}`), 100 + channel),
      unsubscribe: (subscription: number) => calls.push(`-${subscription}`),
    } as unknown as FoxgloveClient;
    let changes = 0;
    const subscription = new LoopSubscription(() => changes++);
    subscription.setEnabled(true);
    subscription.connect(client);
    const channel = (id: number, topic: string) => [
      { id, topic, encoding: "cdr", schemaName: "", schema: "" },
    ];
    subscription.onAdvertise(channel(3, "/tf"));
    expect(calls).toEqual([]);
    subscription.onAdvertise(channel(5, "/sim/info"));
    subscription.setEnabled(true);
    expect(calls).toEqual(["+5"]);
    const give = (subscriptionId: number, values: Record<string, string>) => {
      const { buffer, byteOffset, byteLength } = message({ loop: values });
      const data = new DataView(buffer, byteOffset, byteLength);
      subscription.onMessage({ op: 1, subscriptionId, timestamp: 0n, data });
    };
    give(103, { scan: "9" });
    expect(changes).toBe(0);
    give(105, { scan: "1" });
    give(105, { scan: "2" });
    give(105, { scan: "much" });
    expect([changes, subscription.shares]).toEqual([2, [{ name: "scan", share: 1 }]]);
    // The next run has other channels.
    subscription.onUnadvertise([5]);
    subscription.onAdvertise(channel(8, "/sim/info"));
    subscription.setEnabled(false);
    subscription.setEnabled(true);
    expect(calls).toEqual(["+5", "+8", "-108", "+8"]);
    expect(subscription.shares).toEqual([]);
  });
});
