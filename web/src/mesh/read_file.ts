// Reads a mesh from an OBJ, PLY, STL or glTF file in the browser; the last two with three's loaders.
import { type BufferGeometry, Mesh, type Object3D, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { shapeOf } from "./gltf_shape";
import { isMeshFile, kindOf } from "./mesh_files";
import { cornersOfObj } from "./obj_file";
import { cornersOfPly } from "./ply_file";
import { type FileMesh, weld } from "./weld";

/** The limit of one batch in the server. */
const MAX_TRIANGLES = 12_000_000;

/** Reads the first mesh file of the list; the others may be files that it refers to. The error names the file and the reason. */
export async function readMesh(files: File[]): Promise<{ name: string; mesh: FileMesh }> {
  const file = files.find((f) => isMeshFile(f.name));
  if (!file)
    throw new Error(`${files[0]?.name ?? "The file"} is not a mesh file: drop an OBJ, STL, PLY, glTF or GLB file.`);
  try {
    const corners = await cornersOf(file, files);
    check(corners);
    return { name: file.name, mesh: weld(corners) };
  } catch (error) {
    throw new Error(`${file.name}: ${reasonOf(error, kindOf(file.name))}`);
  }
}

/** The parsers of three fail on broken files with the errors of the language. */
function reasonOf(error: unknown, kind: string): string {
  if (error instanceof RangeError || error instanceof TypeError || error instanceof SyntaxError)
    return `the file is truncated, or not a valid ${kind.toUpperCase()} file`;
  return error instanceof Error ? error.message : String(error);
}

async function cornersOf(file: File, files: File[]): Promise<Float32Array> {
  const bytes = await file.arrayBuffer();
  switch (kindOf(file.name)) {
    case "obj":
      return cornersOfObj(new TextDecoder().decode(bytes));
    case "stl":
      return cornersIn(new Mesh(new STLLoader().parse(bytes)));
    case "ply":
      return cornersOfPly(bytes);
    default: {
      const shape = await shapeOf(bytes, (name) => files.find((f) => f.name === name)?.arrayBuffer());
      return cornersIn((await new GLTFLoader().parseAsync(shape, "")).scene);
    }
  }
}

/** The corners of all triangles below a node, in the frame of the root. */
function cornersIn(root: Object3D): Float32Array {
  root.updateMatrixWorld(true);
  const meshes: Mesh<BufferGeometry>[] = [];
  root.traverse((node) => {
    if (node instanceof Mesh) meshes.push(node as Mesh<BufferGeometry>);
  });
  const cornersOfMesh = (m: Mesh<BufferGeometry>): number => {
    const count = m.geometry.index?.count ?? m.geometry.getAttribute("position")?.count ?? 0;
    return count - (count % 3);
  };
  const total = meshes.reduce((sum, m) => sum + cornersOfMesh(m), 0);
  const corners = new Float32Array(3 * total);
  const point = new Vector3();
  let at = 0;
  for (const mesh of meshes) {
    const { index } = mesh.geometry;
    const position = mesh.geometry.getAttribute("position");
    const count = cornersOfMesh(mesh);
    for (let i = 0; i < count; ++i, at += 3) {
      point
        .fromBufferAttribute(position, index ? index.getX(i) : i)
        .applyMatrix4(mesh.matrixWorld)
        .toArray(corners, at);
    }
  }
  return corners;
}

function check(corners: Float32Array): void {
  const triangles = corners.length / 9;
  if (triangles === 0) throw new Error("no triangles; point clouds and lines cannot be touched");
  if (triangles > MAX_TRIANGLES)
    throw new Error(`the mesh has ${triangles} triangles, the limit is ${MAX_TRIANGLES}: simplify it first`);
  const bad = corners.findIndex((x) => !Number.isFinite(x));
  if (bad >= 0) throw new Error(
      `a corner of triangle ${Math.floor(bad / 9)} is not finite: a number of the file is broken, or it refers to a vertex that the file does not have`,
    );
}
