// Polygons into triangles without holes, as the server's commands divide them (src/mesh_io/triangulation.cpp).

/** The corners of the triangles of all faces. `corners` has those of one face after the other, as numbers of positions. */
export function cornersOfFaces(positions: readonly number[], corners: readonly number[], sizes: readonly number[]): Float32Array {
  const triangles: number[] = [];
  let begin = 0;
  for (const size of sizes) {
    divide(corners.slice(begin, begin + size), positions, triangles);
    begin += size;
  }
  const out = new Float32Array(3 * triangles.length);
  triangles.forEach((vertex, at) => {
    for (let axis = 0; axis < 3; ++axis) out[3 * at + axis] = positions[3 * vertex + axis]!;
  });
  return out;
}

/** Appends the n - 2 triangles of a face of n corners. All are numbers of positions, which have three coordinates each. */
function divide(face: readonly number[], positions: readonly number[], triangles: number[]): void {
  if (face.length < 3) return;
  if (face.length === 3) {
    triangles.push(...face);
    return;
  }
  const { x, y } = flattened(face, positions);
  const cross = (a: number, b: number, c: number): number => (x[b]! - x[a]!) * (y[c]! - y[a]!) - (y[b]! - y[a]!) * (x[c]! - x[a]!);
  const same = (a: number, b: number): boolean => x[a] === x[b] && y[a] === y[b];
  const left = face.map((_, i) => i);
  const before = (i: number): number => left[(i + left.length - 1) % left.length]!;
  const after = (i: number): number => left[(i + 1) % left.length]!;
  // No other corner is inside or on the edge that the ear leaves.
  const isEmpty = (a: number, b: number, c: number): boolean =>
    left.every((p) => same(p, a) || same(p, b) || same(p, c) || !(cross(a, b, p) > 0 && cross(b, c, p) > 0 && cross(c, a, p) >= 0));
  let begin = 1;
  while (left.length > 2) {
    // Where there is no ear, as in a face that crosses itself, the corner that overlaps the least.
    let found = 0;
    let flattest = Infinity;
    for (let k = 0; k < left.length; ++k) {
      const i = (begin + k) % left.length;
      const area = cross(before(i), left[i]!, after(i));
      if (area > 0 && isEmpty(before(i), left[i]!, after(i))) {
        found = i;
        break;
      }
      if (Math.abs(area) < flattest) {
        flattest = Math.abs(area);
        found = i;
      }
    }
    triangles.push(face[before(found)]!, face[left[found]!]!, face[after(found)]!);
    left.splice(found, 1);
    begin = found < left.length ? found + 1 : 1; // not a fan around one corner
  }
}

/** Without the coordinate in which the normal is longest, and so that the polygon turns left. */
function flattened(face: readonly number[], positions: readonly number[]): { x: number[]; y: number[] } {
  const at = (i: number, axis: number): number => positions[3 * face[i]! + axis]!;
  const normal = [0, 1, 2].map((axis) => {
    const u = (axis + 1) % 3;
    const v = (axis + 2) % 3;
    let sum = 0;
    for (let i = 1; i + 1 < face.length; ++i) {
      sum += (at(i, u) - at(0, u)) * (at(i + 1, v) - at(0, v)) - (at(i, v) - at(0, v)) * (at(i + 1, u) - at(0, u));
    }
    return sum;
  });
  const sizes = normal.map(Math.abs);
  const longest = sizes.indexOf(Math.max(...sizes));
  const turn = normal[longest]! < 0 ? -1 : 1;
  return {
    x: face.map((_, i) => at(i, (longest + 1) % 3)),
    y: face.map((_, i) => turn * at(i, (longest + 2) % 3)),
  };
}
