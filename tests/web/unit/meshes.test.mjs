// The meshes for display, from a server that the test plays.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { Meshes } = await bundled("state.ts");

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
