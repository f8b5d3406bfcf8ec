// Position, rotation and scale of an object that is in the scene, about the centre of its mesh.
import { Euler, MathUtils, Matrix4, Quaternion, Vector3 } from "three";
import { type Outgoing, setTransformMatrix } from "../wire";
import type { ObjectState, SceneState } from "../state_types";
import { el, NumberField } from "./dom";
import { CONFIRM_MS } from "./switch";

/** What placements below a parent depend on. */
export type Frames = Pick<SceneState, "T_world_scene" | "objects">;

/** The parent of objects that have none. */
const SCENE = -1;

/** The matrix below its parent in units of the object, for a placement of the object in the world. */
function localMatrix(T_world_object: Matrix4, parent: Matrix4, worldUnits: number): Matrix4 {
  const local = parent.clone().invert().multiply(T_world_object);
  // The server's matrix takes object units to world units: a client sends it without this factor.
  local.multiply(shrunk(worldUnits));
  const at = new Vector3().setFromMatrixPosition(local).divideScalar(worldUnits);
  return local.setPosition(at);
}

/** The matrix that brings the mesh of this object to this place in the world; undefined: of a new object, in world units. */
export function matrixPlacing(T_world_mesh: Matrix4, o: ObjectState | undefined, frames: Frames): Matrix4 {
  if (!o) return localMatrix(T_world_mesh, new Matrix4().fromArray(frames.T_world_scene), 1);
  const T_world_object = T_world_mesh.clone().multiply(new Matrix4().fromArray(o.T_object_mesh).invert());
  return localMatrix(T_world_object, parentFrame(o, frames), o.world_units);
}

/** Where an object is, for people and for the server. */
export interface Placement {
  /** Position of the mesh's centre in the world, angles about x, y and z in degrees, scale. */
  numbers: number[];
  /** As setTransformMatrix() takes it. */
  T_parent_object: number[];
}

/** `centre`: of the mesh, in its own frame. */
export function placementOf(o: ObjectState, centre: Vector3): Placement {
  const T = new Matrix4().fromArray(o.T_world_object);
  const { rotation, size } = partsOf(T, o.world_units);
  const { x, y, z } = new Euler().setFromQuaternion(rotation);
  const at = inObject(o, centre).applyMatrix4(T);
  return { numbers: [...at.toArray(), ...[x, y, z].map(MathUtils.radToDeg), size], T_parent_object: o.T_parent_object };
}

/** With other numbers: what does not depend on those that differ stays in every bit. */
export function placedAnew(from: Placement, numbers: number[], o: ObjectState, centre: Vector3, frames: Frames): Placement {
  const rotationOf = ([, , , ...degrees]: number[]): Matrix4 => {
    const [x, y, z] = degrees.map(MathUtils.degToRad);
    return new Matrix4().makeRotationFromEuler(new Euler(x, y, z));
  };
  const toWorld = parentFrame(o, frames).setPosition(0, 0, 0);
  const toParent = toWorld.clone().invert();
  const before = new Matrix4().fromArray(from.T_parent_object);
  const at = new Vector3().setFromMatrixPosition(before);
  const linear = before.clone().setPosition(0, 0, 0);
  const after = linear.clone();
  if (numbers.slice(3, 6).some((angle, i) => angle !== from.numbers[3 + i])) {
    const turn = rotationOf(numbers).multiply(rotationOf(from.numbers).transpose());
    after.premultiply(toWorld).premultiply(turn).premultiply(toParent);
  }
  const growth = numbers[6]! / from.numbers[6]!;
  after.scale(new Vector3(growth, growth, growth));
  const shift = new Vector3(...numbers.map((x, i) => x - from.numbers[i]!));
  at.add(shift.applyMatrix4(toParent).divideScalar(o.world_units));
  // Turned and scaled about the centre of the mesh.
  const middle = inObject(o, centre);
  at.add(middle.clone().applyMatrix4(linear).sub(middle.applyMatrix4(after)));
  return { numbers, T_parent_object: after.setPosition(at).toArray() };
}

export class PoseForm {
  readonly root = el("div", { className: "placing" });
  private readonly fields: NumberField[];
  private object: ObjectState | undefined;
  private frames: Frames | undefined;
  private placement: Placement | undefined;
  /** Until then the state of the server may be older than what was sent. */
  private sentUntil_ms = 0;

  constructor(
    private readonly id: number,
    private readonly send: (...messages: Outgoing[]) => void,
    private readonly centreOf: (id: number) => Vector3,
  ) {
    const input = (label: string, min = ""): HTMLInputElement =>
      el("input", { type: "number", step: "any", min, ariaLabel: `${label} of object ${id}` });
    const position = ["x", "y", "z"].map((axis) => input(`Position ${axis}`));
    const rotation = ["x", "y", "z"].map((axis) => input(`Rotation about ${axis}, degrees,`));
    const scale = input("Scale", "0.0001");
    this.fields = [...position, ...rotation, scale].map((each) => new NumberField(each, 5));
    const row = (label: string, ...parts: (Node | string)[]): HTMLElement =>
      el("div", { className: "field" }, el("span", {}, label), ...parts);
    this.root.append(row("Position", ...position), row("Rotation °", ...rotation), row("Scale", scale));
    this.root.addEventListener("change", () => this.place());
  }

  update(o: ObjectState, frames: Frames): void {
    if (performance.now() < this.sentUntil_ms) return;
    this.object = o;
    this.frames = frames;
    this.placement = placementOf(o, this.centreOf(o.id));
    this.fields.forEach((field, i) => field.show(this.placement!.numbers[i]!));
  }

  private place(): void {
    const numbers = this.fields.map((field) => field.value);
    if (!this.object || !this.frames || !this.placement) return;
    if (numbers.some((x) => !Number.isFinite(x)) || numbers[6]! <= 0) return;
    this.placement = placedAnew(this.placement, numbers, this.object, this.centreOf(this.id), this.frames);
    this.send(setTransformMatrix(this.id, this.placement.T_parent_object));
    this.sentUntil_ms = performance.now() + CONFIRM_MS;
  }
}

const shrunk = (worldUnits: number): Matrix4 =>
  new Matrix4().makeScale(1 / worldUnits, 1 / worldUnits, 1 / worldUnits);

/** Below a parent, positions are in the parent's units of the world. */
function parentFrame(o: ObjectState, frames: Frames): Matrix4 {
  if (o.parent === SCENE) return new Matrix4().fromArray(frames.T_world_scene);
  const parent = frames.objects.find((p) => p.id === o.parent);
  return parent ? new Matrix4().fromArray(parent.T_world_object).multiply(shrunk(parent.world_units)) : new Matrix4();
}

/** A point of the mesh in units of the object. */
const inObject = (o: ObjectState, point: Vector3): Vector3 =>
  point.clone().applyMatrix4(new Matrix4().fromArray(o.T_object_mesh));

function partsOf(T: Matrix4, worldUnits: number): { rotation: Quaternion; size: number } {
  const rotation = new Quaternion();
  const stretch = new Vector3();
  T.decompose(new Vector3(), rotation, stretch);
  return { rotation, size: Math.cbrt(Math.abs(stretch.x * stretch.y * stretch.z)) / worldUnits };
}
