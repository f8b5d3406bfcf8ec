// The connection to the server: VRPN over a WebSocket that reconnects when it is lost, and an estimate of the server's clock.
import { Endpoint, type Incoming, type Outgoing, PONG, ping } from "./wire";

export type LinkState = "connecting" | "open" | "lost";

const PING_EVERY_MS = 1000;
/** Intervals of the ping without a byte from the server, after which the connection counts as lost. */
const MOST_SILENT = 3;
/** Intervals until a pong is overdue. */
const PONG_LATE = 3;
/** Intervals until a missing pong alone ends the connection: on a slow network a ping waits behind an upload. */
const MOST_UNANSWERED = 20;
/** Bytes that may wait on their way before a stop takes another one: 0.1 s at 5 Mbit/s. */
const MOST_BACKLOG = 65_536;
const BESIDE_MS = 10_000;
const READ_EVERY_MS = 10;
const RETRY_FIRST_MS = 500;
const RETRY_MAX_MS = 4000;

/** Of times on the wire and of the browser's clock, seconds. */
const ROUNDING_S = 0.001;

/** The wall clock of this machine in seconds; it never jumps. */
const wall_s = (): number => (performance.timeOrigin + performance.now()) / 1000;

/** Estimates how far the server's wall clock is ahead of ours: the ping with the shortest round trip is the most accurate. */
class ServerClock {
  private sent_s = 0;
  private best_s = Infinity;
  private ahead_s = 0;

  /** A pong does not say which ping it answers: one ping at a time. */
  get waits(): boolean {
    return this.sent_s !== 0;
  }
  sent(): void {
    this.sent_s = wall_s();
  }
  onPong(server_s: number): void {
    if (this.sent_s === 0) return;
    const now_s = wall_s();
    const roundTrip_s = now_s - this.sent_s;
    this.best_s *= 1.05; // clocks drift: an old estimate expires
    // Outside the time of this ping only when a clock was set.
    const before_s = this.ahead_s;
    const wasSet = before_s < server_s - now_s - ROUNDING_S || before_s > server_s - this.sent_s + ROUNDING_S;
    if (roundTrip_s <= this.best_s || wasSet) {
      this.best_s = roundTrip_s;
      this.ahead_s = server_s - (now_s + this.sent_s) / 2;
    }
    this.sent_s = 0;
  }
  /** Seconds since a time of the server's clock. */
  age_s(server_s: number): number {
    return Math.max(0, wall_s() + this.ahead_s - server_s);
  }
}

/** Sends to the device and over the connection of one moment, and to no other. */
export interface Channel {
  /** Whether the messages were sent; false once the connection has ended. */
  send(...messages: Outgoing[]): boolean;
  readonly open: boolean;
  /** Bytes queued in the browser. */
  readonly waiting: number;
  /** Resolves once the server has read what was sent until now, and its texts about it have come; or once the connection has ended. */
  read(): Promise<void>;
}

function newSocket(): WebSocket {
  const scheme = location.protocol === "https:" ? "wss" : "ws";
  const socket = new WebSocket(`${scheme}://${location.host}/vrpn`);
  socket.binaryType = "arraybuffer";
  return socket;
}

export class Link {
  state: LinkState = "connecting";
  /** To which everything is sent; empty before the first connection. */
  device = "";
  private socket: WebSocket | undefined;
  private peer: Endpoint | undefined;
  private clock = new ServerClock();
  private pingTimer = 0;
  // Counted in ticks of the timer, which a page that was busy or asleep misses: then the answers are only unread.
  private silentTicks = 0;
  private unansweredTicks = 0;
  /** Names of messages that could not be read, and of which the console has been told. */
  private readonly unreadable = new Set<string>();
  private retry_ms = RETRY_FIRST_MS;
  /** Bytes that were sent, and those of them of which a pong says that the server has read them. */
  private sent = 0;
  private sentAtPing = 0;
  private sentAtPong = 0;
  /** The connections of stops, by device, until the server has read them. */
  private readonly beside = new Map<string, Endpoint>();

  constructor(
    private readonly onState: (state: LinkState) => void,
    private readonly onMessage: (message: Incoming, age_s: number) => void,
    /** What each connection sends first. */
    private readonly greeting: () => Outgoing[] = () => [],
  ) {}

  /** Connects as a client of this device, and reconnects when the connection is lost. */
  connect(device: string): void {
    this.device = device;
    const socket = newSocket();
    const clock = new ServerClock();
    this.sent = this.sentAtPing = this.sentAtPong = 0;
    const peer = new Endpoint(
      (bytes) => {
        this.sent += bytes.length;
        socket.send(bytes as Uint8Array<ArrayBuffer>);
      },
      (message) => {
        if (message.name === PONG) {
          clock.onPong(message.time_s);
          this.unansweredTicks = 0;
          this.sentAtPong = this.sentAtPing;
        }
        this.read(message, clock.age_s(message.time_s));
      },
    );
    this.socket = socket;
    this.peer = peer;
    this.clock = clock;
    socket.onopen = () => peer.open();
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => this.feed(peer, new Uint8Array(event.data));
    socket.onclose = () => this.lost(peer);
  }

  /** The server has not answered for seconds: what is sent may not reach it. */
  get unanswered(): boolean {
    return this.state === "open" && this.unansweredTicks >= PONG_LATE;
  }

  /** Whether the messages were sent; false while not connected. */
  send(...messages: Outgoing[]): boolean {
    return this.channel().send(...messages);
  }

  /** A stop. Behind an upload it would wait for a slow network: then it goes on a connection of its own, too. */
  sendAtOnce(message: Outgoing): boolean {
    const sent = this.send(message);
    if (sent && this.sent - this.sentAtPong > MOST_BACKLOG) this.sendBeside(message);
    return sent;
  }

  private sendBeside(message: Outgoing): void {
    const { device } = this;
    if (this.beside.has(device)) return; // its stop is on its way
    const socket = newSocket();
    const peer = new Endpoint(
      (bytes) => socket.send(bytes as Uint8Array<ArrayBuffer>),
      ({ name }) => name === PONG && end(),
    );
    const end = (): void => {
      if (this.beside.get(device) === peer) this.beside.delete(device);
      socket.close();
    };
    this.beside.set(device, peer);
    socket.onopen = () => peer.open();
    socket.onmessage = (event: MessageEvent<ArrayBuffer>) => {
      const greeted = peer.connected;
      peer.feed(new Uint8Array(event.data));
      if (greeted || !peer.connected) return;
      for (const each of [...this.greeting(), message, ping()]) peer.send(device, each);
    };
    socket.onclose = end;
    window.setTimeout(end, BESIDE_MS);
  }

  /** For what takes several turns: another device or a new connection does not get the rest of it. */
  channel(): Channel {
    const link = this;
    const { socket, peer, device } = this;
    return {
      send(...messages) {
        if (!this.open) return false;
        for (const message of messages) peer!.send(device, message);
        return true;
      },
      // A socket that is closing discards what it is given, without an error.
      get open() {
        return link.state === "open" && peer !== undefined && peer === link.peer && socket!.readyState === WebSocket.OPEN;
      },
      get waiting() {
        return socket?.bufferedAmount ?? 0;
      },
      async read() {
        const { sent } = link;
        while (this.open && link.sentAtPong < sent) {
          if (!link.clock.waits) link.ping();
          await new Promise((resolve) => setTimeout(resolve, READ_EVERY_MS));
        }
      },
    };
  }

  /** Switches to another device of the same server. */
  use(device: string): void {
    this.device = device;
  }

  // A message of another version, say. The connection stays, and with it the stop.
  private read(message: Incoming, age_s: number): void {
    try {
      this.onMessage(message, age_s);
    } catch (error) {
      if (!this.unreadable.has(message.name)) console.warn(`left out ${message.name}: ${String(error)}`);
      this.unreadable.add(message.name);
    }
  }

  private feed(peer: Endpoint, bytes: Uint8Array): void {
    if (peer !== this.peer) return;
    this.silentTicks = 0;
    try {
      peer.feed(bytes);
    } catch (error) {
      return this.end(peer, String(error));
    }
    if (this.state !== "open" && peer.connected) this.opened(peer);
  }

  private end(peer: Endpoint, why: string): void {
    console.warn(`connection ended: ${why}`);
    this.socket?.close();
    this.lost(peer); // the browser reports the end only when the server has agreed
  }

  private opened(peer: Endpoint): void {
    this.retry_ms = RETRY_FIRST_MS;
    for (const message of this.greeting()) this.peer?.send(this.device, message);
    this.setState("open");
    this.silentTicks = 0;
    this.ping();
    this.pingTimer = window.setInterval(() => {
      if (!this.clock.waits) return this.ping();
      ++this.silentTicks;
      ++this.unansweredTicks;
      // A network may drop a connection without an end, for example behind a NAT or a VPN.
      if (this.silentTicks >= MOST_SILENT || this.unansweredTicks >= MOST_UNANSWERED)
        this.end(peer, "the server does not answer");
    }, PING_EVERY_MS);
  }

  private ping(): void {
    this.unansweredTicks = 0;
    this.clock.sent();
    this.send(ping());
    this.sentAtPing = this.sent;
  }

  private lost(peer: Endpoint): void {
    if (peer !== this.peer) return;
    this.peer = undefined;
    window.clearInterval(this.pingTimer);
    this.setState("lost");
    window.setTimeout(() => this.connect(this.device), this.retry_ms);
    this.retry_ms = Math.min(2 * this.retry_ms, RETRY_MAX_MS);
  }

  private setState(state: LinkState): void {
    if (state === this.state) return;
    this.state = state;
    this.onState(state);
  }
}
