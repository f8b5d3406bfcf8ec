// The connection of the page and what is sent over it, on sockets of the test.
import assert from "node:assert/strict";
import { afterEach, mock, test } from "node:test";
import { bundled } from "../bundled.mjs";

const { Link } = await bundled("link.ts");
const { refusesHand } = await bundled("hand.ts");
const { upload } = await bundled("mesh/upload.ts");
const { credentials } = await bundled("token.ts");
const { Endpoint, stopForces, startEffect } = await bundled("wire/index.ts");

/** A browser's socket, and the server at its other end. */
class Socket {
  static OPEN = 1;
  static all = [];
  readyState = 0;
  bufferedAmount = 0;
  received = [];
  answers = [];

  constructor() {
    Socket.all.push(this);
    this.server = new Endpoint(
      (bytes) => this.answers.push(Uint8Array.from(bytes).buffer),
      ({ device, name }) => this.received.push(`${device} ${name}`),
    );
  }
  send(bytes) {
    assert.notEqual(this.readyState, 0, "a browser throws");
    if (this.readyState === 1) this.server.feed(bytes);
  }
  /** The closing handshake goes on until the server answers. */
  close() {
    this.readyState = 2;
  }

  // The server's.
  accept() {
    this.readyState = 1;
    this.onopen();
    this.server.open();
    this.answer();
  }
  answer(...more) {
    for (const data of this.answers.splice(0).concat(more)) this.onmessage({ data });
  }
  end() {
    this.readyState = 3;
    this.onclose();
  }
}

Object.assign(globalThis, { window: globalThis, addEventListener: () => undefined, location: { protocol: "http:", host: "test" }, WebSocket: Socket });
const timers = [];
const { setTimeout: realTimeout, setInterval: realInterval } = globalThis;
globalThis.setInterval = (...args) => {
  timers.push(realInterval(...args));
  return timers.at(-1);
};
afterEach(() => {
  timers.splice(0).forEach(clearInterval);
  Socket.all = [];
});

const until = async (ask) => {
  while (!ask()) await new Promise((resolve) => realTimeout(resolve, 5));
};

function connected(device = "Arm") {
  const states = [];
  const link = new Link((state) => states.push(state), () => undefined);
  link.connect(device);
  Socket.all[0].accept();
  assert.equal(link.state, "open");
  return { link, states, socket: Socket.all[0] };
}

test("a socket that is closing has not sent a stop", () => {
  const { link, socket } = connected();
  assert.equal(link.send(stopForces()), true);
  assert.equal(socket.received.at(-1), "Arm hapticd Stop_Forces");
  socket.close();
  assert.equal(link.send(stopForces()), false);
});

test("a stop behind an upload goes on a connection of its own, too", (t) => {
  t.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const link = new Link(() => undefined, () => undefined, () => [startEffect(7)]);
  link.connect("Arm");
  const [socket] = Socket.all;
  socket.accept();
  const pong = (of) => {
    of.server.send("Arm", { name: "vrpn_Base pong_message", payload: new Uint8Array(0) });
    of.answer();
  };
  const stops = (of) => of.received.filter((name) => name === "Arm hapticd Stop_Forces").length;
  assert.equal(link.sendAtOnce(stopForces()), true);
  assert.equal(Socket.all.length, 1, "nothing is before it");
  for (let i = 0; i < 2; ++i) link.send({ name: "hapticd Mesh_Vertices", payload: new Uint8Array(60_000) });
  assert.equal(link.sendAtOnce(stopForces()), true);
  assert.equal(link.sendAtOnce(stopForces()), true);
  assert.equal(Socket.all.length, 2, "one connection for a key that repeats");
  link.use("Other");
  assert.equal(link.sendAtOnce(stopForces()), true);
  assert.equal(Socket.all.length, 3, "the stop of another device does not wait for the first one's");
  Socket.all[2].end();
  link.use("Arm");
  const [, beside] = Socket.all;
  beside.accept();
  assert.deepEqual(beside.received, ["Arm vrpn_ForceDevice startEffect", "Arm hapticd Stop_Forces", "Arm vrpn_Base ping_message"]);
  assert.equal(stops(socket), 3);
  pong(beside);
  assert.equal(beside.readyState, 2, "it ends once the stop was read");
  link.sendAtOnce(stopForces());
  assert.equal(Socket.all.length, 4);
  pong(socket); // of the ping before the upload
  t.mock.timers.tick(1000);
  pong(socket);
  t.mock.timers.tick(10_000);
  assert.equal(Socket.all[3].readyState, 2, "nothing answers");
  link.sendAtOnce(stopForces());
  assert.equal(Socket.all.length, 4, "the server has read the upload");
});

test("bytes that are no VRPN end the connection at once, and a new one is made", async () => {
  const warn = mock.method(console, "warn", () => undefined);
  const { link, states, socket } = connected();
  socket.answer(new Uint8Array(64).fill(0xff).buffer);
  assert.equal(warn.mock.callCount(), 1);
  assert.deepEqual(states, ["open", "lost"]);
  assert.equal(link.send(stopForces()), false);
  await until(() => Socket.all.length === 2);
  Socket.all[1].accept();
  assert.equal(link.state, "open");
  socket.end(); // the old one's end, and what it still brings, are of no concern
  socket.answer(new Uint8Array(64).fill(0xff).buffer);
  assert.deepEqual(states, ["open", "lost", "open"]);
  assert.equal(link.send(stopForces()), true);
  assert.equal(Socket.all.length, 2);
});

test("a message that cannot be read does not end the connection that carries the stop", () => {
  const warn = mock.method(console, "warn", () => undefined);
  const read = [];
  const link = new Link(
    () => undefined,
    ({ name }) => {
      if (name === "newer") throw new Error("newer: payload of 9 bytes, expected 8");
      read.push(name);
    },
  );
  link.connect("Arm");
  const [socket] = Socket.all;
  socket.accept();
  for (const name of ["newer", "newer", "known"]) socket.server.send("Arm", { name, payload: new Uint8Array(9) });
  socket.answer();
  assert.deepEqual(read, ["known"]);
  assert.equal(warn.mock.callCount(), 1);
  assert.match(warn.mock.calls[0].arguments[0], /newer: payload of 9 bytes/);
  assert.equal(link.send(stopForces()), true);
  assert.equal(socket.received.at(-1), "Arm hapticd Stop_Forces");
});

test("the server's clock is estimated from a ping and its own answer, however late", (t) => {
  t.mock.timers.enable({ apis: ["setInterval"] });
  let now_ms = 0;
  t.mock.method(performance, "now", () => now_ms);
  const ages = [];
  const link = new Link(() => undefined, (_, age_s) => ages.push(age_s));
  link.connect("Arm");
  const [socket] = Socket.all;
  socket.accept();
  // The server has the clock of the page; every answer takes 1.6 s: 0.8 s there and 0.8 s back.
  const server = new Endpoint((bytes) => socket.answers.push(Uint8Array.from(bytes).buffer), () => undefined, () =>
    performance.timeOrigin / 1000 + now_ms / 1000 - 0.8);
  server.open();
  socket.answers.length = 0; // its cookie
  const asked = [0];
  for (; now_ms < 12_000; now_ms += 100) {
    const before = socket.received.length;
    if (now_ms > 0 && now_ms % 1000 === 0) t.mock.timers.tick(1000);
    if (socket.received.length > before) asked.push(now_ms);
    if (asked[0] + 1600 === now_ms) {
      asked.shift();
      server.send("Arm", { name: "vrpn_Base pong_message", payload: new Uint8Array(0) });
      socket.answer();
    }
  }
  assert.ok(ages.length >= 4, `${ages}`);
  for (const age of ages.slice(1)) assert.ok(Math.abs(age - 0.8) < 0.01, `${ages}`);
});

test("a clock of the server that is set is followed at the next answer, also on a network that has become slower", (t) => {
  t.mock.timers.enable({ apis: ["setInterval"] });
  let now_ms = 0;
  t.mock.method(performance, "now", () => now_ms);
  const ages = [];
  const link = new Link(() => undefined, (_, age_s) => ages.push(age_s));
  link.connect("Arm");
  const [socket] = Socket.all;
  socket.accept();
  let set_s = 0;
  let roundTrip_ms = 2;
  const server = new Endpoint((bytes) => socket.answers.push(Uint8Array.from(bytes).buffer), () => undefined, () =>
    performance.timeOrigin / 1000 + (now_ms - roundTrip_ms / 2) / 1000 + set_s);
  server.open();
  socket.answers.length = 0; // its cookie
  const answer = () => {
    now_ms += roundTrip_ms;
    server.send("Arm", { name: "vrpn_Base pong_message", payload: new Uint8Array(0) });
    socket.answer();
    t.mock.timers.tick(1000); // the next ping
    return ages.at(-1);
  };
  for (let i = 0; i < 3; ++i) assert.ok(Math.abs(answer() - 0.001) < 2e-4, `${ages}`);
  roundTrip_ms = 60;
  for (set_s of [3600, -3600, 0.5]) assert.ok(Math.abs(answer() - 0.03) < 2e-3, `${set_s}: ${ages}`);
});

test("a connection without an answer is lost after 3 s, and a new one is made", (t) => {
  t.mock.method(console, "warn", () => undefined);
  t.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { link, states } = connected();
  t.mock.timers.tick(2000);
  assert.deepEqual(states, ["open"]);
  t.mock.timers.tick(1000);
  assert.deepEqual(states, ["open", "lost"]);
  assert.equal(link.send(stopForces()), false);
  t.mock.timers.tick(1000);
  assert.equal(Socket.all.length, 2);
  Socket.all[1].accept();
  assert.equal(link.state, "open");
});

test("reports without a pong keep the connection for a while, but a stop may not arrive", (t) => {
  t.mock.method(console, "warn", () => undefined);
  t.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  const { link, states, socket } = connected();
  for (let s = 1; s < 20; ++s) {
    socket.server.send("Arm", { name: "report", payload: new Uint8Array(8) });
    socket.answer();
    t.mock.timers.tick(1000);
    assert.equal(link.unanswered, s >= 3, `after ${s} s`);
  }
  assert.deepEqual(states, ["open"]);
  socket.server.send("Arm", { name: "vrpn_Base pong_message", payload: new Uint8Array(0) });
  socket.answer();
  assert.equal(link.unanswered, false);
});

/** So large that the upload waits for the socket between its parts. */
const mesh = () => ({ positions: new Float32Array(3 * 400_000), triangles: new Uint32Array(3 * 400_000) });
const placement = {
  object: 1,
  name: "part.stl",
  isNew: true,
  matrix: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1],
  surface: [],
};

test("an upload ends with its connection, and the next one gets nothing of it", async () => {
  const { link, socket } = connected();
  socket.bufferedAmount = 2_000_000;
  const sending = assert.rejects(
    upload(link.channel(), mesh(), placement, () => undefined),
    /the connection was lost; the server discarded the mesh/,
  );
  await until(() => socket.received.some((name) => name.endsWith("Mesh_Vertices")));
  socket.end();
  await until(() => Socket.all.length === 2);
  Socket.all[1].accept();
  await sending;
  assert.deepEqual(Socket.all[1].received, ["Arm vrpn_Base ping_message"]);
});

test("an upload whose last bytes wait when the connection ends has failed", async () => {
  const { link, socket } = connected();
  socket.bufferedAmount = 1000;
  const small = { positions: new Float32Array(9), triangles: Uint32Array.of(0, 1, 2) };
  const shares = [];
  const sending = assert.rejects(
    upload(link.channel(), small, placement, (share) => shares.push(share)),
    /the connection was lost/,
  );
  await until(() => socket.received.at(-1).endsWith("Batch_Commit"));
  socket.end();
  await sending;
  assert.ok(!shares.includes(1), `${shares}`);
});

test("an upload goes to the device that was chosen when it began", async () => {
  const { link, socket } = connected();
  socket.bufferedAmount = 2_000_000;
  const sending = upload(link.channel(), mesh(), placement, () => undefined);
  await until(() => socket.received.some((name) => name.endsWith("Mesh_Vertices")));
  link.use("Wheel");
  link.send(startEffect(0));
  socket.bufferedAmount = 0;
  await sending;
  const others = socket.received.filter((name) => !name.startsWith("Arm "));
  assert.deepEqual(others, ["Wheel vrpn_ForceDevice startEffect"]);
  assert.ok(socket.received.includes("Arm hapticd Batch_Commit"));
});

test("an upload first clears its object: another page may have sent a mesh to the same new one", async () => {
  const small = { positions: new Float32Array(9), triangles: Uint32Array.of(0, 1, 2) };
  for (const isNew of [true, false]) {
    Socket.all = [];
    const { link, socket } = connected();
    await upload(link.channel(), small, { ...placement, isNew }, () => undefined);
    const at = (name) => socket.received.findIndex((each) => each.endsWith(name));
    assert.ok(at("Batch_Begin") < at("clearTrimesh"), `${socket.received}`);
    assert.ok(at("setObjectNumber") < at("clearTrimesh") && at("clearTrimesh") < at("Mesh_Vertices"), `${socket.received}`);
  }
});

test("a file with a long name leaves no open batch", async () => {
  const { link, socket } = connected();
  const small = { positions: new Float32Array(9), triangles: Uint32Array.of(0, 1, 2) };
  await upload(link.channel(), small, { ...placement, name: `${"scan of a part ".repeat(9)}.stl` }, () => undefined);
  const edges = socket.received.filter((name) => name.includes("Batch_"));
  assert.deepEqual(edges, ["Arm hapticd Batch_Begin", "Arm hapticd Batch_Commit"]);
});

test("a token that cannot be one keeps no page from connecting", () => {
  const stored = new Map();
  globalThis.sessionStorage = { getItem: (key) => stored.get(key) ?? null, setItem: () => undefined, removeItem: () => undefined };
  stored.set("hapticd token", "ü".repeat(100));
  const link = new Link(() => undefined, () => undefined, credentials);
  link.connect("Arm");
  Socket.all[0].accept();
  assert.equal(link.state, "open");
  stored.set("hapticd token", "0123456789abcdef");
  assert.deepEqual(credentials().map((m) => m.name), ["hapticd Identify"]);
});

test("every connection of a page begins with the same key, also after the page was loaded again", async () => {
  const storage = (stored) => ({
    stored,
    getItem: (name) => stored.get(name) ?? null,
    setItem: (name, value) => stored.set(name, value),
    removeItem: (name) => stored.delete(name),
  });
  const listeners = new Map();
  const before = globalThis.addEventListener;
  globalThis.addEventListener = (name, call) => listeners.set(name, call);
  const keyOf = ({ payload }) => new DataView(payload.buffer, payload.byteOffset + payload.byteLength - 8).getBigUint64(0);
  const keyIn = (page) => {
    const messages = page.credentials();
    assert.deepEqual(messages.map((m) => m.name), ["hapticd Identify"]);
    return keyOf(messages[0]);
  };
  const tab = storage(new Map());
  globalThis.sessionStorage = tab;
  const page = await bundled("token.ts");
  const key = keyIn(page);
  assert.notEqual(key, 0n);
  assert.equal(keyIn(page), key);
  tab.stored.set("hapticd token", "0123456789abcdef");
  assert.equal(keyIn(page), key);
  const leaves = listeners.get("pagehide");
  const returns = listeners.get("pageshow");

  globalThis.sessionStorage = storage(new Map(tab.stored)); // the browser copies it
  assert.notEqual(keyIn(await bundled("token.ts")), key, "a tab that was duplicated is another program");

  globalThis.sessionStorage = tab;
  leaves();
  const again = await bundled("token.ts");
  assert.equal(keyIn(again), key, "loaded again");

  globalThis.sessionStorage = storage(new Map(tab.stored));
  assert.notEqual(keyIn(await bundled("token.ts")), key, "duplicated after that");

  globalThis.sessionStorage = tab;
  leaves();
  returns(); // from the browser's cache of pages
  assert.equal(keyIn(page), key);
  globalThis.sessionStorage = storage(new Map(tab.stored));
  assert.notEqual(keyIn(await bundled("token.ts")), key, "duplicated after its return");

  globalThis.sessionStorage = storage(new Map());
  assert.notEqual(keyIn(await bundled("token.ts")), key, "another tab");
  globalThis.sessionStorage = { getItem: () => null, removeItem: () => undefined, setItem: () => { throw new Error("full"); } };
  assert.equal(keyIn(page), key, "in memory where the browser stores nothing");
  listeners.get("pagehide")();
  globalThis.addEventListener = before;
});

test("only a refusal of the hand makes the page forget the hand it holds", () => {
  assert.ok(refusesHand(1, "Hold_Hand refused: this client may only observe"));
  assert.ok(refusesHand(3, "Hold_Hand refused: client 4 holds the hand"));
  assert.ok(!refusesHand(1, "vrpn_ForceDevice setHapticProperty refused: this client may only observe"));
  assert.ok(!refusesHand(7, "Rearm_Forces refused: client 4 stopped the forces; it may re-arm"));
  assert.ok(!refusesHand(0, "recording to session.haptics"));
});
