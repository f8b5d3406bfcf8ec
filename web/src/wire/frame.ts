// Frames: a header of 24 bytes, a payload, padding to a multiple of 8.

export const HEADER_BYTES = 24;
const MOST_BYTES = 64024;

export interface Frame {
  time_s: number;
  sender: number;
  type: number;
  payload: DataView;
}

const padded = (bytes: number): number => (bytes + 7) & ~7;

export function encodeFrame(
  time_s: number,
  sender: number,
  type: number,
  sequence: number,
  payload: Uint8Array,
): Uint8Array {
  const length = HEADER_BYTES + payload.length;
  if (length > MOST_BYTES) throw new Error(`a frame of ${length} bytes, at most ${MOST_BYTES}`);
  const bytes = new Uint8Array(padded(length));
  const view = new DataView(bytes.buffer);
  view.setUint32(0, length);
  view.setUint32(4, Math.floor(time_s));
  view.setUint32(8, Math.floor((time_s % 1) * 1e6));
  view.setInt32(12, sender);
  view.setInt32(16, type);
  view.setUint32(20, sequence);
  bytes.set(payload, HEADER_BYTES);
  return bytes;
}

/** Cuts a stream, in whatever pieces it comes, into units: first one of a fixed size, then frames. */
export class FrameStream {
  private rest = new Uint8Array(0);

  push(piece: Uint8Array): void {
    if (this.rest.length === 0) {
      this.rest = piece as Uint8Array<ArrayBuffer>;
      return;
    }
    const joined = new Uint8Array(this.rest.length + piece.length);
    joined.set(this.rest);
    joined.set(piece, this.rest.length);
    this.rest = joined;
  }

  /** That many bytes from the front, or nothing yet. */
  take(bytes: number): Uint8Array | undefined {
    if (this.rest.length < bytes) return undefined;
    const front = this.rest.subarray(0, bytes);
    this.rest = this.rest.subarray(bytes);
    return front;
  }

  /** The next whole frame, or nothing yet; throws when the length cannot be. */
  next(): Frame | undefined {
    if (this.rest.length < 4) return undefined;
    const length = new DataView(this.rest.buffer, this.rest.byteOffset).getUint32(0);
    if (length < HEADER_BYTES || length > MOST_BYTES)
      throw new Error(`a frame that says it has ${length} bytes`);
    const bytes = this.take(padded(length));
    if (!bytes) return undefined;
    const view = new DataView(bytes.buffer, bytes.byteOffset, length);
    return {
      time_s: view.getUint32(4) + view.getUint32(8) / 1e6,
      sender: view.getInt32(12),
      type: view.getInt32(16),
      payload: new DataView(bytes.buffer, bytes.byteOffset + HEADER_BYTES, length - HEADER_BYTES),
    };
  }
}
