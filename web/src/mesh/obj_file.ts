// OBJ as the server's commands read it (src/mesh_io/obj_file.cpp). three's loader divides faces by fans, which cover more than a
// face with notches, and takes comments for corners.
import { cornersOfFaces } from "./triangulation";

/** The corners of all triangles. The error names the line and the reason. */
export function cornersOfObj(text: string): Float32Array {
  const positions: number[] = [];
  const faces: number[] = []; // the corners of all, one after the other
  const sizes: number[] = [];
  let last = { index: -1, line: 0 };
  const lines = text.split(/\r\n|\n|\r/);
  for (let i = 0; i < lines.length; ++i) {
    let line = withoutComment(lines[i]!);
    if (!/^[ \t]*[vf][ \t]/.test(line)) continue;
    while (line.endsWith("\\")) line = `${line.slice(0, -1)} ${withoutComment(lines[++i] ?? "")}`;
    const [keyword, ...words] = line.trim().split(/[ \t]+/);
    const refuse = (reason: string): never => {
      throw new Error(`line ${i + 1}: ${reason}`);
    };
    if (keyword === "v") {
      if (words.length < 3) refuse(`a vertex has ${words.length} coordinates, expected 3`);
      for (const word of words.slice(0, 3)) positions.push(numberFrom(word) ?? refuse(`'${word}' is no number`));
      continue;
    }
    for (const word of words) {
      const corner = word.split("/", 1)[0]!;
      if (!/^-?\d+$/.test(corner)) refuse(`'${corner}' is no number of a vertex`);
      const index = Number(corner) < 0 ? positions.length / 3 + Number(corner) : Number(corner) - 1;
      if (index < 0) refuse(`a face has the corner ${corner}, but there are ${positions.length / 3} vertices`);
      if (index > last.index) last = { index, line: i + 1 };
      faces.push(index);
    }
    sizes.push(words.length);
  }
  if (last.index >= positions.length / 3)
    throw new Error(`line ${last.line}: a face has the corner ${last.index + 1}, but there are ${positions.length / 3} vertices`);
  return cornersOfFaces(positions, faces, sizes);
}

// A comment begins at a word.
function withoutComment(line: string): string {
  return line.includes("#") ? line.replace(/(^|[ \t])#.*$/, "") : line;
}

/** Also with a decimal comma, as some languages write numbers; undefined for what is none. */
function numberFrom(word: string): number | undefined {
  if (/^[+-]?(nan|inf)/i.test(word)) return NaN;
  const number = Number(word.replace(",", "."));
  return Number.isNaN(number) ? undefined : number;
}
