// Normals for smooth shading: faces that meet at less than a crease angle share a normal, edges of parts stay sharp.
import { BufferAttribute, BufferGeometry } from "three";
import type { DisplayMesh } from "../state";

const CREASE_COS = Math.cos((35 * Math.PI) / 180);

/** An indexed geometry with normals; vertices at creases are split. */
export function smoothGeometry({ positions, triangles }: DisplayMesh): BufferGeometry {
  const faces = triangles.length / 3;
  const vertices = positions.length / 3;
  const area = new Float32Array(triangles.length); // face normals, as long as the area
  const unit = new Float32Array(triangles.length);
  const firstOf = new Uint32Array(vertices + 1);
  for (let f = 0; f < faces; ++f) {
    const [a, b, c] = [3 * triangles[3 * f]!, 3 * triangles[3 * f + 1]!, 3 * triangles[3 * f + 2]!];
    const ux = positions[b]! - positions[a]!;
    const uy = positions[b + 1]! - positions[a + 1]!;
    const uz = positions[b + 2]! - positions[a + 2]!;
    const vx = positions[c]! - positions[a]!;
    const vy = positions[c + 1]! - positions[a + 1]!;
    const vz = positions[c + 2]! - positions[a + 2]!;
    const n = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
    const length = Math.hypot(n[0]!, n[1]!, n[2]!) || 1;
    for (let i = 0; i < 3; ++i) {
      area[3 * f + i] = n[i]!;
      unit[3 * f + i] = n[i]! / length;
      ++firstOf[triangles[3 * f + i]! + 1]!;
    }
  }
  for (let v = 0; v < vertices; ++v) firstOf[v + 1]! += firstOf[v]!;
  const next = firstOf.slice();
  const cornersOf = new Uint32Array(triangles.length); // corners by vertex
  for (let corner = 0; corner < triangles.length; ++corner) cornersOf[next[triangles[corner]!]!++] = corner;

  const index = new Uint32Array(triangles.length);
  const points: number[] = [];
  const normals: number[] = [];
  const dot = (f: number, g: number): number =>
    unit[3 * f]! * unit[3 * g]! + unit[3 * f + 1]! * unit[3 * g + 1]! + unit[3 * f + 2]! * unit[3 * g + 2]!;
  for (let v = 0; v < vertices; ++v) {
    // Groups: the first face of each decides which others join it.
    const leaders: number[] = [];
    const ids: number[] = [];
    for (let k = firstOf[v]!; k < firstOf[v + 1]!; ++k) {
      const corner = cornersOf[k]!;
      const face = Math.floor(corner / 3);
      // A face without a normal would join no group: each would begin one, and all would be compared with all. The normals of
      // the others differ by more than the crease, so that a vertex has some tens of groups at most.
      let group = dot(face, face) > CREASE_COS ? leaders.findIndex((leader) => dot(leader, face) > CREASE_COS) : 0;
      if (group < 0 || leaders.length === 0) {
        group = leaders.length;
        leaders.push(face);
        ids.push(points.length / 3);
        points.push(positions[3 * v]!, positions[3 * v + 1]!, positions[3 * v + 2]!);
        normals.push(0, 0, 0);
      }
      const id = ids[group]!;
      index[corner] = id;
      for (let i = 0; i < 3; ++i) normals[3 * id + i]! += area[3 * face + i]!;
    }
  }
  for (let i = 0; i < normals.length; i += 3) {
    const length = Math.hypot(normals[i]!, normals[i + 1]!, normals[i + 2]!) || 1;
    for (let k = 0; k < 3; ++k) normals[i + k]! /= length;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(new Float32Array(points), 3));
  geometry.setAttribute("normal", new BufferAttribute(new Float32Array(normals), 3));
  geometry.setIndex(new BufferAttribute(index, 1));
  return geometry;
}

/** Fewer triangles, for while something moves: vertices of one cell of a grid become one. */
export function coarse({ positions, triangles }: DisplayMesh, about: number): DisplayMesh {
  const min = [Infinity, Infinity, Infinity];
  const max = [-Infinity, -Infinity, -Infinity];
  for (let i = 0; i < positions.length; ++i) {
    min[i % 3] = Math.min(min[i % 3]!, positions[i]!);
    max[i % 3] = Math.max(max[i % 3]!, positions[i]!);
  }
  const extent = Math.max(...[0, 1, 2].map((i) => max[i]! - min[i]!)) || 1;
  // A surface of a compact shape crosses about 3 n² of n³ cells, with two triangles in each.
  const cells = Math.max(8, Math.round(Math.sqrt(about / 6)));
  const cell = extent / cells;
  const known = new Map<number, number>();
  const of = new Uint32Array(positions.length / 3);
  const points: number[] = [];
  const counts: number[] = [];
  for (let v = 0; v < of.length; ++v) {
    const at = [0, 1, 2].map((i) => Math.floor((positions[3 * v + i]! - min[i]!) / cell));
    const key = (at[0]! * 4096 + at[1]!) * 4096 + at[2]!;
    let id = known.get(key);
    if (id === undefined) {
      id = counts.length;
      known.set(key, id);
      counts.push(0);
      points.push(0, 0, 0);
    }
    of[v] = id;
    ++counts[id]!;
    for (let i = 0; i < 3; ++i) points[3 * id + i]! += positions[3 * v + i]!;
  }
  counts.forEach((count, id) => [0, 1, 2].forEach((i) => (points[3 * id + i]! /= count)));
  const kept: number[] = [];
  for (let t = 0; t < triangles.length; t += 3) {
    const [a, b, c] = [of[triangles[t]!]!, of[triangles[t + 1]!]!, of[triangles[t + 2]!]!];
    if (a !== b && b !== c && c !== a) kept.push(a, b, c);
  }
  return { positions: new Float32Array(points), triangles: new Uint32Array(kept) };
}
