// readMesh() in a worker: a file of 500,000 triangles takes seconds, in which STOP must work.
import type { FileMesh } from "./weld";

type Answer = { name: string; mesh: FileMesh } | { error: string };

/** As readMesh(), without blocking the page. */
export function readMeshBeside(files: File[]): Promise<{ name: string; mesh: FileMesh }> {
  const worker = new Worker("read_worker.js", { type: "module" });
  return new Promise<{ name: string; mesh: FileMesh }>((resolve, reject) => {
    worker.onmessage = ({ data }: MessageEvent<Answer>) =>
      "error" in data ? reject(new Error(data.error)) : resolve(data);
    worker.onerror = () => reject(new Error(`${files[0]?.name ?? "the file"}: the page cannot read it`));
    worker.postMessage(files);
  }).finally(() => worker.terminate());
}
