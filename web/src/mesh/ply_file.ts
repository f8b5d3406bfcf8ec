// PLY as the server's commands read it (src/mesh_io/ply_file.cpp): elements in any order, faces of any size, strips. three's loader
// drops faces of more than four corners without a word.
import { cornersOfFaces } from "./triangulation";

const TYPES = new Map<string, Type>([
  ...["char", "int8"].map((name) => [name, "Int8"] as const),
  ...["uchar", "uint8"].map((name) => [name, "Uint8"] as const),
  ...["short", "int16"].map((name) => [name, "Int16"] as const),
  ...["ushort", "uint16"].map((name) => [name, "Uint16"] as const),
  ...["int", "int32"].map((name) => [name, "Int32"] as const),
  ...["uint", "uint32"].map((name) => [name, "Uint32"] as const),
  ...["float", "float32"].map((name) => [name, "Float32"] as const),
  ...["double", "float64"].map((name) => [name, "Float64"] as const),
]);

const SIZES = { Int8: 1, Uint8: 1, Int16: 2, Uint16: 2, Int32: 4, Uint32: 4, Float32: 4, Float64: 8 };
type Type = keyof typeof SIZES;

interface Property {
  name: string;
  type: Type;
  /** Of the length of a list. */
  length?: Type;
}

interface Element {
  name: string;
  count: number;
  properties: Property[];
}

/** The corners of all triangles. Throws RangeError where the file is too short, Error with the reason for what is none. */
export function cornersOfPly(file: ArrayBuffer): Float32Array {
  const bytes = new Uint8Array(file);
  const { format, elements, end } = headerOf(bytes);
  const next = format === "ascii" ? asciiReader(bytes, end) : binaryReader(file, end, format.includes("little"));
  // Without properties, or beyond the end of the file, a loop over the entries would run for minutes.
  for (const { name, count } of elements)
    if (count > bytes.length) throw new Error(`${count} entries of "${name}" do not fit into ${bytes.length} bytes`);
  const positions: number[] = [];
  const faces: number[] = [];
  const sizes: number[] = [];
  for (const { name, count, properties } of elements) {
    for (let i = 0; i < count; ++i) {
      const position: Record<string, number> = {};
      for (const property of properties) {
        if (!property.length) {
          position[property.name] = next(property.type);
          continue;
        }
        const size = next(property.length);
        if (!(size >= 0 && size <= bytes.length)) throw new Error(`a list of "${name}" has the length ${size}`);
        const corners: number[] = [];
        for (let k = 0; k < size; ++k) corners.push(next(property.type));
        if (!/^vertex_ind(ex|ices)$/.test(property.name)) continue;
        if (name === "tristrips") addStrip(corners, faces, sizes);
        if (name !== "face") continue;
        for (const corner of corners) faces.push(corner);
        sizes.push(size);
      }
      if (name === "vertex") {
        const { x, y, z } = position;
        if (x === undefined || y === undefined || z === undefined) throw new Error("its vertices have no x, y or z");
        positions.push(x, y, z);
      }
    }
  }
  const vertices = positions.length / 3;
  const wrong = faces.find((corner) => !(Number.isInteger(corner) && corner >= 0 && corner < vertices));
  if (wrong !== undefined) throw new Error(`a face has the corner ${wrong}, but there are ${vertices} vertices`);
  return cornersOfFaces(positions, faces, sizes);
}

/** Each corner makes a triangle with the two before it, of alternating order; -1 begins anew. */
function addStrip(strip: readonly number[], faces: number[], sizes: number[]): void {
  let begin = 0;
  strip.forEach((c, i) => {
    if (c === -1) begin = i + 1;
    if (c === -1 || i < begin + 2) return;
    const [a, b] = [strip[i - 2]!, strip[i - 1]!];
    if (a === b || b === c || a === c) return;
    faces.push(...((i - begin) % 2 === 1 ? [b, a, c] : [a, b, c]));
    sizes.push(3);
  });
}

function headerOf(bytes: Uint8Array): { format: string; elements: Element[]; end: number } {
  const elements: Element[] = [];
  let format = "";
  const typeOf = (name = ""): Type => {
    const type = TYPES.get(name);
    if (!type) throw new Error(`a property has the unknown type '${name}'`);
    return type;
  };
  for (let at = 0; ; ) {
    const end = bytes.indexOf(10, at);
    if (end < 0) throw new RangeError("the header has no end");
    const [word, ...rest] = String.fromCharCode(...bytes.subarray(at, Math.min(end, at + 1000))).trim().split(/\s+/);
    at = end + 1;
    if (word === "end_header") return { format, elements, end: at };
    if (word === "format") format = rest[0] ?? "";
    if (word === "element") elements.push({ name: rest[0] ?? "", count: Number(rest[1]) || 0, properties: [] });
    if (word !== "property") continue;
    const name = rest.at(-1) ?? "";
    elements.at(-1)?.properties.push(
      rest[0] === "list" ? { name, length: typeOf(rest[1]), type: typeOf(rest[2]) } : { name, type: typeOf(rest[0]) },
    );
  }
}

type Reader = (type: Type) => number;

function binaryReader(file: ArrayBuffer, begin: number, little: boolean): Reader {
  const view = new DataView(file);
  let at = begin;
  return (type) => {
    const value = view[`get${type}`](at, little);
    at += SIZES[type];
    return value;
  };
}

function asciiReader(bytes: Uint8Array, begin: number): Reader {
  let at = begin;
  return () => {
    while (at < bytes.length && (bytes[at] ?? 0) <= 32) ++at;
    if (at >= bytes.length) throw new RangeError("the file ends early");
    const from = at;
    while (at < bytes.length && (bytes[at] ?? 0) > 32) ++at;
    return Number(String.fromCharCode(...bytes.subarray(from, Math.min(at, from + 40))));
  };
}
