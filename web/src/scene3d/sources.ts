// What pushes without being an object: planes, force fields, the constraint, effects with a place, remote contacts. And, on
// wish, one arrow per source of force.
import {
  BufferGeometry,
  Color,
  DoubleSide,
  Group,
  LineBasicMaterial,
  LineSegments,
  Mesh,
  MeshBasicMaterial,
  MeshStandardMaterial,
  PlaneGeometry,
  SphereGeometry,
  Vector3,
  Float32BufferAttribute,
} from "three";
import { feltForces, type RemoteContact } from "../sources";
import type { SceneState } from "../state_types";
import type { Contact, Tick } from "../wire";
import { Arrow } from "./arrow";

const MOST_ARROWS = 24;
const FORWARD = new Vector3(0, 0, 1);

/** Disposes the geometries and materials below a group and empties it. */
function empty(group: Group): void {
  group.traverse((node) => {
    if (!(node instanceof Mesh || node instanceof LineSegments)) return;
    (node.geometry as BufferGeometry).dispose();
    (node.material as MeshBasicMaterial).dispose();
  });
  group.clear();
}

export class Sources {
  /** What rests. */
  readonly group = new Group();
  /** What moves with the hand. */
  readonly live = new Group();
  /** Whether an arrow per source is drawn. */
  arrows = false;
  private readonly remote = new Group();
  private readonly ball = new SphereGeometry(1, 16, 12);
  private readonly remoteMaterial = new MeshStandardMaterial({ roughness: 0.6 });
  private readonly arrowMaterial = new MeshStandardMaterial({ roughness: 0.6 });
  private readonly drawn: Arrow[] = [];
  private readonly colour = new Color("#7a5cc0");
  private shown = "";
  private centre = new Vector3();
  private size = 100;

  constructor() {
    for (let i = 0; i < MOST_ARROWS; ++i) {
      const arrow = new Arrow(this.arrowMaterial, 0.004);
      arrow.visible = false;
      this.drawn.push(arrow);
    }
    this.live.add(this.remote, ...this.drawn);
  }

  setColours(source: string, arrow: string): void {
    this.colour.set(source);
    this.remoteMaterial.color.set(source);
    this.arrowMaterial.color.set(arrow);
    this.shown = "";
  }

  /** Centre of the workspace and its largest extent, world units: planes have no end of their own. */
  setPlace(centre: Vector3, size: number): void {
    if (this.centre.equals(centre) && this.size === size) return;
    this.centre.copy(centre);
    this.size = size;
    this.shown = "";
  }

  /** Draws what the scene holds; true when the picture changed. */
  update(scene: SceneState | undefined): boolean {
    const key = JSON.stringify([scene?.planes, scene?.fields, scene?.constraint, scene?.effects.map(placed)]);
    if (key === this.shown) return false;
    this.shown = key;
    empty(this.group);
    for (const p of scene?.planes ?? []) this.addPlane(p.plane, p.stiffness_N_per_m > 0);
    for (const f of scene?.fields ?? []) {
      if (f.radius !== null && f.radius > 0 && f.radius < 20 * this.size)
        this.addBall(new Vector3().fromArray(f.origin), f.radius);
      this.addCross(new Vector3().fromArray(f.origin));
    }
    const c = scene?.constraint;
    if (c) this.addConstraint(c.mode, new Vector3().fromArray(c.point), new Vector3().fromArray(c.direction));
    for (const e of scene?.effects ?? []) if (e.active && e.type === "spring") this.addCross(new Vector3().fromArray(e.position));
    return true;
  }

  /** Nothing is known of remote contacts and forces. */
  hide(): void {
    for (const part of [...this.remote.children, ...this.drawn]) part.visible = false;
  }

  /** Remote contacts of this tick, and the arrows. */
  tick(tick: Tick, contacts: Contact[], remote: RemoteContact[], scene: SceneState | undefined, scale: number, perN: number): void {
    while (this.remote.children.length < remote.length) this.remote.add(new Mesh(this.ball, this.remoteMaterial));
    this.remote.children.forEach((ball, i) => {
      const contact = remote[i];
      ball.visible = contact !== undefined;
      if (contact) ball.position.set(...contact.proxy).multiplyScalar(scale);
      ball.scale.setScalar(0.011 * this.size);
    });
    const forces = this.arrows ? feltForces(tick, contacts, remote, scene, scale) : [];
    this.drawn.forEach((arrow, i) => {
      const force = forces[i];
      const vector = new Vector3(...(force?.force_N ?? [0, 0, 0]));
      const strength = vector.length();
      arrow.point(
        new Vector3(...(force?.at ?? [0, 0, 0])),
        vector.divideScalar(strength || 1),
        strength > 0.005 ? strength * perN : 0,
        this.size,
      );
    });
  }

  private glass(opacity: number): MeshBasicMaterial {
    return new MeshBasicMaterial({ color: this.colour, transparent: true, opacity, side: DoubleSide, depthWrite: false });
  }

  private lines(points: number[]): LineSegments {
    const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
    return new LineSegments(geometry, new LineBasicMaterial({ color: this.colour }));
  }

  // n x + d = 0: a grid around the foot of the workspace's centre. Solid below it.
  private addPlane([a, b, c, d]: number[], felt: boolean): void {
    const normal = new Vector3(a, b, c);
    const length = normal.length();
    if (!(length > 0)) return;
    normal.divideScalar(length);
    const foot = this.centre.clone().addScaledVector(normal, -(normal.dot(this.centre) + d! / length));
    this.addSheet(foot, normal, felt ? 0.22 : 0.07);
  }

  private addSheet(at: Vector3, normal: Vector3, opacity: number): void {
    const half = 0.75 * this.size;
    const sheet = new Mesh(new PlaneGeometry(2 * half, 2 * half), this.glass(opacity));
    const points: number[] = [];
    for (let i = -5; i <= 5; ++i) {
      const at = (i / 5) * half;
      points.push(at, -half, 0, at, half, 0, -half, at, 0, half, at, 0);
    }
    const part = new Group();
    part.add(sheet, this.lines(points));
    part.position.copy(at);
    part.quaternion.setFromUnitVectors(FORWARD, normal);
    this.group.add(part);
  }

  private addBall(at: Vector3, radius: number): void {
    const ball = new Mesh(new SphereGeometry(radius, 24, 16), this.glass(0.14));
    ball.position.copy(at);
    this.group.add(ball);
  }

  private addCross(at: Vector3): void {
    const half = 0.05 * this.size;
    const cross = this.lines([-half, 0, 0, half, 0, 0, 0, -half, 0, 0, half, 0, 0, 0, -half, 0, 0, half]);
    cross.position.copy(at);
    this.group.add(cross);
  }

  private addConstraint(mode: string, point: Vector3, direction: Vector3): void {
    const way = direction.clone().normalize();
    if (mode === "plane" && way.length() > 0) return this.addSheet(point, way, 0.12);
    this.addCross(point);
    if (mode !== "line") return;
    const far = way.multiplyScalar(1.5 * this.size);
    this.group.add(this.lines([...point.clone().sub(far).toArray(), ...point.clone().add(far).toArray()]));
  }
}

const placed = (e: { type: string; active: boolean; position: number[] }): unknown[] =>
  e.active && e.type === "spring" ? e.position : [];
