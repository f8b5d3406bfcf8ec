// The hand's way around what lies between it and where it shall be.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { wayAround } = await bundled("route.ts");
const { Box3, Matrix4, Vector3 } = await bundled("../node_modules/three/build/three.module.js");

const V = (x, y, z) => new Vector3(x, y, z);
const near = (a, b) => a.distanceTo(b) < 1e-6;

/** A room with a ball in its middle; `T` places the device. */
function roomWithBall(T, radius) {
  const centre = V(0, 0, 0).applyMatrix4(T);
  const blocked = (from, to) => {
    const way = to.clone().sub(from);
    const share = Math.min(Math.max(centre.clone().sub(from).dot(way) / way.lengthSq(), 0), 1);
    return from.clone().addScaledVector(way, share).distanceTo(centre) < radius;
  };
  return { reach: new Box3(V(-0.08, -0.06, -0.035), V(0.08, 0.06, 0.035)), T_world_device: T, blocked };
}

const upright = new Matrix4().makeScale(1000, 1000, 1000);
const lying = new Matrix4()
  .makeTranslation(5, 6, 7)
  .multiply(new Matrix4().makeRotationX(1))
  .multiply(upright);

for (const [name, T] of [
  ["upright", upright],
  ["lying", lying],
]) {
  test(`from behind a ball to its front, in the open all the way: ${name}`, () => {
    const room = roomWithBall(T, 25);
    const place = (x, y, z) => V(x, y, z).applyMatrix4(T);
    const viewer = V(0, 0, 1).transformDirection(T);
    const [from, to] = [place(0.004, 0.003, -0.03), place(0, 0, 0.028)];
    const way = wayAround(from, to, viewer, room);
    assert.ok(near(way[0], from) && near(way.at(-1), to));
    for (let i = 1; i < way.length; ++i) assert.ok(!room.blocked(way[i - 1], way[i]), `leg ${i}`);
    const inverse = T.clone().invert();
    for (const point of way)
      assert.ok(room.reach.clone().expandByScalar(1e-9).containsPoint(point.clone().applyMatrix4(inverse)));
  });
}

test("what is in the open goes straight", () => {
  const room = roomWithBall(upright, 25);
  assert.deepEqual(wayAround(V(50, 30, 0), V(50, -30, 0), V(0, 0, 1), room), []);
});

test("below an overhang another way out than up is taken", () => {
  const room = roomWithBall(upright, 25);
  const from = V(0, -26, 0);
  const way = wayAround(from, V(0, 40, 0), V(0, 0, 1), room);
  assert.ok(near(way[1], V(0, -26, 35)), `${way[1].toArray()}`);
});
