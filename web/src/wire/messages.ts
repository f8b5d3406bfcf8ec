// The messages that the page sends and reads; docs/wire-messages.md has every byte of them.
import { Reader, Writer } from "./bytes";
import type { Outgoing } from "./peer";

export type Vec3 = [number, number, number];

const EMPTY = new Uint8Array(0);
/** Vertices or triangles in one message at most: 60,000 bytes. */
export const MOST_IN_ONE_MESSAGE = 5000;

export const PONG = "vrpn_Base pong_message";
export const TEXT = "vrpn_Base text_message";
export const TICK = "hapticd Tick";
export const CONTACTS = "hapticd Contacts";
export const GUARD_STATE = "hapticd Guard_State";

export const ping = (): Outgoing => ({ name: "vrpn_Base ping_message", payload: EMPTY });
export const stopForces = (): Outgoing => ({ name: "hapticd Stop_Forces", payload: EMPTY });
export const rearmForces = (): Outgoing => ({ name: "hapticd Rearm_Forces", payload: EMPTY });
export const batchBegin = (): Outgoing => ({ name: "hapticd Batch_Begin", payload: EMPTY });
export const batchCommit = (): Outgoing => ({ name: "hapticd Batch_Commit", payload: EMPTY });

/** Kinds of reports: buttons, ticks, contacts. */
export const REPORT_BUTTON = 4;
export const REPORT_TICK = 16;
export const REPORT_CONTACTS = 32;
export function subscribe(kinds: number, rate_Hz: number): Outgoing {
  return { name: "hapticd Subscribe", payload: new Writer(12).u32(kinds).f64(rate_Hz).bytes() };
}

/** Position in world units; orientation x y z w. */
export function holdHand(hold: boolean, position: Vec3, orientation: ArrayLike<number>): Outgoing {
  const payload = new Writer(62)
    .i16(hold ? 1 : 0)
    .f64s(position)
    .f64s(orientation)
    .u32(0)
    .bytes();
  return { name: "hapticd Hold_Hand", payload };
}

export function meshVertices(object: number, first: number, positions: Float32Array): Outgoing {
  const writer = new Writer(12 + 4 * positions.length).i32(object).i32(first).i32(positions.length);
  for (const value of positions) writer.f32(value);
  return { name: "hapticd Mesh_Vertices", payload: writer.bytes() };
}

export function meshTriangles(object: number, first: number, vertices: Uint32Array): Outgoing {
  const writer = new Writer(12 + 4 * vertices.length).i32(object).i32(first).i32(vertices.length);
  for (const value of vertices) writer.i32(value);
  return { name: "hapticd Mesh_Triangles", payload: writer.bytes() };
}

function withNumber(name: string, number: number): Outgoing {
  return { name: `vrpn_ForceDevice ${name}`, payload: new Writer(4).i32(number).bytes() };
}
export const setObjectNumber = (count: number): Outgoing => withNumber("setObjectNumber", count);
export const clearTrimesh = (object: number): Outgoing => withNumber("clearTrimesh", object);
export const startEffect = (index: number): Outgoing => withNumber("startEffect", index);
export const stopEffect = (index: number): Outgoing => withNumber("stopEffect", index);

/** A column-major matrix of 16. */
export function setTransformMatrix(object: number, matrix: ArrayLike<number>): Outgoing {
  return {
    name: "vrpn_ForceDevice setTransformMatrix",
    payload: new Writer(132).i32(object).f64s(matrix).bytes(),
  };
}

export type SurfaceProperty = "stiffness" | "damping" | "static friction" | "dynamic friction" | "popthrough";
/** The value from 0 to 1. */
export function setHapticProperty(object: number, property: SurfaceProperty, value: number): Outgoing {
  const payload = new Writer(28).i32(object).text(property, 20).f32(value).bytes();
  return { name: "vrpn_ForceDevice setHapticProperty", payload };
}

export function setObjectIsTouchable(object: number, touchable: boolean): Outgoing {
  const payload = new Writer(6)
    .i32(object)
    .i16(touchable ? 1 : 0)
    .bytes();
  return { name: "vrpn_ForceDevice setObjectIsTouchable", payload };
}

export interface Effect {
  type: string;
  index: number;
  gain: number;
  magnitude_N: number;
  duration_ms: number;
  frequency: number;
  position: Vec3;
  direction: Vec3;
}

export function setEffect(e: Effect): Outgoing {
  const writer = new Writer(104)
    .text(e.type, 20)
    .i32(e.index)
    .f64(e.gain)
    .f64(e.magnitude_N)
    .f64(e.duration_ms);
  return {
    name: "vrpn_ForceDevice Effect",
    payload: writer.f64(e.frequency).f64s(e.position).f64s(e.direction).bytes(),
  };
}

/** One servo tick. Lengths in world units / 1000. */
export interface Tick {
  tick: number;
  time_ns: number;
  revision: number;
  hand: Vec3;
  proxy: Vec3;
  velocity: Vec3;
  orientation: [number, number, number, number];
  force_N: Vec3;
  depth: number;
  object: number;
  buttons: number;
  guardActive: number;
  guardLatched: number;
}

export function decodeTick(payload: DataView): Tick {
  const r = new Reader(payload);
  return {
    tick: r.u64(),
    time_ns: r.i64(),
    revision: r.u64(),
    hand: r.f64x3(),
    proxy: r.f64x3(),
    velocity: r.f64x3(),
    orientation: r.f64x4(),
    force_N: r.f64x3(),
    depth: r.f64(),
    object: r.i32(),
    buttons: r.u32(),
    guardActive: r.u32(),
    guardLatched: r.u32(),
  };
}

export interface Contact {
  object: number;
  point: Vec3;
  normal: Vec3;
  force_N: Vec3;
}

export function decodeContacts(payload: DataView): Contact[] {
  const r = new Reader(payload);
  r.u64();
  r.i64();
  const count = r.i32() / 10;
  const contacts: Contact[] = [];
  for (let i = 0; i < count; ++i)
    contacts.push({ object: r.f64(), point: r.f64x3(), normal: r.f64x3(), force_N: r.f64x3() });
  return contacts;
}

export interface GuardState {
  active: number;
  latched: number;
  armed: boolean;
  stopped: boolean;
}

export function decodeGuardState(payload: DataView): GuardState {
  const r = new Reader(payload);
  return { active: r.u32(), latched: r.u32(), armed: r.i16() !== 0, stopped: r.i16() !== 0 };
}

export interface ServerText {
  severity: number;
  /** A refusal code of the server, 0 in other texts. */
  level: number;
  text: string;
}

export function decodeText(payload: DataView): ServerText {
  const r = new Reader(payload);
  return { severity: r.u32(), level: r.u32(), text: r.text(1024) };
}
