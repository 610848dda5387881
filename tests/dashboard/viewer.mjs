// Reads a dashboard as Foxglove and Lichtblick do, with their client: viewer.mjs NODE_MODULES ADDRESS TOPIC...
//
// Subscribes to every topic as it is offered and decodes every message by the schema that came with it. Prints a line of JSON for
// each message of the TOPICs given, and when it is told to end (SIGTERM) one with what it has seen.
import { createHash } from "node:crypto";
import { createRequire } from "node:module";
import { resolve } from "node:path";

const [folder, address, ...wanted] = process.argv.slice(2);
const load = createRequire(resolve(folder, "any.js"));
const { FoxgloveClient } = load("@foxglove/ws-protocol");
const { parse } = load("@foxglove/rosmsg");
const { MessageReader } = load("@foxglove/rosmsg2-serialization");
const { WebSocket } = load("ws");

const say = (line) => process.stdout.write(JSON.stringify(line) + "\n");
const seen = { serverInfo: null, statuses: [], counts: {}, schemas: {}, undecoded: [], gone: 0, errors: [] };
const channels = new Map();
const subscriptions = new Map();

const client = new FoxgloveClient({ ws: new WebSocket(address, [FoxgloveClient.SUPPORTED_SUBPROTOCOL, "foxglove.sdk.v1"]) });
client.on("error", (error) => seen.errors.push(String(error)));
client.on("status", (status) => seen.statuses.push(status));
client.on("serverInfo", (info) => {
  seen.serverInfo = info;
  // What a viewer publishes must not reach a cell.
  client.advertise({ topic: "/planted", encoding: "json", schemaName: "std_msgs/msg/String" });
});
client.on("advertise", (offered) => {
  for (const channel of offered) {
    if (channel.encoding !== "cdr" || channel.schemaEncoding !== "ros2msg") seen.errors.push(`encoding of ${channel.topic}`);
    channels.set(channel.id, { topic: channel.topic, reader: new MessageReader(parse(channel.schema, { ros2: true })) });
    seen.schemas[channel.topic] = channel.schemaName;
    subscriptions.set(client.subscribe(channel.id), channel.id);
    say({ offered: channel.topic });
  }
});
client.on("unadvertise", (ids) => {
  seen.gone += ids.length;
  for (const id of ids) {
    say({ gone: channels.get(id).topic });
    channels.delete(id);
  }
});
client.on("message", ({ subscriptionId, timestamp, data }) => {
  const { topic, reader } = channels.get(subscriptions.get(subscriptionId));
  seen.counts[topic] = (seen.counts[topic] ?? 0) + 1;
  try {
    reader.readMessage(data);
  } catch (error) {
    if (seen.undecoded.length < 10) seen.undecoded.push(`${topic}: ${error}`);
  }
  if (!wanted.includes(topic)) return;
  const bytes = new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  say({ topic, at: String(timestamp), hash: createHash("sha256").update(bytes).digest("hex") });
});
const end = () => process.stdout.write(JSON.stringify({ end: seen }) + "\n", () => process.exit(0));
client.on("close", end);
process.on("SIGTERM", end);
