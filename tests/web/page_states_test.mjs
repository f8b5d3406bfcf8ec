// What the page shows in states beside the usual one: several devices, long names, many objects, a role without rights, a hidden
// tab, a replay that becomes live.
import assert from "node:assert/strict";
import { mkdtemp, rm, writeFile } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { after, test } from "node:test";
import { launch, Viewer } from "./browser.mjs";
import { pause, Server, until } from "./server.mjs";

const [hapticd] = process.argv.slice(2);
const folder = await mkdtemp(join(tmpdir(), "hapticd-states-"));
const browser = await launch();
after(async () => {
  await browser.close();
  await Server.stopAll();
  await rm(folder, { recursive: true });
});

async function file(name, text) {
  const path = join(folder, name);
  await writeFile(path, text, { mode: 0o600 });
  return path;
}

async function opened(server) {
  const viewer = await Viewer.open(browser.context, server.url);
  await viewer.connected();
  return viewer;
}

/** Ends the page and the server. */
async function end(viewer, server) {
  await viewer.page.close();
  await server.stop();
}

test("a long device name and a long file name leave STOP and Re-arm on the screen", async () => {
  const config = await file("long.toml", `[[device]]\nname = "${"W".repeat(95)}"\n[[device]]\nname = "B"\n`);
  const recording = join(folder, `${"session-".repeat(24)}.haptics`);
  const server = await Server.start(hapticd, { more: ["--config", config, "--record", recording] });
  const viewer = await opened(server);
  await viewer.until("the name of the recording", async () => (await viewer.text("#recording")).includes("session-"));
  for (const [width, height] of [[1920, 1080], [1366, 768], [1024, 600], [720, 900], [390, 844], [320, 568]]) {
    await viewer.page.setViewportSize({ width, height });
    assert.equal(await viewer.ask("document.documentElement.scrollWidth > innerWidth"), false, `${width} scrolls sideways`);
    for (const id of ["#stop", "#rearm", "#link", "#device"]) {
      const box = await viewer.page.locator(id).boundingBox();
      assert.ok(box.x >= 0 && box.x + box.width <= width, `${width}: ${id} from ${box.x} to ${box.x + box.width}`);
      assert.ok(box.y >= 0 && box.y + box.height <= height, `${width}: ${id} from ${box.y} to ${box.y + box.height}`);
    }
    const [shown, of] = await viewer.ask("[document.querySelector('#recording').offsetWidth, innerWidth]");
    assert.ok(shown > 60 && shown <= of, `${width}: the recording has ${shown} pixels`);
  }
  assert.equal(await viewer.page.locator("#recording").getAttribute("title"), recording);
  await end(viewer, server);
});

test("long names and texts without a space wrap", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const fits = async (what, width, selector) => {
    const [left, right] = await viewer.ask(
      `(() => { const box = document.querySelector("${selector}").getBoundingClientRect(); return [box.left, box.right]; })()`,
    );
    assert.ok(left >= 0 && right <= width, `${what}, ${width}: ${selector} from ${left} to ${right}`);
  };
  for (const [width, height] of [[1366, 768], [390, 844], [320, 568]]) {
    await viewer.page.setViewportSize({ width, height });
    await viewer.ask("document.querySelector('#toasts').replaceChildren()");
    await viewer.page.fill("#mark-text", `${width}-${"m".repeat(190)}`.replaceAll("-", "_"));
    await viewer.page.press("#mark-text", "Enter");
    await viewer.until("the marker", async () => (await viewer.text("#toasts")).includes(`${width}_mmm`));
    await fits("a marker", width, "#toasts > div:last-child");
    await viewer.drop({ [`${"W".repeat(120)}.obj`]: "v 0 0 0\n" });
    await viewer.until("the refusal", async () => (await viewer.text("#drop-panel")).includes("no triangles"));
    const wide = await viewer.ask("(() => { const p = document.querySelector('#drop-panel p'); return p.scrollWidth > p.clientWidth; })()");
    assert.equal(wide, false, `${width}: the panel`);
    await viewer.ask(`(() => {
      Object.getPrototypeOf(viewer).readout = () => undefined;
      document.querySelector("#touching").textContent = "W".repeat(64);
    })()`);
    await fits("a name", width, "#touching");
  }
  await end(viewer, server);
});

test("another device shows nothing of the one before", async () => {
  const config = await file("two.toml", '[[device]]\nname = "A"\n[[device]]\nname = "B"\n');
  const server = await Server.start(hapticd, { more: ["--config", config] });
  const viewer = await opened(server);
  await viewer.page.click("#stop");
  await viewer.until("the trip of A", () => viewer.ask("viewer.plots.marks.some((m) => m.label === 'stopped')"));
  await viewer.page.fill("#mark-text", "of all");
  await viewer.page.press("#mark-text", "Enter");
  await viewer.until("the marker", () => viewer.ask("viewer.plots.marks.some((m) => m.label === 'of all')"));
  // A loaded machine makes ticks late, or the loop stall, whichever device it is.
  const marks = () =>
    viewer.ask("viewer.plots.marks.map((m) => m.label).filter((label) => label !== 'late' && label !== 'stalled')");
  // What the page says of the guard and of the force, whenever it says something else.
  const said = viewer.ask(`new Promise((resolve) => {
    const said = new Set();
    const device = document.querySelector("#device");
    device.value = "B";
    device.dispatchEvent(new Event("change", { bubbles: true }));
    const note = () => viewer.device.name === "B" && said.add(document.querySelector("#guard").innerText);
    const watch = new MutationObserver(note);
    watch.observe(document.querySelector("#guard"), { childList: true, characterData: true, subtree: true });
    const tick = () => {
      note();
      if (viewer.tick && viewer.plots.force.window.size > 200) resolve([...said]);
      else setTimeout(tick, 50);
    };
    tick();
  })`);
  assert.deepEqual((await said).filter((text) => /stopped|A client stopped/.test(text)), []);
  assert.deepEqual(await marks(), ["of all"]);
  assert.equal(await viewer.ask("document.querySelector('#stage').dataset.held"), "");
  // Back at A the stop stands, and is no new one.
  await viewer.page.selectOption("#device", "A");
  await viewer.until("the stop of A", async () => (await viewer.text("#guard")).includes("Stopped: no force until re-armed."));
  await viewer.until("STOPPED", () => viewer.ask("viewer.tick && document.querySelector('#stage').dataset.held === 'STOPPED'"));
  assert.deepEqual(await marks(), ["of all"]);
  await end(viewer, server);
});

test("the guard's summary is about now, its list about the last second", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const shown = (guard, recent) =>
    viewer.ask(`(() => {
      const guard = ${JSON.stringify({ armed: true, stopped: false, active: [], latched: [], ...guard })};
      viewer.guard.update({ ...viewer.device, guard }, ${JSON.stringify(recent)});
      const summary = document.querySelector("#guard .summary");
      return [summary.textContent, summary.dataset.level, document.querySelectorAll("#guard .trips li").length];
    })()`);
  assert.deepEqual(await shown({}, []), ["Armed. The guard does not change the force.", "good", 0]);
  assert.deepEqual(await shown({ active: ["slew"] }, []), ["Armed. The guard limits the force.", "warn", 1]);
  assert.deepEqual(await shown({ active: ["late"] }, ["late"]), ["The guard holds the force at zero.", "bad", 1]);
  assert.deepEqual(await shown({}, ["stopped", "late"]), [
    "Armed. The guard held the force at zero in the last second.", "warn", 2,
  ]);
  await end(viewer, server);
});

test("a refused mesh is not said to be on its way, and the reason is shown", async () => {
  const tokens = await file("tokens", "owner 0123456789abcdef0123456789abcdef\n");
  const config = await file("roles.toml", `tokens = ${JSON.stringify(tokens)}\n[[device]]\nname = "Phantom"\n`);
  const server = await Server.start(hapticd, { more: ["--config", config] });
  const viewer = await opened(server);
  await viewer.page.click("#load-bunny");
  await viewer.until("the reason", async () =>
    /bunny\.obj: .*your role is observer; present the token/.test(await viewer.text("#drop-panel")));
  await viewer.settle();
  assert.doesNotMatch(await viewer.text("#drop-panel"), /processing|Sending/);
  assert.match(await viewer.text("#toasts"), /Batch_Begin refused: your role is observer/);
  assert.doesNotMatch(await viewer.text("#toasts"), /with its batch/);
  // Another one in the same second.
  for (const name of ["one.obj", "two.obj"]) {
    await viewer.drop({ [name]: "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" });
    await viewer.page.getByRole("button", { name: "Load into the scene" }).click();
  }
  await viewer.until("the reason", async () =>
    /two\.obj: .*your role is observer; present the token/.test(await viewer.text("#drop-panel")));
  await viewer.settle();
  assert.doesNotMatch(await viewer.text("#drop-panel"), /processing|Sending/);
  assert.deepEqual(await viewer.ask("viewer.drop.targets.underWay"), []);
  await viewer.page.getByRole("button", { name: "Close" }).click();
  await viewer.page.fill("#token-text", "0123456789abcdef0123456789abcdef");
  await viewer.page.press("#token-text", "Enter");
  await until("an owner", async () => (await server.state()).clients[0].role === "owner");
  await viewer.until("the button", () => viewer.page.isVisible("#load-bunny"));
  await viewer.page.click("#load-bunny");
  await viewer.until("it arrives", async () => /is now object 0 with 3,674/.test(await viewer.text("#drop-panel")));
  await end(viewer, server);
});

test("a mesh whose connection ends before the server has read it is not said to be on its way for ever", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.ask("void (viewer.link.socket.send = () => undefined)"); // what the browser has sent waits in the network
  await viewer.page.click("#load-bunny");
  await viewer.until("it is sent", async () => /processing/.test(await viewer.text("#drop-panel")));
  await viewer.ask("viewer.link.socket.close()");
  await viewer.until("the reason", async () => /bunny\.obj: .*Load it again if it is missing/.test(await viewer.text("#drop-panel")));
  await viewer.connected();
  assert.equal((await server.state()).scenes[0].objects[0].triangles, 0);
  await viewer.page.getByRole("button", { name: "Close" }).click();
  await viewer.page.click("#load-bunny");
  await viewer.until("it arrives", async () => /is now object 0 with 3,674/.test(await viewer.text("#drop-panel")));
  await end(viewer, server);
});

test("a mesh fits into a workspace that is turned, and does not replace an object that is gone", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const size = await viewer.ask(`(() => {
    // 160 x 120 x 70 mm, with its x axis up.
    const device = { ...viewer.device, T_world_device: [0, 1000, 0, 0, -1000, 0, 0, 0, 0, 0, 1000, 0, 0, 0, 0, 1] };
    const mesh = { positions: Float32Array.of(0, 0, 0, 1, 10, 0, 0, 10, 1), triangles: Uint32Array.of(0, 1, 2) };
    const placing = viewer.drop.newPlacing("tall.obj", mesh, device);
    placing.target.append(new Option("replace object 99", "99"));
    placing.target.value = "99";
    document.querySelector("#drop-panel").hidden = false;
    viewer.drop.load("tall.obj", mesh, placing);
    return placing.size.valueAsNumber;
  })()`);
  assert.equal(size, 128);
  await viewer.until("the reason", async () => /tall\.obj: object 99 was removed/.test(await viewer.text("#drop-panel")));
  await end(viewer, server);
});

test("a mesh whose place another program took is not said to be there", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.page.route("**/api/state", async (route) => {
    const state = await (await route.fetch()).json();
    const [object] = state.scenes[0].objects;
    if (object.triangles > 0) object.name = "other.obj";
    await route.fulfill({ json: state });
  });
  await viewer.page.click("#load-bunny");
  await viewer.until("what became of it", async () =>
    /bunny\.obj was sent, but another program made other\.obj of object 0\./.test(await viewer.text("#drop-panel")));
  await viewer.page.unrouteAll({ behavior: "ignoreErrors" });
  await end(viewer, server);
});

test("a hidden page gives the hand back after a minute", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.holdInAir();
  await until("the page holds the hand", async () => (await server.state()).devices[0].held_by !== null);
  // A hidden page draws no frames.
  await viewer.ask("(() => { window.requestAnimationFrame = () => 0; })()");
  const frames = () => viewer.ask("viewer.frames");
  for (let last = -1, now = await frames(); now !== last; now = await frames()) {
    last = now;
    await viewer.settle();
  }
  await viewer.ask("viewer.hand.usedAt_ms -= 61_000");
  await until("the hand is free", async () => (await server.state()).devices[0].held_by === null);
  await end(viewer, server);
});

test("hundreds of objects are all drawn soon, and the list says how many it leaves out", async () => {
  const server = await Server.start(hapticd);
  const { wire, send, close } = await server.client();
  const corners = Float32Array.from([0, 0, 0, 1, 0, 0, 0, 1, 0]);
  send(wire.batchBegin(), wire.setObjectNumber(300));
  for (let i = 0; i < 300; ++i) send(wire.meshVertices(i, 0, corners), wire.meshTriangles(i, 0, Uint32Array.of(0, 1, 2)));
  send(wire.batchCommit());
  await until("the scene", async () => (await server.state()).scenes[0].objects.length === 300);
  const viewer = await opened(server);
  await viewer.until("a state", () => viewer.ask("viewer.objects().length === 300"));
  // By polls, not by time: the state is asked for four times per second.
  await viewer.ask(`(() => {
    const { update } = viewer.meshes;
    viewer.polls = 0;
    viewer.meshes.update = function (...all) { ++viewer.polls; return update.apply(this, all); };
  })()`);
  await until("all in the view", () => viewer.ask("viewer.view.objects.triangles === 300"), 120_000);
  const polls = await viewer.ask("viewer.polls");
  assert.ok(polls < 150, `all after ${polls} states`);
  assert.match(await viewer.text("#objects"), /and 100 more/);
  send(wire.messages.ResetScene.encode({ ignored: 0 }));
  await viewer.until("one object", () => viewer.ask("viewer.objects().length === 1"));
  assert.doesNotMatch(await viewer.text("#objects"), /more/);
  close();
  await end(viewer, server);
});

test("of effects that are added at once, each has an index of its own", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.ask(`(() => {
    const [type, add] = document.querySelectorAll("#effects .adder > *");
    for (const one of ["spring", "viscous", "constant"]) {
      type.value = one;
      add.click();
    }
  })()`);
  const effects = async () => (await server.state()).scenes[0].effects.map((e) => [e.index, e.type]);
  await until("the last one", async () => (await effects()).some(([, type]) => type === "constant"));
  assert.deepEqual(await effects(), [[0, "spring"], [1, "viscous"], [2, "constant"]]);
  await end(viewer, server);
});

test("no force is drawn after the connection was lost", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.page.getByRole("button", { name: "Add" }).click();
  const drawn = () => viewer.ask("[...viewer.view.markers.group.children].filter((part) => part.visible).length");
  await viewer.forceIs("1 N", (force_N) => Math.abs(force_N - 1) < 0.02);
  assert.ok((await drawn()) > 3);
  await server.stop();
  await viewer.until("the notice", async () => (await viewer.text("#link")) === "lost");
  assert.equal(await drawn(), 1, "the workspace");
  await viewer.page.close();
});

test("no line of a plot joins what was measured before and after a gap", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const gaps = () => viewer.ask("[viewer.plots.force, viewer.plots.latency].map((p) => p.plot.series[1]._paths?.gaps.length)");
  await viewer.until("a line", async () => (await gaps()).every((n) => n === 0));
  await server.stop();
  await viewer.until("the notice", async () => (await viewer.text("#link")) === "lost");
  await pause(1000);
  const next = await Server.start(hapticd, { http: new URL(server.url).host });
  await viewer.until("two lines", async () => (await gaps()).every((n) => n === 1));
  // A machine that starts anew counts its time from 0: all samples of before would lie in the future.
  await viewer.ask(`(() => {
    const { plots } = viewer;
    plots.tick({ ...plots.newest, time_ns: plots.newest.time_ns + 1e12 }, 0, 0, 0);
    plots.marker(plots.newest.time_ns / 1e9, "of before");
  })()`);
  await viewer.until("only new samples", () => viewer.ask(`(() => {
    const [time] = viewer.plots.force.window.data();
    return time.length > 5 && time.every((t, i) => i === 0 || t >= time[i - 1]) && viewer.plots.marks.length === 0;
  })()`));
  await end(viewer, next);
});

test("where the browser stores nothing, the page works", async () => {
  const server = await Server.start(hapticd);
  const page = await browser.context.newPage();
  await page.addInitScript(`for (const store of ["localStorage", "sessionStorage"])
    Object.defineProperty(window, store, { get() { throw new DOMException("denied", "SecurityError"); } });`);
  await page.goto(server.url);
  await until("the connection", async () => (await page.innerText("#link")) === "connected");
  await page.click("#theme");
  assert.equal(await page.innerText("#theme"), "Light");
  await page.fill("#token-text", "0123456789abcdef");
  await page.press("#token-text", "Enter");
  await page.click("#stop");
  await until("the stop", async () => (await server.state()).devices[0].guard.stopped);
  await page.close();
  await server.stop();
});

test("what changes all the time is not read aloud", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.until("a plot", async () => (await viewer.text("[data-plot=Latency] output")).includes("ms"));
  await viewer.page.locator("#hand-bar").waitFor();
  const session = await browser.context.newCDPSession(viewer.page);
  const { nodes } = await session.send("Accessibility.getFullAXTree");
  const live = nodes.filter((n) => n.properties?.some((p) => p.name === "live" && p.value.value !== "off"));
  const ids = await Promise.all(
    live.map(async ({ backendDOMNodeId }) => {
      const { node } = await session.send("DOM.describeNode", { backendNodeId: backendDOMNodeId });
      return node.attributes[node.attributes.indexOf("id") + 1];
    }),
  );
  assert.deepEqual(ids.sort(), ["hand-bar", "held", "link", "toasts"]);
  await viewer.page.click("#stop");
  await viewer.until("STOPPED", async () => (await viewer.text("#held")) === "STOPPED");
  await end(viewer, server);
});

test("keys of the browser do not move the hand, and steps out of the workspace need no steps back", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const x = () => viewer.ask("viewer.hand.target.x");
  await viewer.page.focus("#view");
  for (const modifier of ["Alt", "Control", "Meta"])
    assert.equal(
      await viewer.ask(`document.querySelector("#view").dispatchEvent(
        new KeyboardEvent("keydown", { key: "ArrowLeft", ${modifier === "Control" ? "ctrl" : modifier.toLowerCase()}Key: true, cancelable: true }))`),
      true,
      modifier,
    );
  assert.equal(await viewer.ask("viewer.hand.held"), false);
  for (let i = 0; i < 60; ++i) await viewer.page.keyboard.press("Shift+ArrowRight");
  const end_mm = await viewer.ask("viewer.device.workspace_m.max[0] * 1000");
  assert.ok(Math.abs((await x()) - end_mm) < 1e-6, `${await x()}`);
  await viewer.page.keyboard.press("Shift+ArrowLeft");
  assert.ok((await x()) < end_mm - 5, `${await x()}`);
  await viewer.page.keyboard.press("l");
  await end(viewer, server);
});

test("of two fingers, both move the camera and none the hand", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const session = await browser.context.newCDPSession(viewer.page);
  const { x, y } = await viewer.ask(`(() => {
    const { left, top, width, height } = document.querySelector("#view").getBoundingClientRect();
    return { x: left + width / 2, y: top + height / 2 };
  })()`);
  const touch = (type, ...points) =>
    session.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([dx, dy], id) => ({ x: x + dx, y: y + dy, id })) });
  const target = () => viewer.ask("viewer.hand.target.toArray()");
  const away = () => viewer.ask("viewer.view.camera.position.distanceTo(viewer.view.controls.target)");
  await touch("touchStart", [0, 0]);
  for (let i = 1; i <= 5; ++i) await touch("touchMove", [10 * i, 0]);
  await viewer.until("the hand", () => viewer.ask(`viewer.hand.held && !viewer.hand.aimPending && viewer.hand.pointer.x > ${x} + 45`));
  const before = await target();
  const from = await away();
  await touch("touchStart", [50, 0], [-100, 0]);
  for (let i = 1; i <= 5; ++i) await touch("touchMove", [50 + 10 * i, 0], [-100 - 10 * i, 0]);
  await viewer.until("a nearer camera", async () => (await away()) < 0.95 * from);
  assert.ok((await away()) > 0.4 * from, `from ${from} to ${await away()}`);
  await touch("touchEnd", [100, 0]);
  await touch("touchMove", [120, 30]);
  await touch("touchEnd");
  assert.deepEqual(await target(), before);
  assert.equal(await viewer.ask("viewer.hand.held && !viewer.hand.dragging"), true);
  await viewer.letGo();
  await end(viewer, server);
});

test("a pinch does not take the hand, and a tap does", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const session = await browser.context.newCDPSession(viewer.page);
  const { x, y } = await viewer.ask(`(() => {
    const { left, top, width, height } = document.querySelector("#view").getBoundingClientRect();
    return { x: left + width / 2, y: top + height / 2 };
  })()`);
  // As events of one task, so that a busy machine makes no pause between the fingers.
  const pinch = viewer.ask(`(() => {
    let took = false;
    const { canvas } = viewer.view;
    const fire = (type, pointerId, dx) => {
      const at = { clientX: ${x} + dx, clientY: ${y}, pointerId, isPrimary: pointerId === 101, pointerType: "touch", bubbles: true, buttons: 1 };
      canvas.dispatchEvent(new PointerEvent(type, at));
      took ||= viewer.hand.held;
    };
    canvas.setPointerCapture = canvas.releasePointerCapture = () => undefined; // of pointers that the browser does not know
    fire("pointerdown", 101, 50);
    fire("pointermove", 101, 53);
    fire("pointerdown", 102, -50);
    for (let i = 1; i <= 20; ++i) { fire("pointermove", 101, 53 + 5 * i); fire("pointermove", 102, -50 - 5 * i); }
    fire("pointerup", 102, -150);
    fire("pointerup", 101, 153);
    delete canvas.setPointerCapture;
    delete canvas.releasePointerCapture;
    return took;
  })()`);
  assert.equal(await pinch, false);
  await viewer.settle(300);
  assert.equal(await viewer.ask("viewer.hand.held"), false);
  await session.send("Input.dispatchTouchEvent", { type: "touchStart", touchPoints: [{ x, y, id: 0 }] });
  await session.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
  await viewer.until("the hand", () => viewer.ask("viewer.hand.held && !viewer.hand.dragging"));
  await viewer.letGo();
  await end(viewer, server);
});

test("two quick clicks on Record begin one recording, and the button says its state once", async () => {
  const config = await file("record.toml", `record = ${JSON.stringify(join(folder, "once.haptics"))}\n[[device]]\nname = "Phantom"\n`);
  const server = await Server.start(hapticd, { more: ["--config", config] });
  const viewer = await opened(server);
  const button = viewer.page.locator("#record");
  await viewer.until("the recording of the configuration", async () => (await button.innerText()) === "End recording");
  assert.equal(await button.getAttribute("aria-pressed"), null);
  await viewer.ask(`(() => {
    viewer.asked = 0;
    const { send } = viewer.link;
    viewer.link.send = function (...messages) {
      viewer.asked += messages.filter((m) => m.name.includes("Recording_Control")).length;
      return send.apply(this, messages);
    };
  })()`);
  await viewer.ask("(() => { const b = document.querySelector('#record'); b.click(); b.click(); })()");
  assert.equal(await viewer.ask("viewer.asked"), 1);
  await viewer.until("its end", async () => (await button.innerText()) === "Record");
  await button.dblclick();
  await viewer.until("another one", async () => (await button.innerText()) === "End recording");
  assert.equal(await viewer.ask("viewer.asked"), 2);
  // A refusal leaves the button as it was: another page ended the recording, and this one did not know it yet.
  await viewer.ask("viewer.recording = false");
  await viewer.ask("(() => { document.querySelector('#record').click(); })()");
  await viewer.until("the refusal", async () => (await viewer.text("#toasts")).includes("Recording_Control"));
  await viewer.until("the button", () => viewer.ask("viewer.recording && performance.now() >= viewer.recordAgainAt_ms"));
  await button.click();
  await viewer.until("its end", async () => (await button.innerText()) === "Record");
  await end(viewer, server);
});

test("another scene is shown without what was done to the one before", async () => {
  const config = await file("scenes.toml", '[[device]]\nname = "A"\nscene = "a"\n[[device]]\nname = "B"\nscene = "b"\n');
  const server = await Server.start(hapticd, { more: ["--config", config] });
  const viewer = await opened(server);
  const add = async () => {
    await viewer.page.getByRole("button", { name: "Add" }).click();
    await viewer.until("the effect", () => viewer.page.locator('[data-effect="0"]').isVisible());
  };
  const choose = async (device) => {
    await viewer.page.selectOption("#device", device);
    await viewer.until("its ticks", () => viewer.ask(`viewer.device.name === "${device}" && viewer.tick !== undefined`));
  };
  const stopped = () => viewer.page.getByLabel("Effect 0 is on").uncheck();
  await choose("B");
  await add();
  await stopped();
  await choose("A");
  await add();
  await viewer.page.locator('[data-effect="0"] summary').click();
  await viewer.page.getByRole("button", { name: "Remove effect 0" }).click();
  await viewer.until("it goes", async () => (await viewer.page.locator('[data-effect="0"]').count()) === 0);
  // A mesh that was placed in the workspace of A is not loaded into the scene of B.
  await viewer.drop({ "triangle.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" });
  await viewer.until("the preview", () => viewer.page.getByRole("button", { name: "Load into the scene" }).isVisible());
  await choose("B");
  assert.equal(await viewer.page.getByRole("button", { name: "Load into the scene" }).count(), 0);
  assert.match(await viewer.text("#drop-panel"), /another scene: drop the file again/);
  await viewer.until("the effect of B", () => viewer.page.locator('[data-effect="0"]').isVisible());
  await end(viewer, server);
});

test("a server that was started anew gets nothing that was typed for, or switched off in, the one before", async () => {
  const first = await Server.start(hapticd);
  const viewer = await opened(first);
  const client = await first.client();
  client.send(client.wire.setPlane(0, [0, 1, 0, 0.03], 0.5, 0, 0, 0));
  await viewer.page.getByLabel("Plane 0 is on").uncheck();
  await until("no plane", async () => (await first.state()).scenes[0].planes.length === 0);
  await viewer.page.click("#load-bunny");
  await viewer.showsTriangles(3674);
  await viewer.page.locator('[data-object="0"] summary', { hasText: "Placement" }).click();
  await viewer.page.getByLabel("Position x of object 0").focus();
  client.close();
  await first.stop();
  await viewer.until("the end", () => viewer.ask("viewer.link.state === 'lost'"));
  const second = await Server.start(hapticd, { http: new URL(first.url).host });
  await viewer.connected();
  await viewer.until("nothing of the plane", async () => (await viewer.page.getByLabel("Plane 0 is on").count()) === 0);
  assert.equal(await viewer.ask("document.activeElement.closest('[data-object]')"), null);
  await end(viewer, second);
});

test("the choice of speeds of a replay has the present one", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const choice = (speed) =>
    viewer.ask(`(() => {
      viewer.replay.update({ file: "a.haptics", position_s: 1, duration_s: 9, speed: ${speed}, paused: false, ended: false, loop: false, contacts: [], trips: [], markers: [] });
      return document.querySelector("#replay select").selectedOptions[0]?.text;
    })()`);
  assert.equal(await choice(1), "1 ×");
  assert.equal(await choice(0.2), "0.2 ×");
  assert.equal(await choice(0.3), "0.3 ×");
  await end(viewer, server);
});

test("the picture has a pixel for each of the screen, also after a zoom", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const session = await browser.context.newCDPSession(viewer.page);
  for (const zoom of [2, 0.5, 1]) {
    const size = { width: Math.round(1366 / zoom), height: Math.round(768 / zoom) };
    await session.send("Emulation.setDeviceMetricsOverride", { ...size, deviceScaleFactor: zoom, mobile: false });
    await viewer.until(`zoom ${zoom}`, () =>
      viewer.ask(`devicePixelRatio === ${zoom} && Math.abs(viewer.view.canvas.width - ${zoom} * viewer.view.canvas.clientWidth) <= 2`));
  }
  await end(viewer, server);
});

test("in forced colours it is seen which of several is chosen, and colours that are the content stay", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.page.emulateMedia({ forcedColors: "active" });
  const backgrounds = await viewer.ask(
    "[...document.querySelectorAll('#drag-is input')].map((i) => getComputedStyle(i.nextElementSibling).backgroundColor)",
  );
  assert.equal(new Set(backgrounds).size, 2, `${backgrounds}`);
  const swatches = await viewer.ask(`(() => {
    const card = document.createElement("i");
    card.className = "swatch";
    card.style.background = "rgb(1, 2, 3)";
    document.body.append(card);
    const { backgroundColor } = getComputedStyle(card);
    card.remove();
    return backgroundColor;
  })()`);
  assert.equal(swatches, "rgb(1, 2, 3)");
  await end(viewer, server);
});

test("a seek or a speed right after a pause leaves the replay paused", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  // In one task: the next state of the server would bring the pause, too.
  const paused = await viewer.ask(`(() => {
    const { replay } = viewer;
    const [slider, speed] = ["input[type=range]", "select"].map((what) => document.querySelector("#replay " + what));
    const sent = [];
    replay.send = (...messages) => sent.push(...messages.map((m) => new DataView(m.payload.slice().buffer).getInt16(0)));
    replay.update({ file: "a.haptics", position_s: 1, duration_s: 9, speed: 1, paused: false, ended: false, loop: false, contacts: [], trips: [], markers: [] });
    const seek = () => slider.dispatchEvent(new Event("input"));
    seek();
    document.querySelector("#replay button").click();
    seek();
    speed.dispatchEvent(new Event("change"));
    document.querySelector("#replay button").click();
    seek();
    return sent;
  })()`);
  assert.deepEqual(paused, [0, 1, 1, 1, 0, 0]);
  await end(viewer, server);
});

test("paused plots are saved with the marks of their time", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  await viewer.until("samples", () => viewer.ask("viewer.plots.force.data()[0].length > 2"));
  const [held, live] = await viewer.ask(`(() => {
    const { plots } = viewer;
    const pause = document.querySelector("#plots-pause");
    pause.click();
    const last = plots.force.data()[0].at(-1);
    plots.marker(last, "within");
    plots.marker(last + 1, "after");
    const held = plots.csv();
    pause.click();
    return [held, plots.csv()];
  })()`);
  // Trips of a late tick may be among them.
  const own = (csv) => [...csv.matchAll(/^# [0-9.]+ (within|after)$/gm)].map(([, label]) => label);
  assert.deepEqual(own(held), ["within"]);
  assert.deepEqual(own(live), ["within", "after"]);
  await end(viewer, server);
});

test("the letters L and M can be switched off, and Esc stops in any case", async () => {
  const server = await Server.start(hapticd);
  const viewer = await opened(server);
  const { page } = viewer;
  const box = page.getByLabel("keys L and M");
  const marks = async () => {
    await page.keyboard.press("m");
    return viewer.ask("viewer.marked");
  };
  assert.equal(await marks(), 1);
  await box.uncheck();
  await viewer.holdInAir();
  await page.keyboard.press("l");
  assert.equal(await viewer.ask("viewer.hand.held"), true);
  assert.equal(await marks(), 1);
  assert.equal(await page.isVisible("#mark kbd"), false);
  await page.reload();
  await viewer.connected();
  assert.equal(await box.isChecked(), false);
  assert.equal(await viewer.ask("document.activeElement === document.body"), true);
  await page.keyboard.press("m");
  assert.equal(await viewer.ask("viewer.marked"), 0);
  await page.keyboard.press("Escape");
  await until("a stop", async () => (await server.state()).devices[0].guard.stopped);
  await box.check();
  assert.equal(await marks(), 1);
  assert.equal(await page.isVisible("#mark kbd"), true);
  await end(viewer, server);
});

test("a page of a replay moves the hand of the live server that follows", async () => {
  const recording = join(folder, "short.haptics");
  const recorded = await Server.start(hapticd, { more: ["--record", recording] });
  await until("some ticks", async () => (await recorded.state()).devices[0].loop.ticks > 500);
  await recorded.stop();
  const replayed = await Server.start(hapticd, { replay: recording });
  const viewer = await opened(replayed);
  await viewer.until("the replay", () => viewer.page.isVisible("#replay"));
  assert.equal(await viewer.ask("viewer.hand.enabled"), false);
  assert.equal(await viewer.page.isVisible("#notice"), false, "nothing can be loaded into its empty scene");
  await viewer.drop({ "triangle.obj": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n" });
  await viewer.until("the reason", async () => (await viewer.text("#toasts")).includes("replays a recording: nothing can be loaded"));
  assert.equal(await viewer.page.isVisible("#drop-panel"), false);
  await replayed.stop();
  const live = await Server.start(hapticd, { http: new URL(replayed.url).host });
  await viewer.until("live", () => viewer.ask("viewer.link.state === 'open' && viewer.state.server.replay === null && viewer.tick"));
  assert.equal(await viewer.page.isVisible("#replay"), false);
  await viewer.holdInAir();
  await until("the page holds the hand", async () => (await live.state()).devices[0].held_by !== null);
  await viewer.release();
  await viewer.letGo();
  await end(viewer, live);
});
