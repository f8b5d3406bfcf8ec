// Reads a mesh file beside the page, which stays able to stop the device meanwhile.
import { readMesh } from "./read_file";

self.onmessage = async (event: MessageEvent<File[]>): Promise<void> => {
  try {
    const { name, mesh } = await readMesh(event.data);
    self.postMessage({ name, mesh }, { transfer: [mesh.positions.buffer, mesh.triangles.buffer] });
  } catch (error) {
    self.postMessage({ error: (error as Error).message });
  }
};
