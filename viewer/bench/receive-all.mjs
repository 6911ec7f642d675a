/**
 * Subscribes to all channels of a run that is shown, until it ends:
 *
 *     node --experimental-websocket viewer/bench/receive-all.mjs ws://HOST:PORT/?token=TOKEN
 *
 * Prints how many messages came.
 */
/* global WebSocket -- of Node.js, by the flag */
import process from "node:process";
import protocol from "@foxglove/ws-protocol";

const [address] = process.argv.slice(2);
const socket = new WebSocket(address, [protocol.FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]);
const client = new protocol.FoxgloveClient({ ws: socket });
let count = 0;
client.on("advertise", (channels) => channels.forEach(({ id }) => client.subscribe(id)));
client.on("message", () => {
  count += 1;
});
client.on("error", (error) => {
  process.stderr.write(`${error}\n`);
  process.exitCode = 1;
});
client.on("close", () => process.stdout.write(`${count} messages received\n`));
