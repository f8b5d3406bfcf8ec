// Merges corners at the same position into one vertex: the STL and OBJ loaders return separate corners for each triangle.

export interface FileMesh {
  positions: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
}

/** Welds a list of corners: nine numbers per triangle. */
export function weld(corners: Float32Array): FileMesh {
  const count = corners.length / 3;
  // -0 and 0 are the same position but have different bits.
  const exact = new Float32Array(corners.length);
  for (let i = 0; i < corners.length; ++i) exact[i] = corners[i]! + 0;
  const bits = new Int32Array(exact.buffer);
  let slots = 16;
  while (slots < 2 * count) slots *= 2;
  const table = new Int32Array(slots).fill(-1);
  const positions = new Float32Array(corners.length);
  const positionBits = new Int32Array(positions.buffer);
  const triangles = new Uint32Array(count);
  let used = 0;
  for (let i = 0; i < count; ++i) {
    const x = bits[3 * i]!;
    const y = bits[3 * i + 1]!;
    const z = bits[3 * i + 2]!;
    let slot = hash(x, y, z) & (slots - 1);
    for (; table[slot] !== -1; slot = (slot + 1) & (slots - 1)) {
      const at = 3 * table[slot]!;
      if (positionBits[at] === x && positionBits[at + 1] === y && positionBits[at + 2] === z) break;
    }
    if (table[slot] === -1) {
      positions.set(exact.subarray(3 * i, 3 * i + 3), 3 * used);
      table[slot] = used++;
    }
    triangles[i] = table[slot]!;
  }
  return { positions: positions.slice(0, 3 * used), triangles };
}

function hash(x: number, y: number, z: number): number {
  let h = Math.imul(x, 0x9e3779b1) ^ Math.imul(y, 0x85ebca6b) ^ Math.imul(z, 0xc2b2ae35);
  h = Math.imul(h ^ (h >>> 15), 0x2c1b3c6d);
  return h ^ (h >>> 13);
}
