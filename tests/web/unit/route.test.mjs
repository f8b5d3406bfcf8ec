// The route of the HIP around obstacles.
import assert from "node:assert/strict";
import { test } from "node:test";
import { bundled } from "../bundled.mjs";

const { routeAround } = await bundled("route.ts");
const { Box3, Matrix4, Vector3 } = await bundled("../node_modules/three/build/three.module.js");

const V = (x, y, z) => new Vector3(x, y, z);
const near = (a, b) => a.distanceTo(b) < 1e-6;

/** Surroundings with a ball in the middle; `T` places the device. */
function withBall(T, radius) {
  const centre = V(0, 0, 0).applyMatrix4(T);
  const blocked = (from, to) => {
    const way = to.clone().sub(from);
    const share = Math.min(Math.max(centre.clone().sub(from).dot(way) / way.lengthSq(), 0), 1);
    return from.clone().addScaledVector(way, share).distanceTo(centre) < radius;
  };
  return { workspace: new Box3(V(-0.08, -0.06, -0.035), V(0.08, 0.06, 0.035)), T_world_device: T, blocked };
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
  test(`from behind a ball to its front, without touching it: ${name}`, () => {
    const surroundings = withBall(T, 25);
    const place = (x, y, z) => V(x, y, z).applyMatrix4(T);
    const viewer = V(0, 0, 1).transformDirection(T);
    const [from, to] = [place(0.004, 0.003, -0.03), place(0, 0, 0.028)];
    const way = routeAround(from, to, viewer, surroundings);
    assert.ok(near(way[0], from) && near(way.at(-1), to));
    for (let i = 1; i < way.length; ++i) assert.ok(!surroundings.blocked(way[i - 1], way[i]), `leg ${i}`);
    const inverse = T.clone().invert();
    for (const point of way)
      assert.ok(surroundings.workspace.clone().expandByScalar(1e-9).containsPoint(point.clone().applyMatrix4(inverse)));
  });
}

test("a free path is straight", () => {
  const surroundings = withBall(upright, 25);
  assert.deepEqual(routeAround(V(50, 30, 0), V(50, -30, 0), V(0, 0, 1), surroundings), []);
});

test("the route avoids an overhang", () => {
  const surroundings = withBall(upright, 25);
  const from = V(0, -26, 0);
  const way = routeAround(from, V(0, 40, 0), V(0, 0, 1), surroundings);
  assert.ok(near(way[1], V(0, -26, 35)), `${way[1].toArray()}`);
});
