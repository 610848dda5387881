// A client on node-opcua: events and changes of the state as they come, a JSON line each; at the end of standard input the results,
// the gap, and what is refused.
//
//   NODE_PATH=target/npm/node_modules node client.cjs URL CELL
"use strict";
const {
  AttributeIds, ContentFilter, DataType, OPCUAClient, TimestampsToReturn, Variant, VariantArrayType,
  constructEventFilter, ofType,
} = require("node-opcua-client");

const [url, name] = process.argv.slice(2);
const say = (kind, value) => process.stdout.write(JSON.stringify({ kind, value }) + "\n");

/** Structures as plain objects: what is absent is left out. */
function plain(value) {
  if (value === null || typeof value !== "object" || value instanceof Date) return value;
  if (value instanceof Variant) return plain(value.value);
  if (Array.isArray(value) || ArrayBuffer.isView(value)) return Array.from(value, plain);
  if (value.constructor.name === "LocalizedText") return value.text;
  if (value.schema) {
    const fields = { type: value.constructor.name };
    for (let schema = value.schema; schema && schema.fields; schema = schema._baseSchema) {
      for (const field of schema.fields) if (value[field.name] !== undefined) fields[field.name] = plain(value[field.name]);
    }
    return fields;
  }
  return value.toString();
}

async function main() {
  const client = OPCUAClient.create({ endpointMustExist: false, connectionStrategy: { maxRetry: 1 } }); // its keys are in XDG_CONFIG_HOME
  await client.connect(url);
  const session = await client.createSession();
  const namespaces = await session.readNamespaceArray();
  const result = namespaces.indexOf("http://opcfoundation.org/UA/Machinery/Result/");
  const cell = namespaces.indexOf(`urn:probecell:cell:${name}`);
  const node = (path) => `ns=${cell};s=${path}`;
  const int32 = (value) => new Variant({ dataType: DataType.Int32, value });
  const call = (method, inputArguments) =>
    session.call({ objectId: node("ResultManagement"), methodId: node(method), inputArguments });
  const read = async (path) => plain((await session.read({ nodeId: node(path), attributeId: AttributeIds.Value })).value);

  const subscription = await session.createSubscription2({
    requestedPublishingInterval: 100, requestedLifetimeCount: 10000, requestedMaxKeepAliveCount: 50, publishingEnabled: true,
  });
  const monitor = (item, options) => subscription.monitor(item, options, TimestampsToReturn.Both);
  const filter = constructEventFilter(
    ["EventType", "Message", `${result}:Result`, [`${result}:Result`, `${result}:ResultMetaData`]], ofType(`ns=${result};i=1002`),
  );
  const events = await monitor(
    { nodeId: "i=2253", attributeId: AttributeIds.EventNotifier }, { samplingInterval: 0, queueSize: 100, discardOldest: false, filter },
  );
  events.on("changed", (fields) => {
    const [type, message, whole, meta] = fields.map(plain);
    say("event", { eventType: type, message, whole, meta });
  });
  const state = await monitor(
    { nodeId: node("MachineryItemState/CurrentState"), attributeId: AttributeIds.Value },
    { samplingInterval: 0, queueSize: 100, discardOldest: false },
  );
  state.on("changed", (value) => say("state", plain(value.value)));

  const early = await call("GetLatestResult", [int32(0)]);
  say("ready", { namespaces, early: early.outputArguments.map(plain) });
  await new Promise((resolve) => process.stdin.on("end", resolve).resume());

  const list = await call("GetResultIdListFiltered", [
    new Variant({ dataType: DataType.ExtensionObject, value: new ContentFilter({}) }),
    new Variant({ dataType: DataType.ExtensionObject, arrayType: VariantArrayType.Array, value: [] }),
    new Variant({ dataType: DataType.UInt32, value: 0 }), int32(0),
  ]);
  const ids = list.outputArguments[1].value;
  const results = {};
  for (const id of ids) {
    const one = await call("GetResultById", [new Variant({ dataType: DataType.String, value: id }), int32(0)]);
    results[id] = one.outputArguments.map(plain);
  }
  const latest = (await call("GetLatestResult", [int32(0)])).outputArguments.map(plain);
  const nobody = await call("GetResultById", [new Variant({ dataType: DataType.String, value: "nobody" }), int32(0)]);
  const unknown = nobody.outputArguments.map(plain);
  const gap = {};
  for (const member of ["PlanIdentifier", "Verdict", "Rms", "NoiseFloor", "Cause", "Probability", "Rivals", "Causes"]) {
    gap[member] = await read(`Gap/${member}`);
  }
  const machines = await session.browse(`ns=${namespaces.indexOf("http://opcfoundation.org/UA/Machinery/")};i=1001`);
  const written = await session.write({
    nodeId: node("Gap/Probability"), attributeId: AttributeIds.Value, value: { value: { dataType: DataType.Double, value: 1 } },
  });
  const foreign = await session.call({ objectId: node("ResultManagement"), methodId: node("Machine"), inputArguments: [] });
  say("end", {
    ids, results, latest, unknown, gap, machines: machines.references.map((one) => one.browseName.name),
    written: written.name, foreign: foreign.statusCode.name,
  });
  await session.close();
  await client.disconnect();
}

main().then(() => process.exit(0), (error) => { console.error(error); process.exit(1); });
