// The meshes for display, from a server that the test plays.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { Meshes, pollState } = await bundled("state.ts");

/** A triangle as GET /api/mesh gives it. */
function answer() {
  const bytes = new ArrayBuffer(16 + 36 + 12);
  const view = new DataView(bytes);
  view.setUint32(0, 0x48444d31);
  view.setUint32(4, 3, true);
  view.setUint32(8, 1, true);
  return { status: 200, arrayBuffer: async () => bytes };
}

const turn = () => new Promise((resolve) => setTimeout(resolve, 5));

test("a request that hangs ends with its connection, and the next one asks again", async () => {
  const asked = [];
  globalThis.fetch = (url, { signal } = {}) =>
    new Promise((resolve, reject) => {
      asked.push({ url, resolve });
      signal?.addEventListener("abort", () => reject(signal.reason));
    });
  const shown = [];
  const meshes = new Meshes((id) => shown.push(id), () => undefined);
  const objects = [{ id: 3, triangles: 1, geometry: 7 }];
  await turn(); // the first request is due at once, but not at the time 0
  meshes.update(0, objects);
  meshes.update(0, objects);
  assert.equal(asked.length, 1);
  meshes.clear(); // the connection was lost
  await turn();
  meshes.update(0, objects);
  assert.equal(asked.length, 2);
  asked[0].resolve(answer());
  await turn();
  assert.deepEqual(shown, []);
  asked[1].resolve(answer());
  await turn();
  assert.deepEqual(shown, [3]);
});

test("a mesh that deforms is asked for as soon as its last shape has come", async () => {
  const asked = [];
  globalThis.fetch = (url) => new Promise((resolve) => asked.push({ url, resolve }));
  const meshes = new Meshes(() => undefined, () => undefined);
  const state = (geometry) => meshes.update(0, [{ id: 3, triangles: 1, geometry }, { id: 4, triangles: 0, geometry: 0 }]);
  await turn();
  state(7);
  assert.equal(meshes.deform, false, "a new one");
  asked[0].resolve(answer());
  await turn();
  assert.equal(meshes.deform, false);
  state(8);
  assert.equal(meshes.deform, false, "its shape is on the way");
  asked[1].resolve({ status: 404 });
  await turn();
  assert.equal(meshes.deform, true);
  state(9);
  assert.equal(asked.length, 3, "a shape that is no longer there is not waited for");
  asked[2].resolve(answer());
  await turn();
  assert.equal(meshes.deform, true);
  state(9);
  assert.equal(meshes.deform, false, "it rests");
  assert.equal(asked.length, 3);
});

test("states come four times a second, and four times as often while meshes deform", async () => {
  const before = globalThis.window;
  const timers = [];
  globalThis.window = { setTimeout: (call, ms) => timers.push([call, ms]) };
  let works = true;
  let deforms = false;
  let states = 0;
  globalThis.fetch = async () => new Response("{}", { status: works ? 200 : 500 });
  /** Times between this state and the next one. */
  const waits = async () => {
    const all = [];
    for (const last = states; states === last; await turn()) {
      const [call, ms] = timers.shift();
      all.push(ms);
      call();
    }
    return all.reduce((sum, ms) => sum + ms, 0);
  };
  pollState(() => ++states, () => deforms);
  await turn();
  assert.equal(await waits(), 250);
  deforms = true;
  assert.equal(await waits(), 60);
  works = false;
  assert.equal(await waits(), 60);
  assert.equal(await waits(), 2000, "of a server that does not answer no shape is known");
  globalThis.window = before;
});

test("a state that takes long is waited for while it comes, and given up when it does not", async () => {
  const before = [globalThis.window, globalThis.setTimeout, globalThis.clearTimeout];
  const timers = new Map();
  const later = [];
  globalThis.window = { setTimeout: (call, ms) => later.push([call, ms]) };
  globalThis.setTimeout = (call, ms) => {
    timers.set(call, ms);
    return call;
  };
  globalThis.clearTimeout = (call) => timers.delete(call);
  let parts;
  let signal;
  globalThis.fetch = async (_, options) => {
    ({ signal } = options);
    const stream = new TransformStream();
    parts = stream.writable.getWriter();
    signal.addEventListener("abort", () => parts.abort(signal.reason).catch(() => undefined));
    return new Response(stream.readable);
  };
  const states = [];
  const soon = () => new Promise((resolve) => before[1](resolve, 5));
  pollState((state) => states.push(state), () => false);
  await soon();
  for (const part of ['{"server":', ' {"version": "', "é", '"}}']) {
    assert.deepEqual([...timers.values()], [3000]);
    await parts.write(new TextEncoder().encode(part));
    await soon();
  }
  await parts.close();
  await soon();
  assert.deepEqual(states, [{ server: { version: "é" } }]);
  assert.equal(timers.size, 0);
  for (const [call] of later.splice(0)) call(); // a step of the wait
  while (states.length === 1 && signal.aborted === false && timers.size === 0) for (const [call] of later.splice(0)) call();
  await soon();
  await parts.write(new TextEncoder().encode("{"));
  await soon();
  for (const call of [...timers.keys()]) call(); // nothing more comes
  await soon();
  assert.deepEqual(states.slice(1), [undefined]);
  [globalThis.window, globalThis.setTimeout, globalThis.clearTimeout] = before;
});
