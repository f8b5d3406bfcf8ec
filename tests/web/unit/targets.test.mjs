// Which objects the meshes of the page become.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { Targets } = await bundled("mesh/targets.ts");

const object = (id, triangles, geometry, name = "") => ({ id, name, triangles, geometry });

test("a new mesh becomes the first empty object, or one more", () => {
  const targets = new Targets();
  assert.deepEqual(targets.next([object(0, 0, 1)]), { object: 0, isNew: false });
  assert.deepEqual(targets.next([object(0, 12, 2), object(3, 5, 9)]), { object: 4, isNew: true });
  assert.deepEqual(targets.next([]), { object: 0, isNew: true });
});

test("a mesh under way keeps its object, until it is there or was not sent", () => {
  const targets = new Targets();
  const scene = [object(0, 0, 1)];
  const first = targets.begin(0, "one.obj", scene);
  assert.deepEqual(targets.next(scene), { object: 1, isNew: true });
  const second = targets.begin(1, "two.obj", scene);
  assert.ok(second.isUnderWay());
  assert.deepEqual(targets.next(scene), { object: 2, isNew: true });
  first.takeBack();
  assert.deepEqual(targets.next(scene), { object: 0, isNew: false });
  assert.deepEqual(targets.arrived(scene), []);
  const after = [object(0, 0, 1), object(1, 20, 4, "two.obj")];
  assert.deepEqual(targets.arrived(after), [{ name: "two.obj", present: "two.obj", object: 1, triangles: 20 }]);
  assert.ok(!second.isUnderWay(), "the text of its arrival stays");
  assert.deepEqual(targets.arrived(after), []);
  targets.begin(0, "three.obj", after);
  targets.clear();
  assert.deepEqual(targets.next(after), { object: 0, isNew: false });
});

test("meshes that replace one object arrive in their order", () => {
  const targets = new Targets();
  targets.begin(0, "one.obj", [object(0, 12, 1)]);
  targets.begin(0, "two.obj", [object(0, 12, 1)]);
  assert.deepEqual(targets.arrived([object(0, 12, 1)]), []);
  assert.deepEqual(targets.arrived([object(0, 6, 2, "one.obj")]), [{ name: "one.obj", present: "one.obj", object: 0, triangles: 6 }]);
  assert.deepEqual(targets.arrived([object(0, 6, 2)]), []);
  assert.deepEqual(targets.arrived([object(0, 8, 3, "another.obj")]), [{ name: "two.obj", present: "another.obj", object: 0, triangles: 8 }]);
});
