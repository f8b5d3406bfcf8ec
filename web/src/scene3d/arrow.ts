// An arrow of any length, thin when it is short.
import { ConeGeometry, CylinderGeometry, Group, Mesh, type MeshStandardMaterial, Vector3 } from "three";

const UP = new Vector3(0, 1, 0);

/** An arrow along +y. */
export class Arrow extends Group {
  private readonly shaft: Mesh;
  private readonly head: Mesh;
  constructor(
    readonly material: MeshStandardMaterial,
    private readonly width: number,
  ) {
    super();
    this.shaft = new Mesh(new CylinderGeometry(1, 1, 1, 12).translate(0, 0.5, 0), material);
    this.head = new Mesh(new ConeGeometry(2.4, 1, 16).translate(0, 0.5, 0), material);
    this.add(this.shaft, this.head);
  }
  point(from: Vector3, direction: Vector3, length: number, unit: number): void {
    const width = Math.min(this.width * unit, length / 10); // a short arrow is thin
    const head = Math.min(5 * width, 0.6 * length);
    this.visible = length > 0;
    this.position.copy(from);
    this.quaternion.setFromUnitVectors(UP, direction);
    this.shaft.scale.set(width, Math.max(length - head, 1e-9), width);
    this.head.scale.set(width, head, width);
    this.head.position.y = length - head;
  }
}
