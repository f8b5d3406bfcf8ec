// Reduces glTF to its shape: drops images, materials and animations, and merges all buffers, so that nothing is fetched.

interface Gltf {
  buffers?: { uri?: string; byteLength: number }[];
  bufferViews?: { buffer: number; byteOffset?: number }[];
  meshes?: {
    primitives: { material?: number; attributes: Record<string, number>; targets?: unknown; mode?: number }[];
  }[];
  nodes?: { skin?: number; camera?: number }[];
  extensionsRequired?: string[];
  [key: string]: unknown;
}

const NOT_SHAPE = [
  "images",
  "textures",
  "samplers",
  "materials",
  "animations",
  "skins",
  "cameras",
  "extensions",
];
const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;
const MAGIC = 0x46546c67;

/** Returns a GLB with only the shape. `beside` returns the bytes of a file that was dropped together with it, by name. */
export async function shapeOf(
  bytes: ArrayBuffer,
  beside: (name: string) => Promise<ArrayBuffer> | undefined,
): Promise<ArrayBuffer> {
  const { json, bin } = unpack(bytes);
  for (const key of NOT_SHAPE) delete json[key];
  for (const node of json.nodes ?? []) {
    delete node.skin;
    delete node.camera;
  }
  for (const primitive of (json.meshes ?? []).flatMap((m) => m.primitives)) {
    delete primitive.material;
    delete primitive.targets;
    const position = primitive.attributes["POSITION"];
    primitive.attributes = position === undefined ? {} : { POSITION: position };
  }
  const parts = await Promise.all((json.buffers ?? []).map((b) => bufferOf(b.uri, bin, beside)));
  return pack(json, parts);
}

function unpack(bytes: ArrayBuffer): { json: Gltf; bin: ArrayBuffer | undefined } {
  const view = new DataView(bytes);
  if (bytes.byteLength < 20 || view.getUint32(0, true) !== MAGIC) {
    return { json: JSON.parse(new TextDecoder().decode(bytes)) as Gltf, bin: undefined };
  }
  const jsonLength = view.getUint32(12, true);
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 20, jsonLength))) as Gltf;
  const next = 20 + jsonLength;
  const bin =
    next + 8 <= bytes.byteLength ? bytes.slice(next + 8, next + 8 + view.getUint32(next, true)) : undefined;
  return { json, bin };
}

async function bufferOf(
  uri: string | undefined,
  bin: ArrayBuffer | undefined,
  beside: (name: string) => Promise<ArrayBuffer> | undefined,
): Promise<Uint8Array> {
  if (uri === undefined) {
    if (!bin) throw new Error("a buffer has neither data nor a file name");
    return new Uint8Array(bin);
  }
  if (uri.startsWith("data:"))
    return Uint8Array.from(atob(uri.slice(uri.indexOf(",") + 1)), (c) => c.charCodeAt(0));
  const name = decoded(uri.split("/").at(-1)!);
  const file = beside(name);
  if (!file) throw new Error(`needs ${name}: drop both files together`);
  return new Uint8Array(await file);
}

/** Exporters leave a percent sign of a file name as it is, too: "50%.bin". */
function decoded(name: string): string {
  try {
    return decodeURIComponent(name);
  } catch {
    return name;
  }
}

const to4 = (bytes: number): number => (bytes + 3) & ~3;

function pack(json: Gltf, parts: Uint8Array[]): ArrayBuffer {
  const offsets: number[] = [];
  let size = 0;
  for (const part of parts) {
    offsets.push(size);
    size += to4(part.length);
  }
  for (const view of json.bufferViews ?? []) {
    view.byteOffset = (view.byteOffset ?? 0) + (offsets[view.buffer] ?? 0);
    view.buffer = 0;
  }
  json.buffers = [{ byteLength: size }];
  const text = new TextEncoder().encode(JSON.stringify(json));
  const textSize = to4(text.length);
  const out = new Uint8Array(12 + 8 + textSize + 8 + size).fill(0x20, 20, 20 + textSize);
  const view = new DataView(out.buffer);
  [MAGIC, 2, out.length, textSize, JSON_CHUNK].forEach((value, i) => view.setUint32(4 * i, value, true));
  out.set(text, 20);
  view.setUint32(20 + textSize, size, true);
  view.setUint32(24 + textSize, BIN_CHUNK, true);
  parts.forEach((part, i) => out.set(part, 28 + textSize + offsets[i]!));
  return out.buffer;
}
