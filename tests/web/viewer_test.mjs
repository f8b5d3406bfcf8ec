// The viewer in a real browser against a real server: the steps of a new user.
//   node viewer_test.mjs HAPTICD [--screenshots DIR]      writes the pictures of docs/viewer.md to DIR
import assert from "node:assert/strict";
import { mkdtemp, rm } from "node:fs/promises";
import { createServer, request } from "node:http";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, beforeEach, test } from "node:test";
import { launch, Viewer } from "./browser.mjs";
import { packageNamed, sourceDir } from "./bundled.mjs";
import { Server, until } from "./server.mjs";

const [hapticd, option, folder] = process.argv.slice(2);
const pictures = option === "--screenshots" ? folder : undefined;

const server = await Server.start(hapticd);
const browser = await launch();
const viewer = await Viewer.open(browser.context, server.url);
after(async () => {
  await browser.close();
  await Server.stopAll();
});

beforeEach(() => viewer.release());

async function picture(name, of = viewer) {
  if (!pictures) return;
  await of.until("the texts of the server are gone", () => of.ask("document.querySelector('#toasts').children.length === 0"));
  await of.settle(1500);
  await of.page.screenshot({ path: join(pictures, `viewer_${name}.png`) });
}

const CUBE =
  "v -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\nv -1 1 -1\nv -1 -1 1\nv 1 -1 1\nv 1 1 1\nv -1 1 1\n" +
  "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 3 4 8 7\nf 2 3 7 6\nf 1 5 8 4\n";
const pressed = (force_N) => force_N > 0.2;
const zero = (force_N) => force_N < 0.005;

test("an empty scene says how to load one", async () => {
  await viewer.connected();
  await viewer.until(
    "the notice",
    async () => (await viewer.ask("document.querySelector('#notice').dataset.notice")) === "empty",
  );
  assert.match(await viewer.text("#notice-text"), /Drop a mesh here/);
  await viewer.page.click("#load-bunny");
  await viewer.showsTriangles(3674);
  await viewer.until("the notice is gone", async () => !(await viewer.page.isVisible("#notice")));
});

test("on a phone, STOP and Re-arm are on the screen and work", async () => {
  const { page } = viewer;
  const size = page.viewportSize();
  await page.setViewportSize({ width: 390, height: 844 });
  for (const id of ["#stop", "#rearm"]) {
    const box = await page.locator(id).boundingBox();
    assert.ok(box.x >= 0 && box.x + box.width <= 390, `${id} from ${box.x} to ${box.x + box.width}`);
    assert.ok(box.y >= 0 && box.y + box.height <= 844, `${id} from ${box.y} to ${box.y + box.height}`);
  }
  await page.locator("aside").evaluate((e) => e.scrollIntoView({ block: "end" }));
  await page.click("#stop");
  await viewer.until("the stop", async () => (await server.state()).devices[0].guard.stopped);
  await viewer.until("STOPPED", () => viewer.ask("document.querySelector('#stage').dataset.held === 'STOPPED'"));
  await page.screenshot({ path: process.env.HAPTICD_PHONE_PICTURE ?? "/dev/null", type: "png" });
  await page.click("#rearm");
  await viewer.until("the re-arm", async () => !(await server.state()).devices[0].guard.stopped);
  await page.setViewportSize(size);
});

test("the scene appears", async () => {
  await server.touch(join(sourceDir, "testdata/meshes/bunny.obj"));
  await viewer.showsTriangles(3674);
  await viewer.until("the notice is gone", async () => !(await viewer.page.isVisible("#notice")));
  const box = await viewer.page.locator("#view").boundingBox();
  const corner = { x: box.x + 5, y: box.y + 0.6 * box.height };
  const differs = async (more, less, least) => {
    const [rgb] = await viewer.pixels([await viewer.pointOnObject()]);
    return rgb[more] > rgb[less] + least;
  };
  await viewer.page.selectOption("#quantity", "stiffness");
  await viewer.until("400 of 500 N/m are yellow", () => differs(0, 2, 40));
  assert.deepEqual(await viewer.pixels([corner]), [[0xe9, 0xec, 0xf0]]);
  await viewer.page.selectOption("#quantity", "friction");
  await viewer.until("a friction of 0.3 is blue", () => differs(2, 0, 20));
  await viewer.page.selectOption("#quantity", "object");
  assert.equal(await viewer.text("[data-object='0'] strong"), "bunny.obj");
});

test("dragging the hand over the bunny raises the force", async () => {
  await viewer.holdInAir();
  await viewer.forceIs("zero in the air", zero);
  const on = await viewer.pointOnObject();
  await viewer.press(on);
  await viewer.forceIs("there where the pointer presses", pressed);
  await viewer.dragTo(await viewer.pointOnObject(60, -40), 30);
  await viewer.forceIs("there after a stroke", pressed);
  assert.equal(await viewer.text("#touching"), "bunny.obj");
  const before = await viewer.force_N();
  for (let i = 0; i < 6; ++i) await viewer.page.mouse.wheel(0, -100);
  await viewer.forceIs("larger after the wheel", (force_N) => force_N > before + 0.1);
  await viewer.until("the object is marked in the list", () =>
    viewer.ask("document.querySelector('[data-object=\"0\"]').dataset.touched === 'true'"),
  );
  await picture("hand");
  await viewer.release();
  await viewer.forceIs("still there: the hand stays where the drag ends", pressed);
});

test("escape brings the force to zero, re-arm brings it back", async () => {
  await viewer.page.keyboard.press("Escape");
  await viewer.forceIs("zero after Escape", zero);
  await viewer.until("the guard's summary", async () =>
    (await viewer.text("#guard")).includes("Stopped: no force until re-armed"),
  );
  assert.ok((await server.state()).devices[0].guard.stopped);
  await picture("stopped");
  await viewer.page.click("#rearm");
  await viewer.forceIs("back after re-arm", pressed);
  await viewer.page.click("#stop");
  await viewer.forceIs("zero after the button", zero);
  await viewer.page.click("#rearm");
  await viewer.forceIs("back again", pressed);
});

test("an untouchable object exerts no force", async () => {
  const touchable = viewer.page.getByLabel("Object 0 is touchable");
  await touchable.uncheck();
  await viewer.forceIs("zero when the object is not touchable", zero);
  await viewer.holdInAir(); // a HIP inside the object when it returns stays inside
  await touchable.check();
  await viewer.press(await viewer.pointOnObject());
  await viewer.forceIs("there again", pressed);
  await viewer.release();
  await viewer.letGo();
});

test("a slider changes the surface", async () => {
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Surface" }).click();
  const slider = viewer.page.locator("[data-object='0'] input[name='stiffness']");
  const stiffness = async () => Math.round((await server.state()).scenes[0].objects[0].stiffness_N_per_m);
  await slider.fill("0.4");
  await until("200 N/m", async () => (await stiffness()) === 200);
  await slider.fill("0.8");
  await until("400 N/m", async () => (await stiffness()) === 400);
  await picture("surface");
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Surface" }).click();
});

test("switching an effect changes the force", async () => {
  await viewer.page.locator("#effects").getByRole("button", { name: "Add" }).click();
  const active = viewer.page.getByLabel("Effect 0 is on");
  await active.waitFor();
  await viewer.forceIs("1 N: it starts when it is added", (force_N) => Math.abs(force_N - 1) < 0.02);
  await viewer.until("the effect's name", async () =>
    (await viewer.text("#touching")).includes("effect 0 (constant)"),
  );
  await active.uncheck();
  await viewer.forceIs("zero without the effect", zero);
  await active.check();
  await viewer.forceIs("1 N again", (force_N) => Math.abs(force_N - 1) < 0.02);
  const [x, y, z] = await viewer.ask("viewer.tick.force_N");
  assert.ok(y > 0.98 && Math.hypot(x, z) < 0.05, `up, not ${[x, y, z]}`);
  await viewer.page.locator("[data-effect='0'] summary").click();
  const strength = viewer.page.getByLabel("Force, N of effect 0");
  await strength.fill("0.5");
  await strength.press("Enter");
  await viewer.forceIs("0.5 N after the edit", (force_N) => Math.abs(force_N - 0.5) < 0.02);
  await viewer.page.getByLabel("Remove effect 0").click();
  await viewer.forceIs("zero after the effect", zero);
  await viewer.until("it is gone", async () => (await viewer.page.locator("[data-effect='0']").count()) === 0);
  await viewer.letGo();
});

test("moving objects are drawn where each tick has them", async () => {
  const { wire, send, close } = await server.client();
  const at = (x) => [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, x, 0, 0, 1];
  let seen;
  const drawn = viewer
    .ask(
      `new Promise((resolve) => {
        const seen = [];
        const frame = () => {
          seen.push(viewer.view.objects.matrixOf(0)[12]);
          seen.length < 30 ? requestAnimationFrame(frame) : resolve(seen);
        };
        requestAnimationFrame(frame);
      })`,
    )
    .then((xs) => (seen = xs));
  for (let i = 0; !seen; ++i) {
    send(wire.setTransformMatrix(0, at(20 * Math.sin(0.1 * i))));
    await new Promise((resolve) => setTimeout(resolve, 18));
  }
  await drawn;
  const moved = seen.filter((x, i) => i > 0 && x !== seen[i - 1]).length;
  // The polled state has 4 positions per second.
  assert.ok(moved >= 10, `${moved} positions in ${seen.length} frames`);
  send(wire.setTransformMatrix(0, at(0)));
  await viewer.until("it rests", async () => (await viewer.ask("viewer.view.objects.matrixOf(0)[12]")) === 0);
  close();
});

/** In the page: how many pixels of the canvas differ by more than rounding when it is drawn in two ways. */
const DIFFERING = `
  const { view } = viewer;
  const copy = new OffscreenCanvas(view.canvas.width, view.canvas.height);
  const context = copy.getContext("2d", { willReadFrequently: true });
  const read = () => {
    context.drawImage(view.canvas, 0, 0);
    return context.getImageData(0, 0, copy.width, copy.height).data;
  };
  const differing = (one, other) => {
    one();
    const a = read();
    other();
    const b = read();
    let count = 0;
    for (let i = 0; i < a.length; ++i) if (Math.abs(a[i] - b[i]) > 2) ++count;
    return count;
  };`;

test("with software rendering, what only the hand changed looks as drawn anew", async () => {
  const rounds = await viewer.ask(`(async () => {${DIFFERING}
    const frame = () => new Promise((resolve) => requestAnimationFrame(resolve));
    const rounds = [];
    while (rounds.length < 8) {
      let takes = 0;
      view.still.take = function (...all) { ++takes; Object.getPrototypeOf(this).take.apply(this, all); };
      const before = viewer.tick.hand;
      for (let i = 0; i < 12; ++i) await frame();
      const moved_mm = 1000 * Math.hypot(...viewer.tick.hand.map((x, k) => x - before[k]));
      const pixels = differing(() => (view.invalidateLive(), view.draw()), () => (view.invalidate(), view.draw()));
      delete view.still.take;
      if (takes === 1) rounds.push({ moved_mm, pixels });
    }
    return rounds;
  })()`);
  assert.ok(await viewer.ask("viewer.view.software"), "the test's browser has no graphics card");
  assert.ok(Math.max(...rounds.map((r) => r.moved_mm)) > 1, `the hand moves: ${JSON.stringify(rounds)}`);
  assert.deepEqual(rounds.map((r) => r.pixels), rounds.map(() => 0));
});

test("the picture does not change when a motion begins, nor when it ends", async () => {
  const touchable = viewer.page.getByLabel("Object 0 is touchable");
  await touchable.uncheck(); // it is transparent then
  await until("untouchable", async () => (await server.state()).scenes[0].objects[0].touchable === false);
  await viewer.settle();
  const pixels = await viewer.ask(`(() => {${DIFFERING}
    return differing(() => view.drawAll(), () => { view.stillDirty = true; view.drawStill(); });
  })()`);
  assert.equal(pixels, 0);
  await touchable.check();
});

test("planes, fields and constraints are listed, drawn and switched", async () => {
  const { wire, send, close } = await server.client();
  await viewer.holdInAir();
  const tick = await viewer.ask("viewer.tick.tick");
  await viewer.until("the hand rests", () =>
    viewer.ask(`viewer.tick.tick > ${tick} + 500 && Math.hypot(...viewer.tick.velocity) < 0.0005`),
  );
  const hip_mm = 1000 * (await viewer.ask("viewer.tick.hand[1]"));
  send(wire.setPlane(0, [0, 1, 0, -(hip_mm + 2) / 1000], 0.4, 0, 0.3, 0.2));
  await viewer.forceIs("of the plane", pressed);
  await viewer.until("its name", async () => (await viewer.text("#touching")) === "plane 0");
  assert.ok(await viewer.ask("viewer.view.sources.group.children.length > 0"));
  await viewer.page.getByLabel("arrow per source").check();
  await viewer.until("an arrow for it", () => viewer.ask("viewer.view.sources.live.children.filter((c) => c.visible).length >= 2"));
  await picture("sources");
  const planes = async () => (await server.state()).scenes[0].planes.length;
  await viewer.page.getByLabel("Plane 0 is on").uncheck();
  await until("no plane", async () => (await planes()) === 0);
  await viewer.forceIs("zero without the plane", zero);
  await viewer.page.getByLabel("Plane 0 is on").check();
  await until("the plane again", async () => (await planes()) === 1);
  await viewer.page.getByLabel("Plane 0 is on").uncheck();
  const none = Array(9).fill(0);
  send(wire.setForceField([0, 0, 0], [0, 0.6, 0], none, 1));
  await viewer.until("the field's name", async () => (await viewer.text("#touching")).includes("force field"));
  await viewer.page.getByLabel("Force field is on").uncheck();
  await viewer.forceIs("zero without the field", zero);
  await viewer.page.getByLabel("arrow per source").uncheck();
  await viewer.letGo();
  close();
});

test("an object is moved, turned and scaled after loading", async () => {
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Placement" }).click();
  const matrix = async () => (await server.state()).scenes[0].objects[0].T_world_object;
  const edit = async (label, value) => {
    const field = viewer.page.getByLabel(label);
    await field.fill(value);
    await field.press("Enter");
  };
  await viewer.until("the placement", async () =>
    (await viewer.page.getByLabel("Scale of object 0").inputValue()) === "1");
  const x = Number(await viewer.page.getByLabel("Position x of object 0").inputValue());
  await edit("Position x of object 0", String(x + 12.5));
  await until("moved", async () => Math.abs((await matrix())[12] - 12.5) < 1e-3);
  await edit("Scale of object 0", "0.5");
  await until("scaled", async () => Math.abs((await matrix())[0] - 0.5) < 1e-6);
  await edit("Rotation about y, degrees, of object 0", "90");
  await until("turned", async () => Math.abs((await matrix())[8] - 0.5) < 1e-6);
  await edit("Rotation about y, degrees, of object 0", "0");
  await edit("Scale of object 0", "1");
  await edit("Position x of object 0", String(x));
  await until("back", async () => Math.abs((await matrix())[12]) < 1e-3);
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Placement" }).click();
});

test("a field that is edited changes nothing else of an object or effect", async () => {
  const { wire, send, close } = await server.client();
  const scene = async () => (await server.state()).scenes[0];
  const before = [...[0.9876543, 0.0123456, 0, 0, -0.0123456, 0.9876543, 0, 0, 0, 0, 0.9877777, 0], 1 / 3, -20 / 7, 1.23456789, 1];
  send(wire.setTransformMatrix(0, before));
  const gain = Math.fround(0.0123456789);
  const effect = { type: "spring", index: 7, gain, magnitude_N: 1.5, duration_ms: 0, frequency: 0, position: [1 / 3, 2, 3], direction: [0, 1, 0] };
  send(wire.setEffect(effect));
  const spring = async () => (await scene()).effects.find((e) => e.index === 7);
  const sent = await until("the effect", spring);
  await until("the placement", async () => (await scene()).objects[0].T_parent_object[12] === before[12]);
  const edit = async (label, value) => {
    const field = viewer.page.getByLabel(label);
    await field.fill(value);
    await field.press("Enter");
  };
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Placement" }).click();
  await viewer.page.locator("[data-effect='7'] summary").click();
  await viewer.until("the placement in the form", async () =>
    (await viewer.page.getByLabel("Scale of object 0").inputValue()).startsWith("0.987"));
  await edit("Position y of object 0", "12.5");
  const after = await until("moved", async () => {
    const matrix = (await scene()).objects[0].T_parent_object;
    return matrix[13] !== before[13] && matrix;
  });
  assert.deepEqual(after, before.with(13, after[13]));
  await edit("Limit, N of effect 7", "1.25");
  const changed = await until("another limit", async () => (await spring()).magnitude_N === 1.25 && (await spring()));
  assert.deepEqual(changed, { ...sent, magnitude_N: 1.25 });
  await viewer.page.getByLabel("Remove effect 7").click();
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Placement" }).click();
  send(wire.setTransformMatrix(0, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]));
  await until("back", async () => (await scene()).objects[0].T_parent_object[12] === 0);
  close();
});

test("a dropped mesh can be touched", async () => {
  await viewer.holdInAir(); // a mesh that appears around the HIP keeps it inside
  await viewer.drop({ "cube.obj": CUBE });
  await viewer.page.getByLabel("Target object").selectOption({ label: "replace object 0 (bunny.obj)" });
  await viewer.page.getByLabel("Largest extent").fill("40");
  await picture("drop");
  await viewer.page.getByRole("button", { name: "Load into the scene" }).click();
  await until(
    "the cube in the server",
    async () => (await server.state()).scenes[0].objects[0].triangles === 12,
  );
  await viewer.until("12 triangles in the view", () => viewer.ask("viewer.view.objects.triangles === 12"));
  await viewer.until("the confirmation", async () =>
    /cube.obj is now object 0 with 12 triangles/.test(await viewer.text("#drop-panel")),
  );
  await viewer.holdInAir();
  await viewer.press(await viewer.pointOnObject());
  await viewer.forceIs("of the cube", pressed);
  const [object, hand] = await viewer.ask("[viewer.tick.object, viewer.tick.proxy]");
  assert.equal(object, 0);
  assert.ok(
    Math.abs(Math.max(...hand.map(Math.abs)) - 0.02) < 0.001,
    `on a face of the cube of 40 mm, not at ${hand}`,
  );
  await viewer.release();
  await viewer.letGo();
});

test("a file that is not a mesh is refused by name", async () => {
  await viewer.drop({ "notes.txt": "hello" });
  await viewer.until("the refusal", async () =>
    /notes\.txt is not a mesh file: drop an OBJ, STL, PLY/.test(await viewer.text("#drop-panel")),
  );
  await viewer.drop({ "broken.obj": "v 0 0 0\n" });
  await viewer.until("the refusal", async () =>
    /broken\.obj: no triangles/.test(await viewer.text("#drop-panel")),
  );
  await viewer.page.getByRole("button", { name: "Close" }).click();
  assert.equal(await viewer.page.isVisible("#drop-panel"), false);
});

test("one viewer holds the hand, another one watches", async () => {
  const other = await Viewer.open(browser.context, server.url);
  await other.connected();
  await other.showsTriangles(12);
  await viewer.page.bringToFront();
  await viewer.press(await viewer.pointOnObject());
  await viewer.forceIs("while the first holds", pressed);
  await viewer.release();
  const [, holder] = [
    await other.page.bringToFront(),
    await until("a holder", async () => (await server.state()).devices[0].held_by),
  ];
  await other.until(
    "who holds it",
    async () => (await other.text("#hand-status")) === `Client ${holder} holds the simulated hand.`,
  );
  await other.forceIs("seen by the watcher", pressed);
  await other.press(await other.pointOnObject());
  await other.until("the refusal", async () => (await other.text("#toasts")) !== "");
  await other.release();
  assert.equal(await other.ask("viewer.hand.held"), false);
  assert.equal((await server.state()).devices[0].held_by, holder);
  await viewer.page.bringToFront();
  await viewer.letGo();
  await other.page.bringToFront();
  await other.press(await other.pointOnObject());
  await until(
    "the other one holds it",
    async () => ![null, holder].includes((await server.state()).devices[0].held_by),
  );
  await other.release();
  assert.deepEqual(other.complaints, []);
  await other.page.close();
  await until(
    "the server frees the hand of a closed page",
    async () => (await server.state()).devices[0].held_by === null,
  );
  await viewer.page.bringToFront();
});

test("of two files that are dropped at once, the second is placed", async () => {
  await viewer.drop({ "one.obj": CUBE });
  await viewer.drop({ "two.obj": CUBE });
  await viewer.until("the form", async () => (await viewer.text("#drop-panel")).includes("two.obj 8 vertices"));
  await viewer.settle();
  assert.equal(await viewer.page.locator("#drop-panel form").count(), 1);
  await viewer.page.getByRole("button", { name: "Cancel" }).click();
});

test("a second mesh waits for the first, and each becomes an object of its own", async () => {
  const browserHolds = (bytes) =>
    viewer.ask(`Object.defineProperty(viewer.link.socket, "bufferedAmount", { configurable: true, get: () => ${bytes} }) && 0`);
  const load = async (name) => {
    await viewer.drop({ [name]: CUBE });
    await viewer.page.getByRole("button", { name: "Load into the scene" }).click();
  };
  const says = (text) => viewer.until(text, async () => (await viewer.text("#drop-panel")).includes(text));
  const first = (await server.state()).scenes[0].objects.length;
  await browserHolds(2_000_000);
  await load("one.obj");
  await says("Sending one.obj");
  await load("two.obj");
  await says("two.obj waits until one.obj is sent");
  await viewer.page.getByLabel("Object 0 is touchable").uncheck();
  await viewer.until("a text", async () => (await viewer.text("#toasts")).includes("takes effect when one.obj is complete"));
  await browserHolds(0);
  await says(`two.obj is now object ${first + 1} with 12 triangles`);
  const objects = (await server.state()).scenes[0].objects.slice(first);
  assert.deepEqual(objects.map((o) => [o.name, o.triangles]), [["one.obj", 12], ["two.obj", 12]]);
  await viewer.ask("delete viewer.link.socket.bufferedAmount");
  await viewer.page.getByLabel("Object 0 is touchable").check();
  await viewer.page.getByRole("button", { name: "Close" }).click();
});

test("light, dark, and by keyboard alone", async () => {
  await viewer.page.click("#theme");
  assert.equal(await viewer.ask("document.documentElement.dataset.theme"), "dark");
  await server.touch(join(sourceDir, "testdata/meshes/bunny.obj"));
  await viewer.showsTriangles(3674);
  await viewer.page.focus("#view");
  await viewer.page.keyboard.press("ArrowUp");
  await viewer.until("the hand is held", () => viewer.ask("viewer.hand.held"));
  await viewer.letGo();
  await viewer.press(await viewer.pointOnObject());
  await viewer.forceIs("of the bunny", pressed);
  await picture("dark");
  await viewer.release();
  await viewer.letGo();
  await viewer.page.click("#theme");
});

/** The status of a request with headers that fetch does not allow. */
const statusOf = (path, headers) =>
  new Promise((resolve, reject) =>
    request(`${server.url}${path}`, { headers }, (r) => resolve(r.resume().statusCode))
      .on("error", reject)
      .end(),
  );

test("a foreign web page does not reach the server", async () => {
  for (const path of ["/", "/api/state", "/vrpn"]) {
    assert.equal(await statusOf(path, { Origin: "http://evil.example" }), 403, path);
    assert.equal(await statusOf(path, { Host: "evil.example" }), 403, path);
  }
  assert.equal(await statusOf("/api/state", { Origin: server.url }), 200);
  const foreign = createServer((_, response) => response.end("<!doctype html><title>foreign</title>")).listen(
    0,
    "127.0.0.1",
  );
  await new Promise((resolve) => foreign.once("listening", resolve));
  const page = await browser.context.newPage();
  await page.goto(`http://127.0.0.1:${foreign.address().port}/`);
  const outcome = await page.evaluate(async (url) => {
    const read = await fetch(`${url}/api/state`).then(
      () => "read",
      () => "refused",
    );
    const opened = await new Promise((resolve) => {
      const socket = new WebSocket(`${url.replace("http", "ws")}/vrpn`);
      socket.onopen = () => resolve("opened");
      socket.onerror = () => resolve("refused");
    });
    return [read, opened];
  }, server.url);
  assert.deepEqual(outcome, ["refused", "refused"]);
  await page.close();
  foreign.close();
});

test("no complaint in the console, no request to another host", () => {
  assert.deepEqual(viewer.complaints, []);
  assert.deepEqual(viewer.foreign, []);
});

test("markers, trips and a recording that the page begins and that is replayed", async () => {
  const folder = await mkdtemp(join(tmpdir(), "hapticd-replay-"));
  const live = await Server.start(hapticd, { more: ["--record", join(folder, "first.haptics")] });
  const page = await Viewer.open(browser.context, live.url);
  await page.connected();
  await page.holdInAir(); // a mesh that appears around the HIP keeps it inside
  await page.page.click("#load-bunny");
  await page.showsTriangles(3674);
  const recorded = async () => (await live.state()).server.recording;
  await page.page.getByRole("button", { name: "End recording" }).click();
  await page.until("no recording", async () => (await recorded()) === null);
  await page.page.getByRole("button", { name: "Record", exact: true }).click();
  const file = await page.until("a recording named by the time", async () => {
    const name = await recorded();
    return name !== null && /session-[0-9]{8}-[0-9]{6}/.test(name) && name;
  });
  await page.press(await page.pointOnObject());
  await page.forceIs("of the bunny", pressed);
  await page.release();
  await page.page.fill("#mark-text", "trial 3 begins");
  await page.page.press("#mark-text", "Enter");
  await page.until("the marker in the plots", () =>
    page.ask("viewer.plots.marks.some((m) => m.label === 'trial 3 begins')"));
  await page.page.keyboard.press("Escape");
  await page.forceIs("zero", zero);
  assert.match(await page.ask("viewer.plots.csv()"), /time_s,force_N,depth_mm,latency_ms\n[0-9.]+,/);
  await live.stop();
  await page.until("dashes", async () => (await page.text("#force")) === "–");
  await page.page.close();

  const replayed = await Server.start(hapticd, { replay: file });
  const replay = await Viewer.open(browser.context, replayed.url);
  await replay.connected();
  const state = async () => (await replayed.state()).server.replay;
  const line = await until("the time line", async () => (await state()).duration_s !== null && (await state()));
  assert.deepEqual(line.markers.map(([, text]) => text), ["trial 3 begins"]);
  assert.ok(line.contacts.length > 0 && line.trips.some(([, name]) => name === "stopped"), JSON.stringify(line));
  await replay.page.locator("#replay").waitFor();
  for (const id of ["#stop", "#load-mesh", "#mark", "#record", "#hand-bar"])
    assert.equal(await replay.page.isVisible(id), false, `${id} can do nothing here`);
  const [from, to] = line.contacts[0];
  const during = Math.round(50 * (from + to)) / 100;
  await replay.page.getByLabel("Position in the recording, seconds").fill(String(during));
  await replay.page.locator("#replay button").click();
  await until("paused or ended", async () => (await state()).paused || (await state()).ended);
  const client = await replayed.client();
  // The contact goes on after the hand was let go and after the stop: one of these moments has a force.
  const moments = [0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75].map((share) => from + share * (to - from));
  let next = 0;
  await replay.until("the force of then", async () => {
    const moment = moments[next++ % moments.length];
    client.send(client.wire.replayControl(true, 0, moment));
    await until("there", async () => Math.abs((await state()).position_s - moment) < 0.3 && (await state()).paused);
    return (await replay.force_N()) > 0.05;
  });
  await replay.showsTriangles(3674);
  await replay.until("Play", async () => (await replay.text("#replay button")) === "Play");
  await picture("replay", replay);
  // A seek may replace a mesh between the state that names it and the response to the request for it: the page asks again.
  assert.deepEqual(replay.complaints.filter((text) => !/status of (404|503).*\/api\/mesh/.test(text)), []);
  client.close();
  await replay.page.close();
  await replayed.stop();
  await rm(folder, { recursive: true });
});

/** Announced by machines of the network; the second wants to be more than text. */
const SERVERS = [
  { name: "hapticd on lab7", address: "10.0.0.7", port: 3883, devices: ["Phantom@10.0.0.7:3883"], page: "http://10.0.0.7:8080/", tls: false, version: "1.2.3", this_server: true },
  { name: "<img src=x onerror=alert(1)>\u202e", address: "10.0.0.8", port: 3883, devices: ["<b>Arm</b>@10.0.0.8:3883"], page: "javascript:alert(1)", tls: false, version: "<i>", this_server: false },
  { name: "attic " + "x".repeat(57), address: "10.0.0.9", port: 3884, devices: [], page: "http://10.0.0.9:8080/", tls: true, version: "9", this_server: false },
];

test("the servers of the network are listed, with links to their pages", async () => {
  const found = await (await fetch(`${server.url}/api/servers`)).json();
  assert.deepEqual(found.servers, []);
  assert.match(found.reason, /D-Bus/);
  assert.equal(await viewer.page.isVisible("#servers"), false, "nothing to show");
  await viewer.page.route("**/api/servers", (route) => route.fulfill({ json: { servers: SERVERS, reason: "" } }));
  await viewer.page.reload();
  await viewer.connected();
  await viewer.until("three servers", async () => (await viewer.page.locator("#servers li").count()) === 3);
  const row = (i) => viewer.page.locator("#servers li").nth(i);
  assert.match(await row(0).innerText(), /^hapticd on lab7\s+this server\s+Phantom@10\.0\.0\.7:3883; version 1\.2\.3$/);
  assert.equal(await row(0).getAttribute("aria-current"), "true");
  assert.equal(await row(0).locator("a").count(), 0, "no link to itself");
  assert.equal(await row(1).locator("strong").innerText(), SERVERS[1].name);
  assert.match(await row(1).innerText(), /<b>Arm<\/b>@10\.0\.0\.8:3883; version <i>/);
  assert.equal(await row(1).locator("a, b, i, img").count(), 0, "texts of the network are text, and links lead to pages");
  const link = row(2).getByRole("link", { name: SERVERS[2].name });
  assert.equal(await link.getAttribute("href"), "http://10.0.0.9:8080/");
  assert.match(await link.getAttribute("rel"), /noopener/);
  assert.match(await row(2).innerText(), /10\.0\.0\.9:3884; version 9; TLS/);
});

/** What axe finds against WCAG 2 A and AA. */
async function axeFindings(of) {
  await of.page.evaluate(packageNamed("axe-core").source);
  return of.page.evaluate(async () => {
    const { violations } = await globalThis.axe.run(document, {
      runOnly: { type: "tag", values: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] },
    });
    return violations.flatMap((v) => v.nodes.map((n) => `${v.id}: ${n.html.slice(0, 120)} ${n.failureSummary ?? ""}`));
  });
}

test("accessible on a phone, a laptop and a projector, light and dark", async () => {
  const size = viewer.page.viewportSize();
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Surface" }).click();
  await viewer.page.locator("[data-object='0'] summary", { hasText: "Placement" }).click();
  const widths = { phone: [390, 844], laptop: [1366, 768], projector: [1920, 1080] };
  const layouts = process.env.HAPTICD_LAYOUT_PICTURES;
  for (const theme of ["light", "dark"]) {
    for (const [name, [width, height]] of Object.entries(widths)) {
      await viewer.page.setViewportSize({ width, height });
      const scrolls = await viewer.ask("document.documentElement.scrollWidth > innerWidth");
      assert.equal(scrolls, false, `${name} scrolls sideways`);
      // The colours of a theme are the same at every width: axe takes seconds.
      if (theme === "light" || name === "laptop") assert.deepEqual(await axeFindings(viewer), [], `${theme}, ${name}`);
      if (layouts) await viewer.page.screenshot({ path: join(layouts, `${name}_${theme}.png`) });
    }
    await viewer.page.click("#theme");
  }
  await viewer.page.setViewportSize(size);
});

test("the picture is drawn anew after the graphics card was reset", async () => {
  const dirty = await viewer.ask(`(async () => {
    const { view } = viewer;
    const event = (name) => new Promise((resolve) => view.canvas.addEventListener(name, resolve, { once: true }));
    const context = view.renderer.getContext().getExtension("WEBGL_lose_context");
    const lost = event("webglcontextlost");
    context.loseContext();
    await lost;
    await new Promise((resolve) => setTimeout(resolve, 500));
    const restored = new Promise((resolve) =>
      view.canvas.addEventListener("webglcontextrestored", () => resolve(view.stillDirty), { once: true }));
    context.restoreContext();
    return restored;
  })()`);
  assert.equal(dirty, true);
});

test("without WebGL the page names the remedy, and STOP works", async () => {
  const page = await browser.context.newPage();
  await page.addInitScript(() => {
    const { getContext } = HTMLCanvasElement.prototype;
    HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
      return kind.startsWith("webgl") ? null : getContext.call(this, kind, ...more);
    };
  });
  await page.goto(server.url);
  await until("the notice", async () => /WebGL.*hardware acceleration/.test(await page.locator("#notice-text").innerText()));
  const stopped = async () => (await server.state()).devices[0].guard.stopped;
  await page.click("#stop");
  await until("the stop", stopped);
  await page.click("#rearm");
  await until("the re-arm", async () => !(await stopped()));
  await page.keyboard.press("Escape");
  await until("the stop by Escape", stopped);
  await page.click("#rearm");
  await until("the re-arm", async () => !(await stopped()));
  await page.close();
  await viewer.page.bringToFront();
});

test("a connection that the network dropped is noticed, and a stop before that warns", async () => {
  const { page } = viewer;
  // Nothing arrives any more in either direction, and nothing ends.
  await viewer.ask(`(() => {
    const { socket } = viewer.link;
    socket.send = () => undefined;
    socket.onmessage = null;
    socket.close = () => undefined;
  })()`);
  await page.click("#stop");
  await viewer.until("the warning", async () => /does not answer: the stop may not/.test(await viewer.text("#toasts")));
  await viewer.until("connected again", async () => (await viewer.text("#link")) === "connected");
  await page.click("#stop");
  const stopped = async () => (await server.state()).devices[0].guard.stopped;
  await until("the stop", stopped);
  await page.click("#rearm");
  await until("the re-arm", async () => !(await stopped()));
});

test("the page reconnects to a restarted server", async () => {
  await server.stop();
  await viewer.until(
    "the notice",
    async () => (await viewer.ask("document.querySelector('#notice').dataset.notice")) === "lost",
  );
  assert.match(await viewer.text("#notice-text"), /reconnects automatically/);
  const again = await Server.start(hapticd, { http: new URL(server.url).host });
  await viewer.until("connected again", () => viewer.ask("viewer.link.state === 'open'"));
  await viewer.until(
    "an empty scene",
    async () => (await viewer.ask("document.querySelector('#notice').dataset.notice")) === "empty",
  );
  await again.stop();
  const renamed = await Server.start(hapticd, { http: new URL(server.url).host, more: ["--name", "Left"] });
  await viewer.until("connected again", () => viewer.ask("viewer.link.state === 'open'"));
  await viewer.until("reports of the device that is there", () => viewer.ask("viewer.tick !== undefined"));
  await viewer.page.click("#stop");
  await until("the stop", async () => (await renamed.state()).devices[0].guard.stopped);
  renamed.process.kill("SIGSTOP");
  // Whichever it notices first: that the state does not come, or that the connection is silent.
  await viewer.until("no answer", async () => ["no answer", "lost"].includes(await viewer.text("#link")));
  await viewer.ask("document.querySelector('#toasts').replaceChildren()");
  await viewer.page.click("#stop");
  await viewer.until("the warning", async () => /the stop (may|did) not/.test(await viewer.text("#toasts")));
  await renamed.stop();
});
