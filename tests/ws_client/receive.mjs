/**
 * Receives all topics of a run with the client library of Foxglove, for tests/clients.rs:
 *
 *     node receive.mjs ws://HOST:PORT/?token=TOKEN SUBPROTOCOL CHANNELS
 *
 * Prints `ready` once it has subscribed to so many channels. At the result of the run it prints a
 * line for each message, `TOPIC LOG_TIME STAMP DATA`: nanoseconds, the stamp of the decoded header
 * or `-`, and the bytes in hexadecimal digits.
 */
import process from "node:process";
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import protocol from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [address, subprotocol, channels] = process.argv.slice(2);
const client = new protocol.FoxgloveClient({ ws: new WebSocket(address, [subprotocol]) });
const subscribed = new Map();
const lines = [];

function stamp(message) {
  const header = message.header ?? message.transforms?.[0]?.header ?? message.markers?.[0]?.header;
  return header === undefined ? "-" : BigInt(header.stamp.sec) * 1_000_000_000n + BigInt(header.stamp.nanosec);
}

client.on("advertise", (advertised) => {
  for (const { id, topic, schema, encoding } of advertised) {
    const reader = encoding === "cdr" ? new MessageReader(parse(schema, { ros2: true })) : undefined;
    subscribed.set(client.subscribe(id), { topic, reader });
  }
  if (subscribed.size >= Number(channels)) {
    process.stdout.write("ready\n");
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, reader } = subscribed.get(subscriptionId);
  const bytes = Buffer.from(data.buffer, data.byteOffset, data.byteLength);
  const decoded = reader?.readMessage(data) ?? {};
  lines.push(`${topic} ${timestamp} ${stamp(decoded)} ${bytes.toString("hex")}\n`);
  if (topic === "/sim/result") {
    process.stdout.write(lines.join(""), () => client.close());
  }
});
client.on("error", (error) => {
  process.stderr.write(`${error}\n`);
  process.exitCode = 1;
});
