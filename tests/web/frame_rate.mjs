// Frames per second of the page at 100,000 triangles, with software rendering: while only the hand moves, while an object moves,
// and while the camera turns; and the processor time of the browser for each, which depends less on what else runs. A
// measurement, not a test.
//   node tests/web/frame_rate.mjs HAPTICD [SECONDS]
import { readdirSync, readFileSync } from "node:fs";
import { launch, Viewer } from "./browser.mjs";
import { Server, until } from "./server.mjs";

const [hapticd, seconds = "10"] = process.argv.slice(2);
const RINGS = 158;
const AROUND = 316;

/** A ball with bumps of 99,856 triangles. */
function ball() {
  const positions = new Float32Array(3 * (RINGS + 1) * AROUND);
  const triangles = new Uint32Array(6 * RINGS * AROUND);
  for (let i = 0; i <= RINGS; ++i) {
    for (let j = 0; j < AROUND; ++j) {
      const [v, u] = [(Math.PI * i) / RINGS, (2 * Math.PI * j) / AROUND];
      const r = 30 + Math.sin(12 * u) * Math.sin(9 * v);
      const at = [r * Math.sin(v) * Math.cos(u), r * Math.cos(v), r * Math.sin(v) * Math.sin(u)];
      positions.set(at, 3 * (i * AROUND + j));
      if (i === RINGS) continue;
      const [a, b] = [i * AROUND + j, i * AROUND + ((j + 1) % AROUND)];
      triangles.set([a, b, a + AROUND, b, b + AROUND, a + AROUND], 6 * (i * AROUND + j));
    }
  }
  return { positions, triangles };
}

/** Processor time of all processes of the browser, which is the leader of their session. */
function cpu_ms() {
  const TICK_MS = 10;
  const processes = readdirSync("/proc").flatMap((id) => {
    try {
      const [, parent, , session, ...rest] = readFileSync(`/proc/${Number(id)}/stat`, "utf8").split(") ").at(-1).split(" ");
      return [{ id, parent, session, ms: TICK_MS * (Number(rest[7]) + Number(rest[8])) }];
    } catch {
      return []; // no process, or it has ended
    }
  });
  const browser = processes.find((p) => p.parent === String(process.pid) && p.session === p.id);
  return processes.filter((p) => p.session === browser.id).reduce((sum, p) => sum + p.ms, 0);
}

const server = await Server.start(hapticd);
const browser = await launch();
try {
  const { wire, send } = await server.client();
  const { positions, triangles } = ball();
  const step = 3 * wire.MOST_IN_ONE_MESSAGE;
  send(wire.batchBegin(), wire.setHapticProperty(0, "stiffness", 0.8));
  for (let i = 0; i < positions.length; i += step)
    send(wire.meshVertices(0, i / 3, positions.subarray(i, i + step)));
  for (let i = 0; i < triangles.length; i += step)
    send(wire.meshTriangles(0, i / 3, triangles.subarray(i, i + step)));
  send(wire.batchCommit());
  const viewer = await Viewer.open(browser.context, server.url);
  await viewer.connected();
  await until("the ball", () => viewer.ask("viewer.view.objects.triangles > 0"), 120_000);
  console.log(`${await viewer.ask("viewer.view.objects.triangles")} triangles, 1366 x 768`);
  // Median of the frames in each second.
  const measure = async (what, each = "() => {}") => {
    const [frames, ms] = [await viewer.ask("viewer.frames"), cpu_ms()];
    const perSecond = await viewer.ask(`new Promise((resolve) => {
      const counts = [];
      let frames = 0, next = performance.now() + 1000;
      const frame = (now) => {
        (${each})(now);
        ++frames;
        if (now >= next) { counts.push(frames); frames = 0; next = now + 1000; }
        counts.length < ${Number(seconds)} ? requestAnimationFrame(frame) : resolve(counts.sort((a, b) => a - b)[Math.floor(counts.length / 2)]);
      };
      requestAnimationFrame(frame);
    })`);
    const perFrame_ms = (cpu_ms() - ms) / ((await viewer.ask("viewer.frames")) - frames);
    console.log(`${what}: ${perSecond} frames/s, ${perFrame_ms.toFixed(0)} ms of processor time each`);
  };
  await measure("only the hand moves");
  let moving = true;
  const motion = (async () => {
    for (let i = 0; moving; ++i) {
      send(wire.setTransformMatrix(0, [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5 * Math.sin(0.1 * i), 0, 0, 1]));
      await new Promise((resolve) => setTimeout(resolve, 16));
    }
  })();
  await measure("the object moves");
  moving = false;
  await motion;
  const turn = "(now) => { const c = viewer.view.controls; c.autoRotate = true; c.autoRotateSpeed = 8; c.update(); }";
  await measure("the camera turns", turn);
} finally {
  await browser.close();
  await server.stop();
}
