// Position, rotation and scale of an object that is in the scene, about the centre of its mesh.
import { Euler, MathUtils, Matrix4, Quaternion, Vector3 } from "three";
import { type Outgoing, setTransformMatrix } from "../wire";
import type { ObjectState, SceneState } from "../state_types";
import { el } from "./dom";

/** What placements below a parent depend on. */
export type Frames = Pick<SceneState, "T_world_scene" | "objects">;

/** The parent of objects that have none. */
const SCENE = -1;

const tidy = (x: number): string => String(Number(x.toPrecision(5)) + 0);

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

export class PoseForm {
  readonly root = el("div", { className: "placing" });
  private readonly position: HTMLInputElement[];
  private readonly rotation: HTMLInputElement[];
  private readonly scale: HTMLInputElement;
  private object: ObjectState | undefined;
  private parent = new Matrix4();
  private centre = new Vector3();

  constructor(
    private readonly id: number,
    private readonly send: (...messages: Outgoing[]) => void,
    private readonly centreOf: (id: number) => Vector3,
  ) {
    const input = (label: string, min = ""): HTMLInputElement =>
      el("input", { type: "number", step: "any", min, ariaLabel: `${label} of object ${id}` });
    this.position = ["x", "y", "z"].map((axis) => input(`Position ${axis}`));
    this.rotation = ["x", "y", "z"].map((axis) => input(`Rotation about ${axis}, degrees,`));
    this.scale = input("Scale", "0.0001");
    const field = (label: string, ...parts: (Node | string)[]): HTMLElement =>
      el("div", { className: "field" }, el("span", {}, label), ...parts);
    this.root.append(field("Position", ...this.position), field("Rotation °", ...this.rotation), field("Scale", this.scale));
    this.root.addEventListener("change", () => this.place());
  }

  /** Shows the placement, unless a field is being edited. */
  update(o: ObjectState, frames: Frames): void {
    if (this.root.contains(document.activeElement) && this.object) return;
    this.object = o;
    this.parent = parentFrame(o, frames);
    this.centre = this.centreOf(o.id).applyMatrix4(new Matrix4().fromArray(o.T_object_mesh));
    const T = new Matrix4().fromArray(o.T_world_object);
    const { rotation, size } = partsOf(T, o.world_units);
    const at = this.centre.clone().applyMatrix4(T);
    const angles = new Euler().setFromQuaternion(rotation);
    at.toArray().forEach((x, i) => (this.position[i]!.value = tidy(x)));
    [angles.x, angles.y, angles.z].forEach((a, i) => (this.rotation[i]!.value = tidy(MathUtils.radToDeg(a))));
    this.scale.value = tidy(size);
  }

  private place(): void {
    const o = this.object;
    const numbers = [...this.position, ...this.rotation, this.scale].map((i) => i.valueAsNumber);
    if (!o || numbers.some((x) => !Number.isFinite(x)) || this.scale.valueAsNumber <= 0) return;
    const T = new Matrix4().fromArray(o.T_world_object);
    const { stretch, size } = partsOf(T, o.world_units);
    const angles = this.rotation.map((i) => MathUtils.degToRad(i.valueAsNumber));
    const rotation = new Quaternion().setFromEuler(new Euler(angles[0], angles[1], angles[2]));
    const moved = new Matrix4()
      .compose(new Vector3(), rotation, stretch.multiplyScalar(this.scale.valueAsNumber / size))
      .multiply(new Matrix4().makeTranslation(this.centre.clone().negate()));
    const at = new Vector3(...this.position.map((i) => i.valueAsNumber));
    moved.premultiply(new Matrix4().makeTranslation(at));
    this.send(setTransformMatrix(this.id, localMatrix(moved, this.parent, o.world_units).toArray()));
    this.object = { ...o, T_world_object: moved.toArray() };
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

function partsOf(T: Matrix4, worldUnits: number): { rotation: Quaternion; stretch: Vector3; size: number } {
  const rotation = new Quaternion();
  const stretch = new Vector3();
  T.decompose(new Vector3(), rotation, stretch);
  return { rotation, stretch, size: Math.cbrt(Math.abs(stretch.x * stretch.y * stretch.z)) / worldUnits };
}
