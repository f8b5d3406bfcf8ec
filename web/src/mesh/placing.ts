// A form for the pose, size and surface of a dropped mesh, with a preview in the scene.
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Euler,
  MathUtils,
  Matrix4,
  Mesh,
  MeshStandardMaterial,
  Quaternion,
  Vector3,
} from "three";
import type { DeviceState, ObjectState, SceneState } from "../state_types";
import { countText, el } from "../panels/dom";
import { matrixPlacing } from "../panels/pose";
import { SurfaceForm } from "../panels/surface";
import type { View } from "../scene3d/view";
import type { Placement } from "./upload";
import type { FileMesh } from "./weld";

const FILL = 0.8;
const NEW_OBJECT = "new";
const NEW_SURFACE = {
  stiffness: 0.8,
  damping: 0.1,
  "static friction": 0.3,
  "dynamic friction": 0.2,
} as const;

export class Placing {
  readonly root = el("form", { className: "placing" });
  private readonly size: HTMLInputElement;
  private readonly position: HTMLInputElement[];
  private readonly rotation: HTMLInputElement[];
  private readonly surface = new SurfaceForm(() => undefined);
  private readonly target = el("select", { ariaLabel: "Target object" });
  private readonly preview: Mesh;
  private readonly centre = new Vector3();
  private readonly extent: number;

  constructor(
    private readonly name: string,
    mesh: FileMesh,
    private readonly view: View,
    device: DeviceState,
    scene: SceneState | undefined,
    next: number,
  ) {
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(mesh.positions, 3));
    geometry.setIndex(new BufferAttribute(mesh.triangles, 1));
    geometry.computeBoundingBox();
    geometry.boundingBox!.getCenter(this.centre);
    const extents = geometry.boundingBox!.getSize(new Vector3());
    this.extent = Math.max(...extents.toArray()) || 1;
    this.preview = new Mesh(
      geometry,
      new MeshStandardMaterial({
        color: "#9c6ade",
        flatShading: true,
        side: DoubleSide,
        transparent: true,
        opacity: 0.7,
      }),
    );
    this.preview.matrixAutoUpdate = false;
    this.preview.frustumCulled = false;

    const { centre, scale } = fit(device, extents);
    this.size = numberInput("Largest extent", tidy(scale * this.extent), "0.001");
    this.position = centre.toArray().map((x, i) => numberInput(`Position ${"xyz"[i]!}`, tidy(x)));
    this.rotation = [0, 1, 2].map((i) => numberInput(`Rotation about ${"xyz"[i]!}, degrees`, 0));
    this.surface.set(NEW_SURFACE, scene?.surface_at_1);
    this.fillTargets(scene?.objects ?? [], next);
    this.root.append(
      el(
        "p",
        {},
        el("strong", {}, name),
        ` ${countText(mesh.positions.length / 3)} vertices, ${countText(mesh.triangles.length / 3)} triangles`,
      ),
      field("Target", this.target),
      field("Size", this.size, "world units"),
      field("Position", ...this.position),
      field("Rotation °", ...this.rotation),
      this.surface.root,
    );
    this.root.addEventListener("input", () => this.show());
    view.add(this.preview);
    this.show();
  }

  /** Where it goes; a new object is the next one at the time of sending. */
  placement(next: { object: number; isNew: boolean }, scene: SceneState | undefined): Placement {
    const to = this.target.value === NEW_OBJECT ? next : { object: Number(this.target.value), isNew: false };
    const present = scene?.objects.find((o) => o.id === to.object);
    const T_world_mesh = this.matrix();
    return {
      ...to,
      name: this.name,
      matrix: (scene ? matrixPlacing(T_world_mesh, present, scene) : T_world_mesh).toArray(),
      surface: this.surface.values(),
    };
  }

  /** The object that it should replace, if that is there no more. */
  removedTarget(objects: ObjectState[]): number | undefined {
    if (this.target.value === NEW_OBJECT) return undefined;
    const id = Number(this.target.value);
    return objects.some((o) => o.id === id) ? undefined : id;
  }

  end(): void {
    this.view.remove(this.preview);
    this.preview.geometry.dispose();
    (this.preview.material as MeshStandardMaterial).dispose();
    this.root.remove();
  }

  private fillTargets(objects: ObjectState[], next: number): void {
    const used = objects.filter((o) => o.triangles > 0);
    this.target.append(el("option", { value: NEW_OBJECT }, `new object ${next}`));
    this.target.append(
      ...used.map((o) => el("option", { value: String(o.id) }, `replace object ${o.id}${o.name ? ` (${o.name})` : ""}`)),
    );
  }

  private matrix(): Matrix4 {
    const value = (input: HTMLInputElement): number => input.valueAsNumber || 0;
    const [x, y, z] = this.rotation.map((t) => MathUtils.degToRad(value(t))) as [number, number, number];
    const scale = Math.max(value(this.size), 1e-9) / this.extent;
    const T = new Matrix4().compose(
      new Vector3(...(this.position.map(value) as [number, number, number])),
      new Quaternion().setFromEuler(new Euler(x, y, z)),
      new Vector3().setScalar(scale),
    );
    return T.multiply(new Matrix4().makeTranslation(this.centre.clone().negate()));
  }

  private show(): void {
    this.preview.matrix.copy(this.matrix());
    this.preview.matrixWorldNeedsUpdate = true;
    this.view.invalidate();
  }
}

/** The centre of the workspace, and the scale at which the extents fill most of it. */
function fit(device: DeviceState, extents: Vector3): { centre: Vector3; scale: number } {
  const min = new Vector3().fromArray(device.workspace_m.min);
  const max = new Vector3().fromArray(device.workspace_m.max);
  const T = new Matrix4().fromArray(device.T_world_device);
  const available = max
    .clone()
    .sub(min)
    .multiplyScalar(FILL * T.getMaxScaleOnAxis());
  // The mesh stands upright in the world, in which the workspace may be turned.
  const axes = new Matrix4().extractRotation(T).elements;
  const along = (i: number): number => [0, 1, 2].reduce((sum, k) => sum + Math.abs(axes[4 * i + k]!) * extents.getComponent(k), 0);
  const scale = Math.min(...[0, 1, 2].map((i) => available.getComponent(i) / Math.max(along(i), 1e-12)));
  return { centre: min.add(max).multiplyScalar(0.5).applyMatrix4(T), scale };
}

const tidy = (x: number): number => Number(x.toPrecision(4));

function numberInput(label: string, value: number, min = ""): HTMLInputElement {
  return el("input", { type: "number", step: "any", min, value: String(value), ariaLabel: label });
}

function field(label: string, ...parts: (Node | string)[]): HTMLElement {
  return el("div", { className: "field" }, el("span", {}, label), ...parts);
}
