// One side of a VRPN connection: cookie, the names of senders and types of either side, messages by name.
import { COOKIE_BYTES, decodeCookie, encodeCookie } from "./cookie";
import { encodeFrame, FrameStream, type Frame } from "./frame";
import { getText, putText } from "./codec";

const SENDER_DESCRIPTION = -1;
const TYPE_DESCRIPTION = -2;

/** A message before it has a number: its name on the wire, and its payload. */
export interface Outgoing {
  name: string;
  payload: Uint8Array;
}

export interface Incoming {
  name: string;
  device: string;
  time_s: number;
  payload: DataView;
}

/** What describes a number: the length of the name with its NUL, the name, the NUL. */
export function encodeDescription(name: string): Uint8Array {
  const size = new TextEncoder().encode(name).length + 1;
  const view = new DataView(new ArrayBuffer(4 + size));
  view.setInt32(0, size);
  putText(view, 4, name, size);
  return new Uint8Array(view.buffer);
}

export class Endpoint {
  private readonly stream = new FrameStream();
  private readonly peerSenders = new Map<number, string>();
  private readonly peerTypes = new Map<number, string>();
  private readonly senders = new Map<string, number>();
  private readonly types = new Map<string, number>();
  private sequence = 0;
  private version = "";

  constructor(
    private readonly write: (bytes: Uint8Array) => void,
    private readonly receive: (message: Incoming) => void,
    private readonly now_s: () => number = () => Date.now() / 1000,
  ) {}

  /** Sends the cookie; nothing else may go before the peer's has come. */
  open(): void {
    this.write(encodeCookie());
  }

  get connected(): boolean {
    return this.version !== "";
  }

  /** Bytes of the peer, in any pieces. Throws when they are no VRPN. */
  feed(bytes: Uint8Array): void {
    this.stream.push(bytes);
    if (!this.connected) {
      const cookie = this.stream.take(COOKIE_BYTES);
      if (!cookie) return;
      this.version = decodeCookie(cookie);
    }
    for (let frame = this.stream.next(); frame; frame = this.stream.next()) this.handle(frame);
  }

  /** Sends a message of a device, after describing what the peer does not know yet. */
  send(device: string, message: Outgoing): void {
    const sender = this.numberOf(this.senders, device, SENDER_DESCRIPTION);
    const type = this.numberOf(this.types, message.name, TYPE_DESCRIPTION);
    this.writeFrame(sender, type, message.payload);
  }

  private numberOf(table: Map<string, number>, name: string, description: number): number {
    const known = table.get(name);
    if (known !== undefined) return known;
    const number = table.size;
    table.set(name, number);
    this.writeFrame(number, description, encodeDescription(name));
    return number;
  }

  private writeFrame(sender: number, type: number, payload: Uint8Array): void {
    this.write(encodeFrame(this.now_s(), sender, type, this.sequence++, payload));
  }

  private handle(frame: Frame): void {
    if (frame.type === SENDER_DESCRIPTION) this.peerSenders.set(frame.sender, described(frame));
    if (frame.type === TYPE_DESCRIPTION) this.peerTypes.set(frame.sender, described(frame));
    if (frame.type < 0) return;
    const name = this.peerTypes.get(frame.type);
    const device = this.peerSenders.get(frame.sender);
    if (name === undefined || device === undefined) return;
    this.receive({ name, device, time_s: frame.time_s, payload: frame.payload });
  }
}

function described(frame: Frame): string {
  return getText(frame.payload, 4, frame.payload.byteLength - 4);
}
