// A real `hapticd serve` on free ports, and a test's access to it from outside the page.
import { execFile, spawn } from "node:child_process";
import { createConnection } from "node:net";
import { promisify } from "node:util";
import { bundled } from "./bundled.mjs";

const START_MS = 60_000;

export const pause = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** Waits until `ask` returns a truthy value. The deadline is long, since the machine may be slow. */
export async function until(what, ask, deadline_ms = 30_000) {
  const end = Date.now() + deadline_ms;
  let last;
  do {
    last = await ask();
    if (last) return last;
    await pause(50);
  } while (Date.now() < end);
  throw new Error(`timed out after ${deadline_ms / 1000} s: ${what}`);
}

export class Server {
  static running = new Set();
  log = "";

  /** `hapticd serve`, or `hapticd replay` of a recording. */
  static async start(hapticd, { http = "127.0.0.1:0", more = [], replay = "" } = {}) {
    const server = new Server();
    server.hapticd = hapticd;
    const what = replay ? ["replay", replay] : ["serve", "--allow-no-rt"];
    // No bus, so that no test finds the servers of a real network.
    const env = { ...process.env, DBUS_SYSTEM_BUS_ADDRESS: "unix:path=/nowhere/bus" };
    server.process = spawn(hapticd, [...what, "--listen", "127.0.0.1:0", "--http", http, ...more], { env });
    for (const stream of [server.process.stdout, server.process.stderr])
      stream.on("data", (text) => (server.log += text));
    Server.running.add(server);
    server.ended = new Promise((resolve) => server.process.on("exit", resolve)).then(() => Server.running.delete(server));
    const found = (pattern) =>
      until(`${pattern} in the server's log:\n${server.log}`, () => pattern.exec(server.log)?.[1], START_MS);
    server.vrpn = await found(/listening on ([0-9.]+:[0-9]+)/);
    server.url = await found(/(http:\/\/[0-9.]+:[0-9]+)/);
    return server;
  }

  async stop() {
    this.process.kill("SIGTERM");
    this.process.kill("SIGCONT"); // a test may have suspended it
    await this.ended;
  }

  /** Also those of a test that failed: one that runs keeps the test program alive. */
  static async stopAll() {
    await Promise.all([...Server.running].map((server) => server.stop()));
  }

  /** Sends a mesh with `hapticd touch`; replaces the scene. */
  async touch(mesh) {
    await promisify(execFile)(this.hapticd, [
      "touch",
      mesh,
      "--replace",
      "--server",
      `Phantom@tcp://${this.vrpn}`,
      "--seconds",
      "0.2",
    ]);
  }

  async state() {
    return (await fetch(`${this.url}/api/state`)).json();
  }

  /** A VRPN client over TCP; `send` sends messages made by the page's wire modules. */
  async client() {
    const wire = await bundled("wire/index.ts");
    const [host, port] = this.vrpn.split(":");
    const socket = createConnection({ host, port: Number(port), noDelay: true });
    const endpoint = new wire.Endpoint(
      (bytes) => socket.write(bytes),
      () => {},
    );
    socket.on("data", (bytes) => endpoint.feed(Uint8Array.from(bytes)));
    await new Promise((resolve, reject) => socket.once("connect", resolve).once("error", reject));
    endpoint.open();
    await until("the server's cookie", () => endpoint.connected);
    return {
      wire,
      send: (...messages) => messages.forEach((m) => endpoint.send("Phantom", m)),
      close: () => socket.destroy(),
    };
  }
}
