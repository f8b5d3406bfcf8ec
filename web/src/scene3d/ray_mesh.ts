// Where a ray meets a mesh first. Runs of triangles have boxes, so that a pointer can be followed over 100,000 of them
// within a small part of a frame.
import { Matrix4, Ray, Vector3 } from "three";
import type { DisplayMesh } from "../state";

const RUN = 64;

export class RayMesh {
  private readonly boxes: Float32Array;
  private readonly inverse = new Matrix4();
  private readonly local = new Ray();

  constructor(private readonly mesh: DisplayMesh) {
    this.boxes = new Float32Array(6 * Math.ceil(mesh.triangles.length / (3 * RUN)));
    for (let run = 0; run * 6 < this.boxes.length; ++run) this.fillBox(run);
  }

  private fillBox(run: number): void {
    const { positions, triangles } = this.mesh;
    const box = this.boxes
      .subarray(6 * run, 6 * run + 6)
      .fill(Infinity, 0, 3)
      .fill(-Infinity, 3);
    const end = Math.min(triangles.length, 3 * RUN * (run + 1));
    for (let i = 3 * RUN * run; i < end; ++i) {
      for (let axis = 0; axis < 3; ++axis) {
        const x = positions[3 * triangles[i]! + axis]!;
        if (x < box[axis]!) box[axis] = x;
        if (x > box[axis + 3]!) box[axis + 3] = x;
      }
    }
  }

  /** Distance along the ray (of unit direction, in world units) to the first hit, or Infinity. */
  distance(ray: Ray, T_world_mesh: Matrix4): number {
    this.local.copy(ray).applyMatrix4(this.inverse.copy(T_world_mesh).invert());
    // A ray's direction stays of unit length in applyMatrix4, so its distances are those of the mesh.
    const { origin: o, direction: d } = this.local;
    let best = Infinity;
    for (let run = 0; run * 6 < this.boxes.length; ++run) {
      if (this.entersBox(run, o, d, best)) best = this.nearestInRun(run, o, d, best);
    }
    if (best === Infinity) return Infinity;
    return this.local.at(best, new Vector3()).applyMatrix4(T_world_mesh).distanceTo(ray.origin);
  }

  private entersBox(run: number, o: Vector3, d: Vector3, most: number): boolean {
    const b = this.boxes;
    const i = 6 * run;
    let from = 0;
    let to = most;
    const slab = (low: number, high: number, origin: number, direction: number): void => {
      const a = (low - origin) / direction;
      const c = (high - origin) / direction;
      from = Math.max(from, Math.min(a, c));
      to = Math.min(to, Math.max(a, c));
    };
    slab(b[i]!, b[i + 3]!, o.x, d.x || 1e-30);
    slab(b[i + 1]!, b[i + 4]!, o.y, d.y || 1e-30);
    slab(b[i + 2]!, b[i + 5]!, o.z, d.z || 1e-30);
    return from <= to;
  }

  private nearestInRun(run: number, o: Vector3, d: Vector3, best: number): number {
    const { triangles } = this.mesh;
    const end = Math.min(triangles.length, 3 * RUN * (run + 1));
    for (let i = 3 * RUN * run; i < end; i += 3) best = Math.min(best, this.hit(i, o, d));
    return best;
  }

  // Either face: the determinant's sign is divided out.
  private hit(i: number, o: Vector3, d: Vector3): number {
    const { positions: p, triangles } = this.mesh;
    const a = 3 * triangles[i]!;
    const b = 3 * triangles[i + 1]!;
    const c = 3 * triangles[i + 2]!;
    const ax = p[a]!,
      ay = p[a + 1]!,
      az = p[a + 2]!;
    const ux = p[b]! - ax,
      uy = p[b + 1]! - ay,
      uz = p[b + 2]! - az;
    const vx = p[c]! - ax,
      vy = p[c + 1]! - ay,
      vz = p[c + 2]! - az;
    const nx = d.y * vz - d.z * vy,
      ny = d.z * vx - d.x * vz,
      nz = d.x * vy - d.y * vx;
    const det = ux * nx + uy * ny + uz * nz;
    if (det === 0) return Infinity;
    const sx = o.x - ax,
      sy = o.y - ay,
      sz = o.z - az;
    const s = (sx * nx + sy * ny + sz * nz) / det;
    if (s < 0 || s > 1) return Infinity;
    const qx = sy * uz - sz * uy,
      qy = sz * ux - sx * uz,
      qz = sx * uy - sy * ux;
    const t = (d.x * qx + d.y * qy + d.z * qz) / det;
    if (t < 0 || s + t > 1) return Infinity;
    const distance = (vx * qx + vy * qy + vz * qz) / det;
    return distance > 0 ? distance : Infinity;
  }
}
