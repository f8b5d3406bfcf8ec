// Reads a file by the reader of MCAP's own authors: index, checksums and messages, against the same session as CSV.
//   node read_mcap.mjs FILE.mcap FILE.csv
import { readFile, open } from "node:fs/promises";
import { McapIndexedReader, McapStreamReader } from "@mcap/core";

const [, , mcapFile, csvFile] = process.argv;
const fail = (text) => {
  console.error(text);
  process.exit(1);
};

class FileReadable {
  constructor(handle, size) {
    this.handle = handle;
    this.bytes = BigInt(size);
  }
  async size() {
    return this.bytes;
  }
  async read(offset, length) {
    const buffer = new Uint8Array(Number(length));
    await this.handle.read(buffer, 0, buffer.byteLength, Number(offset));
    return buffer;
  }
}

const handle = await open(mcapFile);
const reader = await McapIndexedReader.Initialize({
  readable: new FileReadable(handle, (await handle.stat()).size),
});
const topics = new Map([...reader.channelsById.values()].map((c) => [c.id, c.topic]));
const schemas = new Map([...reader.schemasById.values()].map((s) => [s.name, JSON.parse(new TextDecoder().decode(s.data))]));

const counts = new Map();
const ticks = [];
const markers = [];
let last = 0n;
for await (const message of reader.readMessages()) {
  const topic = topics.get(message.channelId);
  counts.set(topic, (counts.get(topic) ?? 0) + 1);
  const value = JSON.parse(new TextDecoder().decode(message.data));
  if (message.logTime < last) fail(`time goes back at ${topic}`);
  last = message.logTime;
  if (topic.endsWith("/tick")) ticks.push(value);
  if (topic === "/markers") markers.push(value);
  if (topic.endsWith("/hip") && value.pose.position.x === undefined) fail("a pose without a position");
}
await handle.close();

// The statistics are those of the messages.
for (const [id, count] of reader.statistics.channelMessageCounts) {
  if (BigInt(counts.get(topics.get(id)) ?? 0) !== count) fail(`${topics.get(id)}: ${count} in the statistics`);
}
// The properties of the schema are those of the messages; the simulated hand has no gripper.
const properties = Object.keys(schemas.get("hapticd.Tick").properties).filter((name) => name !== "gripper_rad");
const complete = ticks.find((tick) => tick.touching); // a free one has no contact point
if (JSON.stringify(properties) !== JSON.stringify(Object.keys(complete))) fail(`schema ${properties}`);
if (!schemas.has("foxglove.PoseInFrame")) fail("no poses");
if (!(counts.get("/scene/commands") > 0)) fail("no scene commands");
if (JSON.stringify(markers.map((m) => m.message)) !== '["trial \\"3\\" begins"]') fail(`markers ${JSON.stringify(markers)}`);
const stated = Object.keys(schemas.get("foxglove.Log").properties);
if (JSON.stringify(stated) !== JSON.stringify(Object.keys(markers[0]))) fail(`schema of a log: ${stated}`);

// The same numbers as in the CSV, tick by tick.
const [header, ...rows] = (await readFile(csvFile, "utf8")).trim().split("\n").map((line) => line.split(","));
if (rows.length !== ticks.length) fail(`${ticks.length} ticks, ${rows.length} rows of CSV`);
const column = (name) => header.indexOf(name);
rows.forEach((row, i) => {
  const tick = ticks[i];
  const same =
    Number(row[column("tick")]) === tick.tick &&
    Number(row[column("depth_m")]) === tick.depth_m &&
    ["x", "y", "z"].every((axis, k) => Number(row[column(`force_${axis}_N`)]) === tick.force_N[k]);
  if (!same) fail(`tick ${tick.tick}: ${row} is not ${JSON.stringify(tick)}`);
});

// What has no use for an index reads the same; this one checks the checksums of the chunks.
const stream = new McapStreamReader({ validateCrcs: true });
stream.append(new Uint8Array(await readFile(mcapFile)));
let streamed = 0;
for (let record; (record = stream.nextRecord()); ) streamed += record.type === "Message" ? 1 : 0;
if (!stream.done()) fail("the file has no end");
const all = [...counts.values()].reduce((a, b) => a + b, 0);
if (streamed !== all) fail(`${streamed} messages in the stream, ${all} by the index`);
console.log(`${all} messages in ${counts.size} channels, ${ticks.length} ticks as in the CSV`);
