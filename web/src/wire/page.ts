// The messages that the page sends and reads, in the page's own terms.
import * as m from "./messages";
import type { Vec3, Vec4 } from "./messages";
import type { Outgoing } from "./peer";

export { MOST_IN_ONE_MESSAGE, REPORT_BUTTON, REPORT_CONTACTS, REPORT_HAND, REPORT_POSES, REPORT_TICK } from "./messages";
export type { Vec3 } from "./messages";

export const PONG = m.Pong.name;
export const TEXT = m.Text.name;
export const TICK = m.TickReport.name;
export const CONTACTS = m.ContactList.name;
export const GUARD_STATE = m.GuardState.name;
export const POSES = m.Poses.name;
export const HAND_STATE = m.HandState.name;
export const MARKER = m.Marker.name;

const flag = (value: boolean): number => (value ? 1 : 0);

export const ping = (): Outgoing => m.Ping.encode({});
/** The key is that of the page, by which the server knows its connections. */
export const identify = (token: string, key: number): Outgoing => m.Identify.encode({ token, key });
export const stopForces = (): Outgoing => m.StopForces.encode({});
export const rearmForces = (): Outgoing => m.RearmForces.encode({});
export const batchBegin = (): Outgoing => m.BatchBegin.encode({});
export const batchCommit = (): Outgoing => m.BatchCommit.encode({});
export const subscribe = (kinds: number, rate_Hz: number): Outgoing =>
  m.Subscribe.encode({ kinds, rate: rate_Hz });

/** Position in world units; orientation x y z w. */
export const holdHand = (hold: boolean, position: Vec3, orientation: ArrayLike<number>): Outgoing =>
  m.HoldHand.encode({ hold: flag(hold), position, orientation: Array.from(orientation) as Vec4, buttons: 0 });

export const meshVertices = (object: number, first: number, positions: Float32Array): Outgoing =>
  m.MeshVertices.encode({ object, first, positions });
export const meshTriangles = (object: number, first: number, vertices: Uint32Array): Outgoing =>
  m.MeshTriangles.encode({ object, first, vertices });

export const setObjectNumber = (count: number): Outgoing => m.SetObjectNumber.encode({ count });
export const clearTrimesh = (object: number): Outgoing => m.ClearTrimesh.encode({ object });
export const startEffect = (index: number): Outgoing => m.StartEffect.encode({ index });
export const stopEffect = (index: number): Outgoing => m.StopEffect.encode({ index });

/** A column-major matrix of 16. */
export const setTransformMatrix = (object: number, matrix: ArrayLike<number>): Outgoing =>
  m.SetTransformMatrix.encode({ object, matrix });

export type SurfaceProperty = "stiffness" | "damping" | "static friction" | "dynamic friction" | "popthrough";
/** The value from 0 to 1. */
export const setHapticProperty = (object: number, property: SurfaceProperty, value: number): Outgoing =>
  m.SetHapticProperty.encode({ object, property, value });

export const setObjectIsTouchable = (object: number, touchable: boolean): Outgoing =>
  m.SetObjectIsTouchable.encode({ object, touchable: flag(touchable) });

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
export const setEffect = ({ magnitude_N: magnitude, duration_ms: duration, ...rest }: Effect): Outgoing =>
  m.Effect.encode({ ...rest, magnitude, duration });

/** One servo tick. Lengths in world units / 1000. */
export interface Tick extends Omit<m.TickReport, "time" | "force"> {
  time_ns: number;
  force_N: Vec3;
}
export function decodeTick(payload: DataView): Tick {
  const { time: time_ns, force: force_N, ...rest } = m.TickReport.decode(payload);
  return { ...rest, time_ns, force_N };
}

export interface Contact {
  object: number;
  point: Vec3;
  normal: Vec3;
  force_N: Vec3;
}
const NUMBERS_OF_A_CONTACT = 10;
export function decodeContacts(payload: DataView): Contact[] {
  const numbers = Array.from(m.ContactList.decode(payload).contacts);
  const contacts: Contact[] = [];
  for (let i = 0; i + NUMBERS_OF_A_CONTACT <= numbers.length; i += NUMBERS_OF_A_CONTACT) {
    const vec3 = (at: number): Vec3 => numbers.slice(i + at, i + at + 3) as Vec3;
    contacts.push({ object: numbers[i]!, point: vec3(1), normal: vec3(4), force_N: vec3(7) });
  }
  return contacts;
}

export interface GuardState {
  active: number;
  latched: number;
  armed: boolean;
  stopped: boolean;
}
export function decodeGuardState(payload: DataView): GuardState {
  const { active, latched, armed, stopped } = m.GuardState.decode(payload);
  return { active, latched, armed: armed !== 0, stopped: stopped !== 0 };
}

/** Severity: 0 normal, 1 warning, 2 error. Level: a refusal code of the server, 0 in other texts. */
export type ServerText = m.Text;
export const decodeText = (payload: DataView): ServerText => m.Text.decode(payload);

const NUMBERS_OF_A_POSE = 13;
/** Column-major matrices of 16, T_world_mesh, by object. */
export function decodePoses(payload: DataView): [object: number, matrix: number[]][] {
  const numbers = m.Poses.decode(payload).poses;
  const poses: [number, number[]][] = [];
  for (let i = 0; i + NUMBERS_OF_A_POSE <= numbers.length; i += NUMBERS_OF_A_POSE) {
    const n = (k: number): number => numbers[i + 1 + k]!;
    poses.push([
      numbers[i]!,
      [n(0), n(1), n(2), 0, n(3), n(4), n(5), 0, n(6), n(7), n(8), 0, n(9), n(10), n(11), 1],
    ]);
  }
  return poses;
}

const NUMBERS_OF_A_REMOTE_CONTACT = 8;
export function decodeRemoteContacts(
  payload: DataView,
): { id: number; proxy: Vec3; force_N: Vec3; depth: number }[] {
  const n = m.HandState.decode(payload).contacts;
  const contacts = [];
  for (let i = 0; i + NUMBERS_OF_A_REMOTE_CONTACT <= n.length; i += NUMBERS_OF_A_REMOTE_CONTACT) {
    const proxy: Vec3 = [n[i + 1]!, n[i + 2]!, n[i + 3]!];
    contacts.push({ id: n[i]!, proxy, force_N: [n[i + 4]!, n[i + 5]!, n[i + 6]!] as Vec3, depth: n[i + 7]! });
  }
  return contacts;
}

/** The beginning of a text that fits in so many bytes; people write longer ones, and in all scripts. */
function beginning(text: string, bytes: number): string {
  const encoder = new TextEncoder();
  if (encoder.encode(text).length <= bytes) return text;
  let fits = "";
  for (const character of text) {
    if (encoder.encode(fits + character).length > bytes) break;
    fits += character;
  }
  return fits;
}

const NAME_BYTES = 64;
const MARK_BYTES = 255;
export const mark = (text: string): Outgoing => m.Marker.encode({ time: 0, text: beginning(text, MARK_BYTES) });
export const decodeMarker = (payload: DataView): m.Marker => m.Marker.decode(payload);
/** As the server has it. */
export const objectName = (text: string): string => beginning(text, NAME_BYTES);
export const setObjectName = (object: number, text: string): Outgoing =>
  m.SetObjectName.encode({ object, text: objectName(text) });
export const removeObject = (object: number): Outgoing => m.RemoveObject.encode({ object });

/** Speed 0 keeps it; a negative position does not seek. */
export const replayControl = (paused: boolean, speed = 0, position_s = -1): Outgoing =>
  m.ReplayControl.encode({ paused: flag(paused), speed, position: position_s });

/** An empty name: by the time. The server answers by a text. */
export const recordingControl = (record: boolean, name = ""): Outgoing =>
  m.RecordingControl.encode({ record: flag(record), name });

/** Stock units: offset in metres, stiffness 1 is 1000 N/m, damping 0.001 is 1 N s/m. */
export const setPlane = (
  index: number,
  plane: [number, number, number, number],
  stiffness: number,
  damping: number,
  staticFriction: number,
  dynamicFriction: number,
): Outgoing =>
  m.Plane.encode({
    plane,
    stiffness,
    damping,
    dynamicFriction,
    staticFriction,
    index,
    recoveryCycles: 100,
  });
export const enableConstraint = (enable: boolean): Outgoing => m.ConstraintEnable.encode({ enable: flag(enable) });
export const setForceField = (origin: Vec3, force: Vec3, jacobian: number[], radius: number): Outgoing =>
  m.ForceField.encode({ origin, force, jacobian, radius });
