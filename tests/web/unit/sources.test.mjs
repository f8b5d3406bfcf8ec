// Forces by their source, the placement of objects, and meshes for display.
import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";
import { join } from "node:path";
import { test } from "node:test";
import { bundled, sourceDir } from "../bundled.mjs";

const { constraintForce, feltForces, fieldForce } = await bundled("sources.ts");
const { coarse, smoothGeometry } = await bundled("scene3d/creases.ts");
const { usualEnd, centres } = await bundled("plots/counts.ts");

const { effectOf, FIELDS, labelOf, onWire } = await bundled("panels/effects.ts");

const near = (a, b) => a.every((x, i) => Math.abs(x - b[i]) < 1e-9);

test("a field pushes inside its radius only", () => {
  const field = {
    origin: [10, 0, 0],
    force_N: [1, 0, 0],
    jacobian_N_per_unit: [-0.1, 0, 0, 0, -0.1, 0, 0, 0, -0.1],
    radius: 20,
  };
  assert.ok(near(fieldForce(field, [10, 5, 0]), [1, -0.5, 0]));
  assert.ok(near(fieldForce(field, [31, 0, 0]), [0, 0, 0]));
  assert.ok(near(fieldForce({ ...field, radius: null }, [40, 0, 0]), [-2, 0, 0]));
});

test("a constraint pulls to its point, line or plane", () => {
  const c = { point: [0, 0, 0], direction: [0, 2, 0], stiffness_N_per_m: 1000 };
  assert.ok(near(constraintForce({ ...c, mode: "point" }, [1, 2, 0], 0.001), [-1, -2, 0]));
  assert.ok(near(constraintForce({ ...c, mode: "line" }, [1, 2, 0], 0.001), [-1, 0, 0]));
  assert.ok(near(constraintForce({ ...c, mode: "plane" }, [1, 2, 0], 0.001), [0, -2, 0]));
});

test("every source is named with its force; the rest belongs to the effects", () => {
  const tick = { hand: [0, 0, 0], object: 3, depth: 0.001, force_N: [0, 3, 0] };
  const scene = {
    objects: [{ id: 3, name: "part.stl" }],
    planes: [{ index: 2 }],
    fields: [{ origin: [0, 0, 0], force_N: [0, 0.5, 0], jacobian_N_per_unit: Array(9).fill(0), radius: null }],
    constraint: null,
    effects: [
      { index: 1, type: "constant", active: true },
      { index: 2, type: "spring", active: false },
    ],
  };
  const contacts = [
    { object: 3, point: [0, 0, 0], normal: [0, 1, 0], force_N: [0, 1, 0] },
    { object: -1, point: [0, 0, 0], normal: [0, 1, 0], force_N: [0, 0.25, 0] },
  ];
  const remote = [{ id: 7, proxy: [0, 0, 0], force_N: [0, 0.25, 0], depth: 0 }];
  assert.deepEqual(
    feltForces(tick, contacts, remote, scene, 1000).map((f) => [f.name, f.force_N[1]]),
    [
      ["part.stl", 1],
      ["plane 2", 0.25],
      ["remote contact 7", 0.25],
      ["force field", 0.5],
      ["effect 1 (constant)", 1],
    ],
  );
});

test("the page offers the parameters that the server uses of each effect", async () => {
  // {"name", EffectType::type, gain, duration, frequency, position, direction}
  const table = await readFile(join(sourceDir, "src/scene/effect.h"), "utf8");
  let types = 0;
  for (const [, type, flags] of table.matchAll(/\{"(\w+)", EffectType::\w+, ((?:true|false)(?:, (?:true|false)){4})\}/g)) {
    if (!(type in FIELDS)) continue; // another name of the same type
    ++types;
    const names = ["gain", "duration_ms", "frequency", "position", "direction"];
    const used = names.filter((_, i) => flags.split(", ")[i] === "true");
    assert.deepEqual([...FIELDS[type]].sort(), [...used, "magnitude_N"].sort(), type);
  }
  assert.equal(types, Object.keys(FIELDS).length);
  assert.equal(labelOf("spring", "gain"), "Gain, N/mm");
  assert.equal(labelOf("viscous", "gain"), "Gain, N per mm/s");
});

/** A grid of squares on z = f(x, y). */
function sheet(n, f) {
  const positions = [];
  const triangles = [];
  for (let i = 0; i <= n; ++i)
    for (let j = 0; j <= n; ++j) {
      positions.push(i, j, f(i, j));
      if (i === n || j === n) continue;
      const a = i * (n + 1) + j;
      triangles.push(a, a + n + 1, a + 1, a + 1, a + n + 1, a + n + 2);
    }
  return { positions: new Float32Array(positions), triangles: new Uint32Array(triangles) };
}

test("smooth surfaces share normals, edges stay sharp", () => {
  const smooth = sheet(10, (i) => 0.05 * i * i * 0.1);
  assert.equal(smoothGeometry(smooth).getAttribute("position").count, 121);
  const roof = sheet(10, (i) => -Math.abs(i - 5));
  const geometry = smoothGeometry(roof);
  assert.equal(geometry.getAttribute("position").count, 132, "the ridge twice");
  assert.equal(geometry.index.count, roof.triangles.length);
  const normals = geometry.getAttribute("normal");
  for (let i = 0; i < normals.count; ++i)
    assert.ok(Math.abs(Math.abs(normals.getX(i)) - Math.SQRT1_2) < 1e-6, "not rounded at the ridge");
});

test("a coarse mesh has far fewer triangles of the same extent", () => {
  const full = sheet(200, (i, j) => Math.sin(0.1 * i) * Math.cos(0.1 * j));
  const few = coarse(full, 3000);
  const count = few.triangles.length / 3;
  assert.ok(count > 500 && count < 3000, `${count} of ${full.triangles.length / 3}`);
  assert.ok(Math.max(...few.triangles) < few.positions.length / 3);
  assert.ok(Math.max(...few.positions) > 190);
});

test("a single peak does not set the scale, a lasting one does", () => {
  const flat = new Float64Array(1000).fill(1);
  const peak = flat.slice();
  peak[500] = 100;
  assert.ok(usualEnd([peak]) < 2);
  const lasting = flat.slice().fill(100, 400, 600);
  assert.equal(usualEnd([lasting]), 100);
  assert.equal(usualEnd([flat, flat.map((x) => 3 * x)]), 3);
  assert.equal(usualEnd([new Float64Array(0)]), 0);
});

test("bins are drawn at their centres", () => {
  assert.deepEqual(centres([1000, 1010, 4000]), [1005, (1010 + 1.125 * 1010) / 2, 4250]);
});

test("an effect that is edited keeps its frequency, in whichever unit the server takes it", () => {
  const state = (type, frequency_Hz) => ({
    type, index: 0, active: true, magnitude_N: 1, gain: 0, duration_ms: 0, frequency_Hz, position: [0, 0, 0], direction: [0, 1, 0],
  });
  const sent = (type, frequency_Hz, unit) => onWire(effectOf(state(type, frequency_Hz)), unit).frequency;
  assert.ok(Math.abs(sent("vibrationContact", 400 / (2 * Math.PI), "rad/s") - 400) < 1e-9);
  assert.equal(sent("vibrationContact", 60, "Hz"), 60);
  assert.equal(sent("vibrationMotor", 60, "rad/s"), 60);
});
