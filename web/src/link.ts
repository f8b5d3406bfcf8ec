// The connection to the server: VRPN over a WebSocket, opened again when it is lost, and the clock of the other side.
import { Endpoint, type Incoming, type Outgoing, PONG, ping } from "./wire";

export type LinkState = "connecting" | "open" | "lost";

const PING_EVERY_MS = 1000;
const RETRY_FIRST_MS = 500;
const RETRY_MOST_MS = 4000;

/** The wall clock of this machine, in seconds, without jumps. */
const wall_s = (): number => (performance.timeOrigin + performance.now()) / 1000;

/** How far the server's wall clock is ahead of ours: the answer with the shortest way there and back says it best. */
class Clock {
  private sent_s = 0;
  private best_s = Infinity;
  private ahead_s = 0;

  sent(): void {
    this.sent_s = wall_s();
  }
  answered(theirs_s: number): void {
    if (this.sent_s === 0) return;
    const now_s = wall_s();
    const way_s = now_s - this.sent_s;
    this.best_s *= 1.05; // an old best fades, as clocks drift
    if (way_s <= this.best_s) {
      this.best_s = way_s;
      this.ahead_s = theirs_s - (now_s + this.sent_s) / 2;
    }
    this.sent_s = 0;
  }
  /** How long ago that was, by the server's clock. */
  age_s(theirs_s: number): number {
    return Math.max(0, wall_s() + this.ahead_s - theirs_s);
  }
}

export class Link {
  state: LinkState = "connecting";
  private socket: WebSocket | undefined;
  private endpoint: Endpoint | undefined;
  private clock = new Clock();
  private device = "";
  private pingTimer = 0;
  private retry_ms = RETRY_FIRST_MS;

  constructor(
    private readonly onState: (state: LinkState) => void,
    private readonly onMessage: (message: Incoming, age_s: number) => void,
  ) {}

  /** Connects, and stays connected as a client of this device. */
  connect(device: string): void {
    this.device = device;
    const scheme = location.protocol === "https:" ? "wss" : "ws";
    const socket = new WebSocket(`${scheme}://${location.host}/vrpn`);
    socket.binaryType = "arraybuffer";
    const clock = new Clock();
    const endpoint = new Endpoint(
      (bytes) => socket.send(bytes as Uint8Array<ArrayBuffer>),
      (message) => {
        if (message.name === PONG) clock.answered(message.time_s);
        this.onMessage(message, clock.age_s(message.time_s));
      },
    );
    this.socket = socket;
    this.endpoint = endpoint;
    this.clock = clock;
    socket.onopen = () => endpoint.open();
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.feed(endpoint, new Uint8Array(event.data));
    socket.onclose = () => this.lost();
  }

  /** Whether it left: not while there is no connection. */
  send(...messages: Outgoing[]): boolean {
    if (this.state !== "open" || !this.endpoint) return false;
    for (const message of messages) this.endpoint.send(this.device, message);
    return true;
  }

  /** Bytes that wait to leave this machine. */
  get waiting(): number {
    return this.socket?.bufferedAmount ?? 0;
  }

  /** Another device of the same server. */
  use(device: string): void {
    this.device = device;
  }

  private feed(endpoint: Endpoint, bytes: Uint8Array): void {
    try {
      endpoint.feed(bytes);
    } catch (error) {
      console.warn(`connection ended: ${String(error)}`);
      this.socket?.close();
      return;
    }
    if (this.state !== "open" && endpoint.connected) this.opened();
  }

  private opened(): void {
    this.retry_ms = RETRY_FIRST_MS;
    this.setState("open");
    const ask = (): void => {
      this.clock.sent();
      this.send(ping());
    };
    ask();
    this.pingTimer = window.setInterval(ask, PING_EVERY_MS);
  }

  private lost(): void {
    window.clearInterval(this.pingTimer);
    this.setState("lost");
    window.setTimeout(() => this.connect(this.device), this.retry_ms);
    this.retry_ms = Math.min(2 * this.retry_ms, RETRY_MOST_MS);
  }

  private setState(state: LinkState): void {
    if (state === this.state) return;
    this.state = state;
    this.onState(state);
  }
}
