// three's loader drops the faces of a PLY file that have more than four corners, without a word.

const BYTES = new Map([
  ...["char", "uchar", "int8", "uint8"].map((type) => [type, 1] as const),
  ...["short", "ushort", "int16", "uint16"].map((type) => [type, 2] as const),
  ...["int", "uint", "int32", "uint32", "float", "float32"].map((type) => [type, 4] as const),
  ...["double", "float64"].map((type) => [type, 8] as const),
]);

interface Property {
  name: string;
  bytes: number;
  /** Of the length of a list; 0: no list. */
  lengthBytes: number;
}

interface Element {
  name: string;
  count: number;
  properties: Property[];
}

/** Number of faces with more than four corners. Throws RangeError where the file is too short, Error for an impossible count. */
export function largePolygons(file: ArrayBuffer): number {
  const bytes = new Uint8Array(file);
  const { format, elements, end } = headerOf(bytes);
  const next = format === "ascii" ? asciiReader(bytes, end) : binaryReader(file, end, format.includes("little"));
  // Without properties, or beyond the end of the file, a loop over the entries would run for minutes, three's as well.
  for (const { name, count } of elements)
    if (count > bytes.length) throw new Error(`${count} entries of "${name}" do not fit into ${bytes.length} bytes`);
  let large = 0;
  for (const { name, count, properties } of elements) {
    for (let i = 0; i < count; ++i) {
      for (const property of properties) {
        const values = property.lengthBytes > 0 ? next.length(property.lengthBytes) : 1;
        next.skip(values, property.bytes);
        if (name === "face" && /^vertex_ind(ex|ices)$/.test(property.name) && values > 4) ++large;
      }
    }
    if (name === "face") break;
  }
  return large;
}

function headerOf(bytes: Uint8Array): { format: string; elements: Element[]; end: number } {
  const elements: Element[] = [];
  let format = "";
  for (let at = 0; ; ) {
    const end = bytes.indexOf(10, at);
    if (end < 0) throw new RangeError("the header has no end");
    const [word, ...rest] = String.fromCharCode(...bytes.subarray(at, Math.min(end, at + 1000))).trim().split(/\s+/);
    at = end + 1;
    if (word === "end_header") return { format, elements, end: at };
    if (word === "format") format = rest[0] ?? "";
    if (word === "element") elements.push({ name: rest[0] ?? "", count: Number(rest[1]) || 0, properties: [] });
    if (word !== "property") continue;
    const list = rest[0] === "list";
    elements.at(-1)?.properties.push({
      name: rest.at(-1) ?? "",
      bytes: BYTES.get(rest[list ? 2 : 0] ?? "") ?? 0,
      lengthBytes: list ? (BYTES.get(rest[1] ?? "") ?? 1) : 0,
    });
  }
}

interface Reader {
  length(bytes: number): number;
  skip(values: number, bytes: number): void;
}

function binaryReader(file: ArrayBuffer, begin: number, little: boolean): Reader {
  const view = new DataView(file);
  let at = begin;
  return {
    length(bytes) {
      const value =
        bytes === 1 ? view.getUint8(at) : bytes === 2 ? view.getUint16(at, little) : view.getUint32(at, little);
      at += bytes;
      return value;
    },
    skip(values, bytes) {
      at += values * bytes;
    },
  };
}

function asciiReader(bytes: Uint8Array, begin: number): Reader {
  let at = begin;
  const word = (): number => {
    while (at < bytes.length && (bytes[at] ?? 0) <= 32) ++at;
    if (at >= bytes.length) throw new RangeError("the file ends early");
    const from = at;
    while (at < bytes.length && (bytes[at] ?? 0) > 32) ++at;
    return from;
  };
  return {
    length() {
      const from = word();
      return Number(String.fromCharCode(...bytes.subarray(from, Math.min(at, from + 20)))) || 0;
    },
    skip(values) {
      for (let i = 0; i < values; ++i) word();
    },
  };
}
