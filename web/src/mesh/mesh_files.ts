// The kinds of files that hold a mesh, by their names.
const KINDS = ["obj", "stl", "ply", "gltf", "glb"];

export const kindOf = (name: string): string => name.split(".").at(-1)!.toLowerCase();
export const isMeshFile = (name: string): boolean => KINDS.includes(kindOf(name));
