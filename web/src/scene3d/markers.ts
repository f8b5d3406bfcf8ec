// Markers that move with every tick: HIP, proxy, contact normals, force; and the workspace of the device.
import {
  BoxGeometry,
  BufferAttribute,
  BufferGeometry,
  CircleGeometry,
  DoubleSide,
  EdgesGeometry,
  Group,
  Line,
  LineBasicMaterial,
  LineSegments,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  Quaternion,
  SphereGeometry,
  Vector3,
} from "three";
import type { Contact, Tick, Vec3 } from "../wire";
import type { DeviceState } from "../state_types";
import { Arrow } from "./arrow";

const FORWARD = new Vector3(0, 0, 1);
const MOST_NORMALS = 8;
/** Relative to the largest extent of the workspace. */
const BALL = 0.016;
const NORMAL = 0.12;
const PEAK_FORCE = 0.8;

export interface MarkerColours {
  hip: string;
  proxy: string;
  force: string;
  normal: string;
  box: string;
}

const coloured = (): MeshStandardMaterial => new MeshStandardMaterial({ roughness: 0.6 });

export class Markers {
  readonly group = new Group();
  private readonly hip = new Mesh(
    new SphereGeometry(1, 24, 16),
    new MeshBasicMaterial({ transparent: true, opacity: 0.65, depthTest: false }),
  );
  private readonly proxy = new Mesh(new SphereGeometry(1, 24, 16), coloured());
  private readonly force = new Arrow(coloured(), 0.007);
  /** Below the HIP on the next surface: a cue of depth. */
  private readonly shadow = new Mesh(
    new CircleGeometry(1, 24),
    new MeshBasicMaterial({ color: "#000000", transparent: true, opacity: 0.35, depthWrite: false, side: DoubleSide }),
  );
  private readonly normals: Arrow[] = [];
  private readonly normalMaterial = coloured();
  private readonly spring = new Line(
    new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(6), 3)),
    new LineBasicMaterial({ depthTest: false }),
  );
  private readonly box = new LineSegments(
    new EdgesGeometry(new BoxGeometry(1, 1, 1)),
    new LineBasicMaterial({ transparent: true, opacity: 0.8 }),
  );
  private scale = 1000;
  private size = 100;
  private peak_N = 3.3;

  constructor() {
    for (let i = 0; i < MOST_NORMALS; ++i) this.normals.push(new Arrow(this.normalMaterial, 0.003));
    this.hip.renderOrder = 2;
    this.spring.renderOrder = 1;
    this.spring.frustumCulled = false;
    this.box.matrixAutoUpdate = false;
    this.group.add(this.box, this.shadow, this.spring, this.hip, this.proxy, this.force, ...this.normals);
    this.hide();
  }

  setColours(colours: MarkerColours): void {
    this.hip.material.color.set(colours.hip);
    this.spring.material.color.set(colours.hip);
    this.proxy.material.color.set(colours.proxy);
    this.force.material.color.set(colours.force);
    this.normalMaterial.color.set(colours.normal);
    this.box.material.color.set(colours.box);
  }

  /** Sets the workspace box and the sizes of the markers. */
  setDevice(device: DeviceState): void {
    const min = new Vector3().fromArray(device.workspace_m.min);
    const max = new Vector3().fromArray(device.workspace_m.max);
    const T = new Matrix4().fromArray(device.T_world_device);
    const boxOfUnit = new Matrix4().compose(
      min.clone().add(max).multiplyScalar(0.5),
      new Quaternion(),
      max.clone().sub(min),
    );
    this.box.matrix.multiplyMatrices(T, boxOfUnit);
    this.box.matrixWorldNeedsUpdate = true;
    this.down.set(-T.elements[4]!, -T.elements[5]!, -T.elements[6]!).normalize();
    this.scale = device.world_per_reported;
    this.size = Math.max(...max.sub(min).toArray()) * T.getMaxScaleOnAxis();
    this.peak_N = device.peak_force_N > 0 ? device.peak_force_N : 1;
    this.hip.scale.setScalar(0.6 * BALL * this.size);
    this.proxy.scale.setScalar(BALL * this.size);
  }

  /** World units per newton of arrows. */
  get perNewton(): number {
    return (PEAK_FORCE * this.size) / this.peak_N;
  }

  /** Where the shadow of the HIP falls: a surface, or nowhere. */
  setShadow(at: { point: Vector3; normal: Vector3 } | undefined): void {
    this.shadow.visible = at !== undefined;
    if (!at) return;
    this.shadow.position.copy(at.point).addScaledVector(at.normal, 0.002 * this.size);
    this.shadow.quaternion.setFromUnitVectors(FORWARD, at.normal);
    this.shadow.scale.setScalar(0.8 * BALL * this.size);
  }

  /** Of the device, downwards, unit. */
  readonly down = new Vector3(0, -1, 0);

  /** Converts a reported position to world units. */
  world(position: Vec3): Vector3 {
    return new Vector3(...position).multiplyScalar(this.scale);
  }

  /** Nothing is known of hand and force. */
  hide(): void {
    for (const part of [this.shadow, this.spring, this.hip, this.proxy, this.force, ...this.normals])
      part.visible = false;
  }

  update(tick: Tick, contacts: Contact[]): void {
    const hip = this.world(tick.hand);
    const proxy = this.world(tick.proxy);
    this.hip.visible = this.proxy.visible = this.spring.visible = true;
    this.hip.position.copy(hip);
    this.proxy.position.copy(proxy);
    const ends = this.spring.geometry.getAttribute("position") as BufferAttribute;
    ends.setXYZ(0, ...hip.toArray()).setXYZ(1, ...proxy.toArray());
    ends.needsUpdate = true;
    const force = new Vector3(...tick.force_N);
    const strength = force.length();
    this.force.point(
      proxy,
      force.divideScalar(strength || 1),
      strength > 0.005 ? (PEAK_FORCE * this.size * strength) / this.peak_N : 0,
      this.size,
    );
    this.normals.forEach((arrow, i) => {
      const contact = contacts[i];
      const normal = new Vector3(...(contact?.normal ?? [0, 1, 0]));
      arrow.point(
        contact ? this.world(contact.point) : proxy,
        normal,
        contact ? NORMAL * this.size : 0,
        this.size,
      );
    });
  }
}
