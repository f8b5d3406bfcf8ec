// Meshes: from files, from the server's response, and hit by a ray.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { test } from "node:test";
import { bundled, sourceDir } from "../bundled.mjs";

const { weld } = await bundled("mesh/weld.ts");
const { readMesh } = await bundled("mesh/read_file.ts");
const { decodeMesh } = await bundled("state.ts");
const { smoothGeometry } = await bundled("scene3d/creases.ts");
const { readMeshBeside } = await bundled("mesh/read_beside.ts");
const { matrixPlacing, placedAnew, placementOf } = await bundled("panels/pose.ts");
const { Objects } = await bundled("scene3d/objects.ts");
const { Color, Matrix4, Ray, Vector3 } = await bundled("../node_modules/three/build/three.module.js");

/** As the browser's File, as far as it is read. */
const file = (name, content) => ({
  name,
  arrayBuffer: async () => Uint8Array.from(Buffer.from(content)).buffer,
});

const SQUARE = [0, 0, 0, 2, 0, 0, 2, 2, 0, 0, 0, 0, 2, 2, 0, 0, 2, 0];
const sorted = ({ positions, triangles }) => {
  const corners = [...triangles].map((v) => [...positions.subarray(3 * v, 3 * v + 3)].join());
  return [0, 3]
    .map((i) =>
      corners
        .slice(i, i + 3)
        .sort()
        .join(" "),
    )
    .sort();
};

test("corners at one position become one vertex; -0 and 0 are the same position", () => {
  const mesh = weld(Float32Array.from([...SQUARE.slice(0, 9), -0, ...SQUARE.slice(10)]));
  assert.equal(mesh.positions.length, 3 * 4);
  assert.deepEqual([...mesh.triangles], [0, 1, 2, 0, 2, 3]);
});

test("the bunny has the vertices and triangles of its file", async () => {
  const { mesh } = await readMesh([
    file("bunny.obj", readFileSync(join(sourceDir, "testdata/meshes/bunny.obj"))),
  ]);
  assert.equal(mesh.triangles.length, 3 * 3674);
  assert.equal(mesh.positions.length, 3 * 1839);
});

const OBJ = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nf 1 2 3 4\n";
const STL = `solid s\n${[0, 9].map((i) => `facet normal 0 0 1\nouter loop\n${[0, 3, 6].map((c) => `vertex ${SQUARE.slice(i + c, i + c + 3).join(" ")}`).join("\n")}\nendloop\nendfacet`).join("\n")}\nendsolid s\n`;
const PLY = `ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n2 0 0\n2 2 0\n0 2 0\n3 0 1 2\n3 0 2 3\n`;

function gltf(uri) {
  const bytes = Buffer.alloc(48 + 12);
  [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0].forEach((x, i) => bytes.writeFloatLE(x, 4 * i));
  [0, 1, 2, 0, 2, 3].forEach((x, i) => bytes.writeUInt16LE(x, 48 + 2 * i));
  const json = {
    asset: { version: "2.0" },
    scene: 0,
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, scale: [2, 2, 2] }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 }, indices: 1, material: 0 }] }],
    materials: [{ pbrMetallicRoughness: { baseColorTexture: { index: 0 } } }],
    textures: [{ source: 0 }],
    images: [{ uri: "https://example.org/picture.png" }],
    buffers: [
      {
        uri: uri ?? `data:application/octet-stream;base64,${bytes.toString("base64")}`,
        byteLength: bytes.length,
      },
    ],
    bufferViews: [
      { buffer: 0, byteOffset: 0, byteLength: 48 },
      { buffer: 0, byteOffset: 48, byteLength: 12 },
    ],
    accessors: [
      { bufferView: 0, componentType: 5126, count: 4, type: "VEC3", min: [0, 0, 0], max: [1, 1, 0] },
      { bufferView: 1, componentType: 5123, count: 6, type: "SCALAR" },
    ],
  };
  return { text: JSON.stringify(json), bytes };
}

test("OBJ, STL, PLY and glTF give the same square; images of a glTF are not fetched", async () => {
  const { text } = gltf();
  const beside = gltf("data/square.bin");
  const percent = gltf("data/50%.bin");
  const escaped = gltf("data/50%25.bin");
  const sets = [
    [file("a.obj", OBJ)],
    [file("a.STL", STL)],
    [file("a.ply", PLY)],
    [file("a.gltf", text)],
    [file("a.gltf", beside.text), file("square.bin", beside.bytes)],
    [file("a.gltf", escaped.text), file("50%.bin", escaped.bytes)],
    [file("a.gltf", percent.text), file("50%.bin", percent.bytes)],
  ];
  for (const files of sets) {
    const { mesh } = await readMesh(files);
    assert.equal(mesh.positions.length, 12, files[0].name);
    assert.deepEqual(sorted(mesh), sorted(weld(Float32Array.from(SQUARE))), files[0].name);
  }
});

test("OBJ as programs write it", async () => {
  const text =
    "# v 1 2 3\nmtllib C:\\part\\\n  v .0 0 0 1\r\nv 2,0 0. +0 0.5 0.5 0.5\r\nv 2 \\\n 2 -0e3 # f 1 2\no f 1 2 3\n" +
    "v\t0\t2\t0\nvt 0 0\nf 1/1 2//1 \\\n -2 4 # \\\nl 1 2\nf 1 2\n";
  const { mesh } = await readMesh([file("a.obj", text)]);
  assert.deepEqual(sorted(mesh), sorted(weld(Float32Array.from(SQUARE))));
});

test("a face of OBJ with notches, corners in a row or a hole is covered once", async () => {
  const comb = [[0, 0], [3, 0], [3, 2], [2.5, 0.2], [2, 2], [1.5, 0.2], [1, 2], [0.5, 0.2], [0, 2]];
  const row = [[0, 0], [1, 0], [2, 0], [2, 1], [1, 1], [0, 1]];
  const hole = [[-2, -2], [-1, -1], [-1, 1], [1, 1], [1, -1], [-1, -1], [-2, -2], [2, -2], [2, 2], [-2, 2]];
  for (const [face, area] of [[comb, 3.3], [row, 2], [hole, 12]]) {
    for (let first = 0; first < face.length; ++first) {
      const turned = [...face.slice(first), ...face.slice(0, first)];
      const obj = `${turned.map(([x, y]) => `v ${x} 7 ${-y}\n`).join("")}f ${turned.map((_, i) => i + 1).join(" ")}\n`;
      const { mesh } = await readMesh([file("a.obj", obj)]);
      let along = 0;
      let all = 0;
      for (let i = 0; i < mesh.triangles.length; i += 3) {
        const [a, b, c] = [0, 1, 2].map((k) => mesh.positions.subarray(3 * mesh.triangles[i + k]));
        const twice = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]); // upwards
        along += twice / 2;
        all += Math.abs(twice) / 2;
      }
      assert.equal(mesh.triangles.length, 3 * (face.length - 2));
      assert.ok(Math.abs(along - area) < 1e-5 && Math.abs(all - area) < 1e-5, `${area}: ${along}, ${all}`);
    }
  }
});

test("errors name the file and the reason", async () => {
  const wrong = [
    [[file("notes.txt", "hello")], /notes\.txt is not a mesh file: drop an OBJ/],
    [[file("a.gltf", gltf("square.bin").text)], /a\.gltf: needs square\.bin: drop both/],
    [
      [file("points.ply", PLY.replace("element face 2", "element face 0").replace(/3 0 1 2\n3 0 2 3\n/, ""))],
      /points\.ply: no triangles/,
    ],
    [[file("short.stl", "x".repeat(100))], /short\.stl: the file is truncated, or not a valid STL file/],
    [[file("index.obj", OBJ.replace("f 1 2 3", "f 1 2 9"))], /index\.obj: line 5: a face has the corner 9, but there are 4 vertices/],
    [[file("short.obj", OBJ.replace("2 2 0", "2 2"))], /short\.obj: line 3: a vertex has 2 coordinates, expected 3/],
    [[file("word.obj", OBJ.replace("2 2 0", "2 2 0;"))], /word\.obj: line 3: '0;' is no number/],
    [[file("bad.obj", OBJ.replace("2 2 0", "2 nan 0"))], /bad\.obj: a corner of triangle 1 is not finite/],
    [[file("index.ply", PLY.replace("3 0 2 3", "3 0 2 4"))], /index\.ply: a face has the corner 4, but there are 4 vertices/],
    [[file("early.ply", PLY.replace(/ 3\n$/, ""))], /early\.ply: the file is truncated/],
    [[file("cut.stl", Buffer.alloc(40))], /cut\.stl: /],
    [[file("cut.glb", "{")], /cut\.glb: /],
  ];
  for (const [files, message] of wrong) await assert.rejects(readMesh(files), { message });
});

/** A pentagon and a quad beside vertices with a list of their own. */
function polygons(format, corners) {
  const lists = [corners, 4].map((n) => [...Array(n).keys()]);
  const header = `ply\nformat ${format} 1.0\ncomment made by hand\nelement vertex 6\nproperty float x\nproperty float y\nproperty double z\nproperty list ushort char more\nelement face 2\nproperty uchar red\nproperty list uchar int vertex_indices\nelement edge 1\nproperty int a\nend_header\n`;
  const vertices = [...Array(6).keys()].map((i) => [Math.cos(i), Math.sin(i), 0]);
  if (format === "ascii") {
    const rows = vertices.map((v) => `${v.join(" ")} 2 7 8`);
    const faces = lists.map((l) => `9 ${l.length} ${l.join(" ")}`);
    return `${header}${[...rows, ...faces, "5"].join("\n")}\n`;
  }
  const little = format.includes("little");
  const number = (method, size, value) => {
    const bytes = Buffer.alloc(size);
    bytes[`write${method}${size > 1 ? (little ? "LE" : "BE") : ""}`](value);
    return bytes;
  };
  return Buffer.concat([
    Buffer.from(header),
    ...vertices.flatMap(([x, y, z]) => [
      number("Float", 4, x),
      number("Float", 4, y),
      number("Double", 8, z),
      number("UInt16", 2, 2),
      Buffer.from([7, 8]),
    ]),
    ...lists.flatMap((l) => [Buffer.from([9, l.length]), ...l.map((v) => number("Int32", 4, v))]),
    number("Int32", 4, 5),
  ]);
}

test("polygons and strips of a PLY file are divided", async () => {
  for (const format of ["ascii", "binary_little_endian", "binary_big_endian"]) {
    for (const [corners, triangles] of [[5, 5], [4, 4], [3, 3]]) {
      const { mesh } = await readMesh([file("polygons.ply", polygons(format, corners))]);
      assert.equal(mesh.triangles.length, 3 * triangles, format);
    }
  }
  const strips = PLY.replace("element face 2", "element tristrips 1").replace(/3 0 1 2\n3 0 2 3\n/, "7 1 2 0 3 -1 0 0\n");
  const { mesh } = await readMesh([file("strips.ply", strips)]);
  assert.deepEqual(sorted(mesh), sorted(weld(Float32Array.from(SQUARE))));
});

test("decodes the server's mesh; a truncated one is an error", () => {
  const bytes = Buffer.alloc(16 + 36 + 12);
  bytes.write("HDM1");
  bytes.writeUInt32LE(3, 4);
  bytes.writeUInt32LE(1, 8);
  for (let i = 0; i < 9; ++i) bytes.writeFloatLE(i / 2, 16 + 4 * i);
  for (let i = 0; i < 3; ++i) bytes.writeUInt32LE(2 - i, 52 + 4 * i);
  const mesh = decodeMesh(Uint8Array.from(bytes).buffer);
  assert.deepEqual([...mesh.positions], [0, 0.5, 1, 1.5, 2, 2.5, 3, 3.5, 4]);
  assert.deepEqual([...mesh.triangles], [2, 1, 0]);
  assert.throws(() => decodeMesh(Uint8Array.from(bytes.subarray(0, 60)).buffer), /is truncated/);
  assert.throws(() => decodeMesh(Uint8Array.from(Buffer.from("<html>".padEnd(30))).buffer), /is not a mesh/);
});

/** The state of an object that can be felt. */
const stateOf = (id, T_world_object) => ({
  id,
  touchable: true,
  triangles: 1,
  stiffness_N_per_m: 500,
  static_friction: 0,
  T_world_object: T_world_object.toArray(),
  T_object_mesh: new Matrix4().toArray(),
});

test("a ray hits the nearest of many triangles, on either side, at its distance in the world", () => {
  // Two hundred squares behind each other, in a scaled and moved object.
  const corners = Array.from({ length: 200 }, (_, z) => SQUARE.map((x, i) => (i % 3 === 2 ? -z : x))).flat();
  const objects = new Objects(new Color());
  objects.setMesh(3, weld(Float32Array.from(corners)));
  const T = new Matrix4().makeTranslation(10, 0, -5).multiply(new Matrix4().makeScale(3, 3, 3));
  objects.update([stateOf(3, T)], "stiffness");
  const distance = (x, y, z, towards = -1) =>
    objects.distance(new Ray(new Vector3(x, y, z), new Vector3(0, 0, towards)));
  const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-9, `${a} instead of ${b}`);
  near(distance(13, 2, 20), 25);
  near(distance(13, 2, -5 - 3 * 57.5), 1.5); // from between two squares
  near(distance(13, 2, -5 - 3 * 250, 1), 3 * 51); // from behind
  assert.equal(distance(9.9, 2, 20), Infinity);
  assert.equal(distance(13, 2, -5 - 3 * 199.5), Infinity); // behind the last
  assert.ok(objects.between(new Vector3(13, 2, 20), new Vector3(13, 2, -6)));
  assert.ok(!objects.between(new Vector3(13, 2, 20), new Vector3(13, 2, -4)));
  objects.update([{ ...stateOf(3, T), touchable: false }], "stiffness");
  assert.equal(distance(13, 2, 20), Infinity);
});

test("an object whose display mesh has no triangles is never hit", () => {
  const objects = new Objects(new Color());
  objects.setMesh(0, { positions: new Float32Array(0), triangles: new Uint32Array(0) });
  objects.update([stateOf(0, new Matrix4())], "stiffness");
  assert.equal(objects.distance(new Ray(new Vector3(0, 0, 5), new Vector3(0, 0, -1))), Infinity);
});

test("triangles without area or with an infinite corner share the vertices of their neighbours", () => {
  // A fan of collinear triangles about vertex 0, one with an area, one that is not finite.
  const fan = 2000;
  const positions = new Float32Array(3 * (fan + 4));
  for (let v = 1; v <= fan + 1; ++v) positions[3 * v] = v;
  positions[3 * (fan + 2) + 1] = 1;
  positions[3 * (fan + 3) + 1] = Infinity;
  const triangles = [0, 1, fan + 2, 0, 1, fan + 3];
  for (let v = 1; v <= fan; ++v) triangles.push(0, v, v + 1);
  for (const list of [triangles, triangles.toReversed()]) {
    const geometry = smoothGeometry({ positions, triangles: Uint32Array.from(list) });
    assert.equal(geometry.index.count, list.length);
    assert.ok(geometry.getAttribute("position").count <= fan + 4 + 3, `${geometry.getAttribute("position").count} vertices`);
  }
});

test("a mesh appears where it was placed: in metres, below a parent, in a scene that was moved", () => {
  const place = (x, y, z, scale) => new Matrix4().makeRotationY(0.7).scale(new Vector3(scale, scale, scale)).setPosition(x, y, z);
  const state = (id, parent, units, T_world_object, T_object_mesh = new Matrix4()) => ({
    id,
    parent,
    world_units: units,
    T_world_object: T_world_object.toArray(),
    T_object_mesh: T_object_mesh.toArray(),
  });
  // As the server: the translation in units of the object, which scale it last; then the part of the mesh.
  const frameBy = (matrix, o) => {
    const frame = matrix.clone();
    return frame.setPosition(new Vector3().setFromMatrixPosition(matrix).multiplyScalar(o.world_units));
  };
  const inUnits = (o) => new Matrix4().makeScale(o.world_units, o.world_units, o.world_units);
  const parentFrame = place(5, -7, 40, 2);
  const wanted = place(10, 20, 30, 0.5);
  const scene = place(-3, 11, 6, 1);
  for (const parentUnits of [1, 1000]) {
    for (const units of [1, 1000]) {
      const parent = state(0, -1, parentUnits, parentFrame.clone().multiply(inUnits({ world_units: parentUnits })));
      const child = state(1, 0, units, new Matrix4(), place(1, 2, 3, 4));
      const single = state(2, -1, units, new Matrix4());
      const root = state(3, -2, units, new Matrix4());
      const frames = { T_world_scene: scene.toArray(), objects: [parent, child, single, root] };
      for (const [o, above] of [[child, parentFrame], [single, scene], [root, new Matrix4()]]) {
        const frame = above.clone().multiply(frameBy(matrixPlacing(wanted, o, frames), o));
        const T_world_mesh = frame.multiply(inUnits(o)).multiply(new Matrix4().fromArray(o.T_object_mesh));
        T_world_mesh.elements.forEach((x, i) => assert.ok(Math.abs(x - wanted.elements[i]) < 1e-9, `${T_world_mesh.elements}`));
      }
    }
  }
  const fresh = scene.clone().multiply(matrixPlacing(wanted, undefined, { T_world_scene: scene.toArray(), objects: [] }));
  fresh.elements.forEach((x, i) => assert.ok(Math.abs(x - wanted.elements[i]) < 1e-9, `${fresh.elements}`));
});

test("a placement that is edited changes in what was typed only", () => {
  // Of no round numbers, sheared, below a parent that is turned and scaled, in metres.
  const own = new Matrix4().set(0.71, 0.13, -0.2, 0.0123456789, 0.33, 0.91, 0.07, -1 / 3, -0.4, 0.11, 0.57, 2 / 7, 0, 0, 0, 1);
  const turned = new Matrix4().makeRotationY(0.7).scale(new Vector3(2, 2, 2)).setPosition(3, 4, 5);
  const centre = new Vector3(0.2, -0.3, 1 / 7);
  const units = 1000;
  for (const [parent, frame] of [[-1, new Matrix4()], [0, turned]]) {
    const worldOf = (local) => {
      const inUnits = new Matrix4().fromArray(local);
      inUnits.setPosition(new Vector3().setFromMatrixPosition(inUnits).multiplyScalar(units));
      return frame.clone().multiply(inUnits).multiply(new Matrix4().makeScale(units, units, units));
    };
    const o = {
      id: 1,
      parent,
      world_units: units,
      T_world_object: worldOf(own.toArray()).toArray(),
      T_parent_object: own.toArray(),
      T_object_mesh: new Matrix4().makeRotationX(0.2).toArray(),
    };
    const frames = {
      T_world_scene: new Matrix4().toArray(),
      objects: [{ id: 0, parent: -1, world_units: 1, T_world_object: frame.toArray(), T_object_mesh: new Matrix4().toArray() }, o],
    };
    const from = placementOf(o, centre);
    const edited = (which, value) => placedAnew(from, from.numbers.with(which, value), o, centre, frames).T_parent_object;
    const seenIn = (local) => placementOf({ ...o, T_parent_object: local, T_world_object: worldOf(local).toArray() }, centre).numbers;
    const near = (numbers, wanted) => numbers.forEach((x, i) => assert.ok(Math.abs(x - wanted[i]) < 1e-6, `${numbers}, not ${wanted}`));
    assert.deepEqual(edited(0, from.numbers[0]), o.T_parent_object);

    const moved = edited(1, 12.5);
    near(seenIn(moved), from.numbers.with(1, 12.5));
    assert.deepEqual(moved.slice(0, 12), o.T_parent_object.slice(0, 12));
    if (parent === -1) assert.deepEqual([moved[12], moved[14]], [o.T_parent_object[12], o.T_parent_object[14]]);

    const scaled = edited(6, 3 * from.numbers[6]);
    near(seenIn(scaled), from.numbers.with(6, 3 * from.numbers[6]));
    near(scaled.slice(0, 12), o.T_parent_object.slice(0, 12).map((x) => 3 * x)); // the shear, too

    const around = seenIn(edited(4, from.numbers[4] + 10));
    near(around.slice(0, 3), from.numbers.slice(0, 3));
    near([around[6]], [from.numbers[6]]);
  }
});

test("a PLY file with more entries than bytes is refused at once", { timeout: 20_000 }, async () => {
  const ply = (format, element) =>
    file("huge.ply", `ply\nformat ${format} 1.0\n${element}element face 0\nproperty list uchar int vertex_indices\nend_header\n`);
  for (const format of ["ascii", "binary_little_endian"])
    for (const element of ["element nothing 60000000\n", "element vertex 60000000\nproperty float x\n"])
      await assert.rejects(readMesh([ply(format, element)]), /60000000 entries of "\w+" do not fit into \d+ bytes/);
});

test("a file that is given up ends its worker", async () => {
  const ended = [];
  globalThis.Worker = class {
    postMessage() {}
    terminate() {
      ended.push(this);
    }
  };
  const choice = new AbortController();
  const reading = readMeshBeside([file("one.obj", "")], choice.signal);
  assert.equal(ended.length, 0);
  choice.abort();
  await assert.rejects(reading, /another file was chosen/);
  assert.equal(ended.length, 1);
});
