// Payloads: big-endian numbers and text, one field behind the other without alignment. The layouts are in messages.ts.
import type { Outgoing } from "./peer";

const NUMBERS = {
  u8: { bytes: 1, get: (v: DataView, at: number) => v.getUint8(at), set: (v: DataView, at: number, x: number) => v.setUint8(at, x) },
  i16: { bytes: 2, get: (v: DataView, at: number) => v.getInt16(at), set: (v: DataView, at: number, x: number) => v.setInt16(at, x) },
  i32: { bytes: 4, get: (v: DataView, at: number) => v.getInt32(at), set: (v: DataView, at: number, x: number) => v.setInt32(at, x) },
  u32: { bytes: 4, get: (v: DataView, at: number) => v.getUint32(at), set: (v: DataView, at: number, x: number) => v.setUint32(at, x) },
  // 64 bits are numbers in TypeScript: exact up to 2^53.
  i64: { bytes: 8, get: (v: DataView, at: number) => Number(v.getBigInt64(at)), set: (v: DataView, at: number, x: number) => v.setBigInt64(at, BigInt(x)) },
  u64: { bytes: 8, get: (v: DataView, at: number) => Number(v.getBigUint64(at)), set: (v: DataView, at: number, x: number) => v.setBigUint64(at, BigInt(x)) },
  f32: { bytes: 4, get: (v: DataView, at: number) => v.getFloat32(at), set: (v: DataView, at: number, x: number) => v.setFloat32(at, x) },
  f64: { bytes: 8, get: (v: DataView, at: number) => v.getFloat64(at), set: (v: DataView, at: number, x: number) => v.setFloat64(at, x) },
};
export type NumberType = keyof typeof NUMBERS;

/** A number, a fixed number of them, text of a fixed size, or a list with its length in front. */
export type FieldLayout =
  | readonly [name: string, type: NumberType]
  | readonly [name: string, type: NumberType, count: number]
  | readonly [name: string, form: "name" | "text", bytes: number]
  | readonly [name: string, form: "list", countType: NumberType, type: NumberType, most: number];

/** One message of the wire. */
export interface MessageType<Fields> {
  /** Its name on the wire. */
  readonly name: string;
  /** Throws an Error for text or lists that are too long. */
  encode(fields: Fields): Outgoing;
  /** Throws an Error when the length of the payload, or of the list in it, is wrong. */
  decode(payload: DataView): Fields;
}

function putNumbers(view: DataView, at: number, type: NumberType, values: ArrayLike<number>): number {
  const { bytes, set } = NUMBERS[type];
  for (let i = 0; i < values.length; ++i) set(view, at + i * bytes, values[i]!);
  return at + values.length * bytes;
}

function getNumbers(view: DataView, at: number, type: NumberType, count: number): number[] {
  const { bytes, get } = NUMBERS[type];
  return Array.from({ length: count }, (_, i) => get(view, at + i * bytes));
}

/** Text in `bytes` bytes, the rest NULs; a text (unlike a name) always ends in a NUL. */
export function putText(view: DataView, at: number, value: string, bytes: number, most = bytes): void {
  const encoded = new TextEncoder().encode(value);
  if (encoded.length > most) throw new Error(`"${value}" is longer than ${most} bytes`);
  new Uint8Array(view.buffer, view.byteOffset + at, bytes).set(encoded);
}

/** Text up to its first NUL, at most `bytes` bytes. */
export function getText(view: DataView, at: number, bytes: number): string {
  const all = new Uint8Array(view.buffer, view.byteOffset + at, bytes);
  const end = all.indexOf(0);
  return new TextDecoder().decode(end < 0 ? all : all.subarray(0, end));
}

/** Bytes of a field; of a list, those of its length. */
function fixedBytes(field: FieldLayout): number {
  if (field[1] === "name" || field[1] === "text") return field[2];
  if (field[1] === "list") return NUMBERS[field[2]].bytes;
  return NUMBERS[field[1]].bytes * (field[2] ?? 1);
}

/** Encoder and decoder of a message with these fields. */
export function define<Fields extends object>(
  name: string,
  layout: readonly FieldLayout[],
): MessageType<Fields> {
  const smallest = layout.reduce((sum, field) => sum + fixedBytes(field), 0);
  const last = layout[layout.length - 1];
  const list = last?.[1] === "list" ? last : undefined;

  const encode = (fields: Fields): Outgoing => {
    const values = fields as Record<string, unknown>;
    const inList = list ? (values[list[0]] as ArrayLike<number>).length : 0;
    if (list && inList > list[4]) throw new Error(`${name}: ${list[0]} has ${inList} values, at most ${list[4]}`);
    const view = new DataView(new ArrayBuffer(smallest + (list ? inList * NUMBERS[list[3]].bytes : 0)));
    let at = 0;
    for (const field of layout) {
      const value = values[field[0]];
      if (field[1] === "name") putText(view, at, value as string, field[2]);
      else if (field[1] === "text") putText(view, at, value as string, field[2], field[2] - 1);
      else if (field[1] === "list")
        putNumbers(view, putNumbers(view, at, field[2], [inList]), field[3], value as ArrayLike<number>);
      else if (field[2] === undefined) putNumbers(view, at, field[1], [value as number]);
      else {
        const numbers = value as ArrayLike<number>;
        if (numbers.length !== field[2])
          throw new Error(`${name}: ${field[0]} has ${numbers.length} values, expected ${field[2]}`);
        putNumbers(view, at, field[1], numbers);
      }
      at += fixedBytes(field);
    }
    return { name, payload: new Uint8Array(view.buffer) };
  };

  const decode = (payload: DataView): Fields => {
    const size = payload.byteLength;
    if (list ? size < smallest : size !== smallest)
      throw new Error(`${name}: payload of ${size} bytes, expected ${list ? "at least " : ""}${smallest}`);
    const values: Record<string, unknown> = {};
    let at = 0;
    for (const field of layout) {
      if (field[1] === "name" || field[1] === "text") values[field[0]] = getText(payload, at, field[2]);
      else if (field[1] === "list") {
        const count = NUMBERS[field[2]].get(payload, at);
        const room = Math.floor((size - smallest) / NUMBERS[field[3]].bytes);
        if (!(Number.isInteger(count) && count >= 0 && count <= Math.min(room, field[4])))
          throw new Error(`${name}: ${field[0]} counts ${count} values, room for ${room}, at most ${field[4]}`);
        values[field[0]] = getNumbers(payload, smallest, field[3], count);
      } else if (field[2] === undefined) values[field[0]] = NUMBERS[field[1]].get(payload, at);
      else values[field[0]] = getNumbers(payload, at, field[1], field[2]);
      at += fixedBytes(field);
    }
    return values as Fields;
  };

  return { name, encode, decode };
}
