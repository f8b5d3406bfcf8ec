// The page's wire against the conversations recorded between VRPN's own client and server.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { bundled, sourceDir } from "../bundled.mjs";

const wire = await bundled("wire/index.ts");
const testdata = (name) => new Uint8Array(readFileSync(join(sourceDir, "testdata", "wire", name)));
const hex = (bytes) => Buffer.from(bytes.buffer, bytes.byteOffset, bytes.byteLength).toString("hex");

/** All that one side said, heard in pieces of that size. */
function hear(bytes, piece) {
  const messages = [];
  const endpoint = new wire.Endpoint(
    () => {},
    (m) => messages.push({ ...m, payload: hex(m.payload) }),
  );
  for (let i = 0; i < bytes.length; i += piece) endpoint.feed(bytes.slice(i, i + piece));
  return messages;
}

function recordedCounts(direction) {
  const lines = new TextDecoder().decode(testdata("tcp.index.txt")).split("\n");
  const counts = {};
  for (const line of lines) {
    const [, way, name, count] = /^(\S+)\s+(.*\S)\s+x(\d+)$/.exec(line) ?? [];
    if (way === direction && !name.endsWith("_DESCRIPTION")) counts[name] = Number(count);
  }
  return counts;
}

for (const direction of ["c2s", "s2c"]) {
  test(`every message of the recording is heard, in whatever pieces: ${direction}`, () => {
    const bytes = testdata(`tcp.${direction}.tcp.bin`);
    const whole = hear(bytes, bytes.length);
    const counts = {};
    for (const { name } of whole) counts[name] = (counts[name] ?? 0) + 1;
    assert.deepEqual(counts, recordedCounts(direction));
    for (const piece of [1, 7, 1000]) assert.deepEqual(hear(bytes, piece), whole);
    assert.ok(whole.every((m) => m.device === "Phantom"));
  });
}

/** What the recorded client sent under this name. */
const sent = (name) =>
  hear(testdata("tcp.c2s.tcp.bin"), 1 << 20)
    .filter((m) => m.name === `vrpn_ForceDevice ${name}`)
    .map((m) => Buffer.from(m.payload, "hex"));
// Names of 20 bytes are followed by whatever lay behind them.
const text20 = (b, at) => b.toString("latin1", at, at + 20).replace(/\0.*$/s, "");
const zeroTail = (b, at) =>
  Buffer.concat([
    b.subarray(0, at),
    Buffer.from(text20(b, at).padEnd(20, "\0"), "latin1"),
    b.subarray(at + 20),
  ]);
const doubles = (b, at, n) => Array.from({ length: n }, (_, i) => b.readDoubleBE(at + 8 * i));

const REENCODED = {
  setObjectNumber: (b) => wire.setObjectNumber(b.readInt32BE(0)),
  clearTrimesh: (b) => wire.clearTrimesh(b.readInt32BE(0)),
  startEffect: (b) => wire.startEffect(b.readInt32BE(0)),
  stopEffect: (b) => wire.stopEffect(b.readInt32BE(0)),
  setObjectIsTouchable: (b) => wire.setObjectIsTouchable(b.readInt32BE(0), b.readInt16BE(4) !== 0),
  setTransformMatrix: (b) => wire.setTransformMatrix(b.readInt32BE(0), doubles(b, 4, 16)),
  setHapticProperty: (b) => wire.setHapticProperty(b.readInt32BE(0), text20(b, 4), b.readFloatBE(24)),
  Effect: (b) => {
    const [gain, magnitude_N, duration_ms, frequency] = doubles(b, 24, 4);
    const place = { position: doubles(b, 56, 3), direction: doubles(b, 80, 3) };
    return wire.setEffect({
      type: text20(b, 0),
      index: b.readInt32BE(20),
      gain,
      magnitude_N,
      duration_ms,
      frequency,
      ...place,
    });
  },
};
const NAME_AT = { setHapticProperty: 4, Effect: 0 };

for (const [name, encode] of Object.entries(REENCODED)) {
  test(`${name} is written as VRPN writes it`, () => {
    const recorded = sent(name);
    assert.ok(recorded.length > 0);
    for (const bytes of recorded) {
      const ours = encode(bytes);
      assert.equal(ours.name, `vrpn_ForceDevice ${name}`);
      assert.equal(hex(ours.payload), hex(name in NAME_AT ? zeroTail(bytes, NAME_AT[name]) : bytes));
    }
  });
}

test("cookie, descriptions and frames are those of VRPN", () => {
  const recorded = testdata("tcp.c2s.tcp.bin");
  const written = [];
  const endpoint = new wire.Endpoint(
    (bytes) => written.push(hex(bytes)),
    () => {},
    () => 1789.25,
  );
  endpoint.open();
  assert.equal(written[0], hex(recorded.slice(0, 24)).replace("30372e3334", "30372e3338")); // 07.34, 07.38
  endpoint.send("Phantom", wire.startEffect(3));
  endpoint.send("Phantom", wire.startEffect(4));
  const header = "000006fd0003d090"; // 1789.25 s
  assert.deepEqual(written.slice(1), [
    `00000024${header}00000000ffffffff00000000` + "00000008" + "5068616e746f6d00" + "00000000",
    `00000039${header}00000000fffffffe00000001` +
      "0000001d" +
      Buffer.from("vrpn_ForceDevice startEffect\0").toString("hex") +
      "00".repeat(7),
    `0000001c${header}000000000000000000000002` + "00000003" + "00000000",
    `0000001c${header}000000000000000000000003` + "00000004" + "00000000",
  ]);
});

test("a peer that is no VRPN, and a length that cannot be, are errors that name it", () => {
  const endpoint = () =>
    new wire.Endpoint(
      () => {},
      () => {},
    );
  assert.throws(
    () => endpoint().feed(new TextEncoder().encode("HTTP/1.1 400 Bad Request")),
    /opened with "HTTP/,
  );
  const started = endpoint();
  started.feed(testdata("tcp.s2c.tcp.bin").slice(0, 24));
  assert.throws(() => started.feed(new Uint8Array([0, 0, 0, 3, 0, 0, 0, 0])), /3 bytes/);
});

// The layouts of docs/wire-messages.md, by hand.
class Bytes {
  parts = [];
  add(size, method, ...values) {
    for (const value of values) {
      const part = Buffer.alloc(size);
      part[method](value, 0);
      this.parts.push(part);
    }
    return this;
  }
  i16 = (...v) => this.add(2, "writeInt16BE", ...v);
  i32 = (...v) => this.add(4, "writeInt32BE", ...v);
  u32 = (...v) => this.add(4, "writeUInt32BE", ...v);
  f32 = (...v) => this.add(4, "writeFloatBE", ...v);
  f64 = (...v) => this.add(8, "writeDoubleBE", ...v);
  i64 = (...v) => this.add(8, "writeBigInt64BE", ...v.map(BigInt));
  get buffer() {
    return Buffer.concat(this.parts);
  }
  get view() {
    const b = Uint8Array.from(this.buffer);
    return new DataView(b.buffer);
  }
}

test("Tick is read field by field", () => {
  const bytes = new Bytes()
    .i64(2 ** 40 + 7, -5, 9)
    .f64(1, 2, 3, 4, 5, 6, 7, 8, 9)
    .f64(0.1, 0.2, 0.3, 0.4)
    .f64(-1, -2, -3)
    .f64(0.004)
    .i32(-1)
    .u32(3, 1 << 13, 2 ** 31);
  assert.equal(bytes.buffer.length, 176);
  assert.deepEqual(wire.decodeTick(bytes.view), {
    tick: 2 ** 40 + 7,
    time_ns: -5,
    revision: 9,
    hand: [1, 2, 3],
    proxy: [4, 5, 6],
    velocity: [7, 8, 9],
    orientation: [0.1, 0.2, 0.3, 0.4],
    force_N: [-1, -2, -3],
    depth: 0.004,
    object: -1,
    buttons: 3,
    guardActive: 1 << 13,
    guardLatched: 2 ** 31,
  });
});

test("Contacts, Guard_State and texts are read", () => {
  const contacts = new Bytes()
    .i64(1, 2)
    .i32(20)
    .f64(4, 1, 2, 3, 0, 1, 0, 0, 0.5, 0)
    .f64(-1, 0, 0, 0, 0, 0, 1, 0, 0, 2);
  assert.deepEqual(wire.decodeContacts(contacts.view), [
    { object: 4, point: [1, 2, 3], normal: [0, 1, 0], force_N: [0, 0.5, 0] },
    { object: -1, point: [0, 0, 0], normal: [0, 0, 1], force_N: [0, 0, 2] },
  ]);
  assert.deepEqual(wire.decodeGuardState(new Bytes().u32(1, 2).i16(1, 0).view), {
    active: 1,
    latched: 2,
    armed: true,
    stopped: false,
  });
  const texts = hear(testdata("tcp.s2c.tcp.bin"), 1 << 20).filter((m) => m.name === wire.TEXT);
  const decoded = texts.map((m) =>
    wire.decodeText(new DataView(Uint8Array.from(Buffer.from(m.payload, "hex")).buffer)),
  );
  assert.ok(decoded.length > 0);
  for (const { severity, text } of decoded) assert.ok(severity <= 2 && /^[ -~]+$/.test(text), text);
  const refusal = new DataView(new ArrayBuffer(8 + 1024));
  refusal.setUint32(0, 2);
  refusal.setUint32(4, 3);
  "no".split("").forEach((c, i) => refusal.setUint8(8 + i, c.charCodeAt(0)));
  assert.deepEqual(wire.decodeText(refusal), { severity: 2, level: 3, text: "no" });
});

test("hand, subscription and meshes are written to the byte", () => {
  const expected = [
    [wire.holdHand(true, [1, -2, 3], [0, 0, 0, 1]), new Bytes().i16(1).f64(1, -2, 3).f64(0, 0, 0, 1).u32(0)],
    [wire.subscribe(wire.REPORT_TICK | wire.REPORT_CONTACTS, 125), new Bytes().u32(48).f64(125)],
    [wire.meshVertices(2, 5000, Float32Array.of(1, 2, 3)), new Bytes().i32(2, 5000, 3).f32(1, 2, 3)],
    [
      wire.meshTriangles(2, 10, Uint32Array.of(0, 1, 2, 2, 1, 3)),
      new Bytes().i32(2, 10, 6).i32(0, 1, 2, 2, 1, 3),
    ],
  ];
  for (const [ours, bytes] of expected) assert.equal(hex(ours.payload), bytes.buffer.toString("hex"));
});

// testdata/wire/vectors.json: every message several times, also encoded and decoded by the C++ tests.
const vectors = JSON.parse(new TextDecoder().decode(testdata("vectors.json")));
const byStruct = Object.fromEntries(
  vectors.map(({ struct }) => [struct, wire.messages[struct]]),
);
const camelCase = (name) => name.replace(/_(\w)/g, (_, letter) => letter.toUpperCase());
/** Fields as TypeScript has them; 64-bit integers are text in the file and numbers here. */
const fieldsOf = ({ struct, fields }) => {
  const isText = { Text: ["text"], SetHapticProperty: ["property"], Effect: ["type"], Identify: ["token"], SetObjectName: ["text"],
    Marker: ["text"], RecordingControl: ["name"] }[struct] ?? [];
  return Object.fromEntries(
    Object.entries(fields).map(([name, value]) => [
      camelCase(name),
      typeof value === "string" && !isText.includes(name) ? Number(BigInt(value)) : value,
    ]),
  );
};
const isExact = (fields) =>
  Object.values(fields).every((v) => !Number.isInteger(v) || Number.isSafeInteger(v));
const viewOf = (text) => {
  const bytes = Uint8Array.from(Buffer.from(text, "hex"));
  return new DataView(bytes.buffer);
};

test("of names and marks that are too long, the beginning is sent, in whole characters", () => {
  const { SetObjectName, Marker } = wire.messages;
  const view = ({ payload }) => new DataView(payload.buffer);
  const nameOf = (text) => SetObjectName.decode(view(wire.setObjectName(3, text))).text;
  assert.equal(nameOf("x".repeat(64)), "x".repeat(64));
  assert.equal(nameOf(`${"x".repeat(80)}.stl`), "x".repeat(64));
  assert.equal(nameOf(`x${"ä".repeat(40)}`), `x${"ä".repeat(31)}`);
  assert.equal(nameOf("🦾".repeat(40)), "🦾".repeat(16));
  assert.equal(Marker.decode(view(wire.mark("ö".repeat(200)))).text, "ö".repeat(127));
});

test("every message of the table has vectors, and the same name on the wire", () => {
  assert.deepEqual(
    new Set(vectors.map((v) => v.name)),
    new Set(wire.messages.ALL_MESSAGES.map((m) => m.name)),
  );
  for (const { struct, name } of vectors) assert.equal(byStruct[struct].name, name);
});

test("the vectors are decoded field by field", () => {
  for (const vector of vectors)
    assert.deepEqual(byStruct[vector.struct].decode(viewOf(vector.payload)), fieldsOf(vector), vector.name);
});

test("the vectors are encoded to the byte", () => {
  let inexact = 0;
  for (const vector of vectors) {
    const fields = fieldsOf(vector);
    // Only reports and streamed values have 64-bit integers beyond 2^53, and the page never sends them.
    const exact = isExact(fields) || !["TickReport", "ContactList", "HandState", "RemoteContacts", "HeldForce", "Identify", "Poses", "Marker"].includes(vector.struct);
    if (!exact) {
      ++inexact;
      continue;
    }
    const { name, payload } = byStruct[vector.struct].encode(fields);
    assert.equal(name, vector.name);
    assert.equal(hex(payload), vector.payload, vector.name);
    const { seconds, microseconds, sender, type, sequence } = vector.header;
    // The page's clock is a double in seconds, which does not hold every microsecond of the far future.
    if (microseconds % 250000 !== 0) continue;
    const frame = wire.encodeFrame(seconds + microseconds / 1e6, sender, type, sequence, payload);
    assert.equal(hex(frame), vector.frame, vector.name);
  }
  assert.equal(inexact, 13);
});

test("the frames of the vectors are read from one stream", () => {
  const stream = new wire.FrameStream();
  stream.push(Uint8Array.from(Buffer.from(vectors.map((v) => v.frame).join(""), "hex")));
  for (const { payload, header, name } of vectors) {
    const frame = stream.next();
    assert.equal(hex(frame.payload), payload, name);
    assert.equal(frame.sender, header.sender);
    assert.equal(frame.type, header.type);
    assert.ok(Math.abs(frame.time_s - header.seconds - header.microseconds / 1e6) < 1e-6);
  }
  assert.equal(stream.next(), undefined);
});

test("payloads and lists of a wrong length are errors that name the message", () => {
  const { SetVertex, ButtonStates, AnalogChannels, SetHapticProperty, Effect } = wire.messages;
  assert.throws(
    () => SetVertex.decode(viewOf("00".repeat(19))),
    /setVertex: payload of 19 bytes, expected 20/,
  );
  assert.throws(
    () => ButtonStates.decode(viewOf("00".repeat(3))),
    /States: payload of 3 bytes, expected at least 4/,
  );
  assert.throws(() => ButtonStates.decode(viewOf("ffffffff")), /states counts -1 values, room for 0/);
  assert.throws(() => ButtonStates.decode(viewOf("0000000200000001")), /counts 2 values, room for 1/);
  assert.throws(
    () => AnalogChannels.decode(viewOf("4004000000000000" + "00".repeat(24))),
    /counts 2.5 values/,
  );
  assert.deepEqual(
    ButtonStates.decode(viewOf("0000000100000005ffff")).states,
    [5],
    "bytes behind a list are ignored",
  );
  assert.throws(() => ButtonStates.encode({ states: new Array(257).fill(0) }), /257 values, at most 256/);
  assert.throws(
    () => SetVertex.encode({ object: 0, vertex: 0, position: [1, 2] }),
    /position has 2 values, expected 3/,
  );
  assert.throws(
    () => SetHapticProperty.encode({ object: 0, property: "x".repeat(21), value: 0 }),
    /longer than 20 bytes/,
  );
  assert.equal(Effect.decode(viewOf("61".repeat(20) + "00".repeat(84))).type, "a".repeat(20));
});
