// A mesh out of a file: OBJ, STL, PLY or glTF, by three's loaders, in the browser.
import { type BufferGeometry, Mesh, type Object3D, Vector3 } from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { OBJLoader } from "three/examples/jsm/loaders/OBJLoader.js";
import { PLYLoader } from "three/examples/jsm/loaders/PLYLoader.js";
import { STLLoader } from "three/examples/jsm/loaders/STLLoader.js";
import { shapeOf } from "./gltf_shape";
import { type FileMesh, weld } from "./weld";

export const KINDS = ["obj", "stl", "ply", "gltf", "glb"];
/** More does not fit into one batch of the server. */
const MOST_TRIANGLES = 12_000_000;

const kindOf = (name: string): string => name.split(".").at(-1)!.toLowerCase();

/** Reads the first mesh file among these; the others may be files that it names. Throws with the file and the reason. */
export async function readMesh(files: File[]): Promise<{ name: string; mesh: FileMesh }> {
  const file = files.find((f) => KINDS.includes(kindOf(f.name)));
  if (!file)
    throw new Error(`${files[0]?.name ?? "That"} is no mesh file: drop an OBJ, STL, PLY, glTF or GLB.`);
  try {
    const corners = await cornersOf(file, files);
    check(corners);
    return { name: file.name, mesh: weld(corners) };
  } catch (error) {
    throw new Error(`${file.name}: ${error instanceof Error ? error.message : String(error)}`);
  }
}

async function cornersOf(file: File, files: File[]): Promise<Float32Array> {
  const bytes = await file.arrayBuffer();
  switch (kindOf(file.name)) {
    case "obj":
      return cornersIn(new OBJLoader().parse(new TextDecoder().decode(bytes)));
    case "stl":
      return cornersIn(new Mesh(new STLLoader().parse(bytes)));
    case "ply": {
      const geometry = new PLYLoader().parse(bytes);
      // Without faces it is a point cloud, and not a list of corners.
      return geometry.index ? cornersIn(new Mesh(geometry)) : new Float32Array(0);
    }
    default: {
      const shape = await shapeOf(bytes, (name) => files.find((f) => f.name === name)?.arrayBuffer());
      return cornersIn((await new GLTFLoader().parseAsync(shape, "")).scene);
    }
  }
}

/** All triangles below a node, as corners where the node puts them. */
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
  if (triangles === 0) throw new Error("it has no triangles: a point cloud or lines cannot be touched");
  if (triangles > MOST_TRIANGLES)
    throw new Error(`${triangles} triangles, at most ${MOST_TRIANGLES} can be sent at once`);
  const bad = corners.findIndex((x) => !Number.isFinite(x));
  if (bad >= 0) throw new Error(`a corner of triangle ${Math.floor(bad / 9)} is not a number`);
}
