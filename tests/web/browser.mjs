// Headless Chromium, and a viewer in it that a test drives as a user would.
import { mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { packageNamed } from "./bundled.mjs";
import { pause, until } from "./server.mjs";

const FLAGS = [
  "--headless",
  "--no-sandbox",
  "--use-angle=swiftshader",
  "--enable-unsafe-swiftshader",
  "--disable-quic",
  "--no-first-run",
  "--disable-background-networking",
  "--disable-component-update",
  "--disable-sync",
];

export async function launch({ size = { width: 1366, height: 768 }, colorScheme = "light" } = {}) {
  const { chromium } = packageNamed("playwright-core");
  const folder = await mkdtemp(join(tmpdir(), "hapticd-chromium-"));
  const executablePath = process.env.HAPTICD_CHROMIUM || "/usr/bin/chromium";
  const context = await chromium.launchPersistentContext(folder, {
    executablePath,
    args: FLAGS,
    viewport: size,
    colorScheme,
    timeout: 120_000,
  });
  context.setDefaultTimeout(60_000);
  const close = async () => {
    await context.close();
    await rm(folder, { recursive: true, force: true });
  };
  return { context, close };
}

/** A page with the viewer, and access to its state. */
export class Viewer {
  complaints = [];
  foreign = [];

  static async open(context, url) {
    const viewer = new Viewer();
    viewer.page = await context.newPage();
    viewer.page.on(
      "console",
      (m) => ["error", "warning"].includes(m.type()) && viewer.complaints.push(`${m.text()} ${m.location().url}`),
    );
    viewer.page.on("pageerror", (error) => viewer.complaints.push(String(error)));
    viewer.page.on("request", (r) => new URL(r.url()).origin !== url && viewer.foreign.push(r.url()));
    viewer.page.on(
      "websocket",
      (w) => new URL(w.url()).host !== new URL(url).host && viewer.foreign.push(w.url()),
    );
    await viewer.page.goto(url);
    return viewer;
  }

  /** Evaluates an expression in the page. */
  ask(expression) {
    return this.page.evaluate(expression);
  }
  text(selector) {
    return this.page.locator(selector).innerText();
  }
  until(what, ask) {
    return until(what, ask);
  }

  async connected() {
    await this.until("the page is connected and receives ticks", () =>
      this.ask("viewer.link.state === 'open' && viewer.tick !== undefined"),
    );
  }

  /** Waits until the page draws at least this many triangles. */
  async showsTriangles(least) {
    await this.until(`${least} triangles in the view`, () =>
      this.ask(`viewer.view.objects.triangles >= ${least}`),
    );
  }

  /** The displayed force. */
  async force_N() {
    return Number(await this.text("#force"));
  }

  /** The newest points of the force plot. */
  async plottedForces_N(count = 10) {
    return this.ask(`[...viewer.plots.force.window.data()[1].slice(-${count})]`);
  }

  /** Waits until both the label and the plot show a force that satisfies `ok`. */
  async forceIs(what, ok) {
    await this.until(
      `force ${what}; it is ${await this.force_N()} N`,
      async () => ok(await this.force_N()) && (await this.plottedForces_N()).every(ok),
    );
  }

  /** A point on the page well inside an object, nearest to its centre on the screen plus an offset. */
  async pointOnObject(right = 0, down = 0) {
    const ask = `(() => {
      const box = viewer.view.canvas.getBoundingClientRect();
      const on = (x, y) => Number.isFinite(viewer.view.objects.distance(viewer.view.rayAt(x, y)));
      const points = [];
      for (let x = box.left + 20; x < box.right - 20; x += 10) for (let y = box.top + 20; y < box.bottom - 60; y += 10) {
        if (on(x, y) && on(x - 12, y) && on(x + 12, y) && on(x, y - 12) && on(x, y + 12)) points.push({ x, y });
      }
      return points;
    })()`;
    const points = await this.until("an object to touch in the view", async () => {
      const found = await this.ask(ask);
      return found.length > 0 && found;
    });
    const middle = (key) => points.reduce((sum, p) => sum + p[key], 0) / points.length;
    const [x, y] = [middle("x") + right, middle("y") + down];
    const away = (p) => Math.hypot(p.x - x, p.y - y);
    return points.reduce((best, p) => (away(p) < away(best) ? p : best));
  }

  /** A point in the view inside the workspace with no object behind it. */
  async pointBeside() {
    const inside = await this.ask(`viewer.view.pageOf(viewer.view.markers.group.children[0].position.clone()
      .set(0.9 * 0.08, 0.9 * 0.06, 0).multiplyScalar(1000))`);
    return inside;
  }

  async press(point) {
    await this.page.mouse.move(point.x, point.y);
    await this.page.mouse.down();
  }
  async dragTo(point, steps = 12) {
    await this.page.mouse.move(point.x, point.y, { steps });
  }
  async release() {
    await this.page.mouse.up();
  }

  /** Holds the hand still in free space beside the objects. */
  async holdInAir() {
    await this.press(await this.pointBeside());
    await this.release();
    await this.until("the hand is in the air", () =>
      this.ask(
        "viewer.hand.held && viewer.tick.object === -1 && Math.hypot(...viewer.tick.velocity) < 0.002",
      ),
    );
  }

  async letGo() {
    await this.page.keyboard.press("l");
    await this.until("the hand is free", async () => !(await this.ask("viewer.hand.held")));
  }

  /** Drops files, given by name and content, onto the page. */
  async drop(files) {
    await this.page.evaluate((list) => {
      const data = new DataTransfer();
      for (const [name, content] of list) data.items.add(new File([content], name));
      document.body.dispatchEvent(
        new DragEvent("drop", { dataTransfer: data, bubbles: true, cancelable: true }),
      );
    }, Object.entries(files));
  }

  /** Colours [r, g, b] of the drawn scene at points on the page. */
  async pixels(points) {
    return this.page.evaluate((at) => {
      const { view } = globalThis.viewer;
      const box = view.canvas.getBoundingClientRect();
      const copy = document.createElement("canvas");
      copy.width = box.width;
      copy.height = box.height;
      const context = copy.getContext("2d", { willReadFrequently: true });
      view.invalidate();
      view.draw();
      context.drawImage(view.canvas, 0, 0, copy.width, copy.height); // in the same task, before the browser clears the canvas
      return at.map(({ x, y }) =>
        [...context.getImageData(x - box.left, y - box.top, 1, 1).data].slice(0, 3),
      );
    }, points);
  }

  async settle(ms = 600) {
    await pause(ms);
  }
}
