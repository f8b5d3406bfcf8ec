// readMesh() in a worker: a file of 500,000 triangles takes seconds, in which STOP must work.
import type { FileMesh } from "./weld";

type Answer = { name: string; mesh: FileMesh } | { error: string };

/** As readMesh(), without blocking the page. Rejects and ends the worker when `signal` aborts. */
export function readMeshBeside(files: File[], signal: AbortSignal): Promise<{ name: string; mesh: FileMesh }> {
  const worker = new Worker("read_worker.js", { type: "module" });
  return new Promise<{ name: string; mesh: FileMesh }>((resolve, reject) => {
    worker.onmessage = ({ data }: MessageEvent<Answer>) =>
      "error" in data ? reject(new Error(data.error)) : resolve(data);
    worker.onerror = () => reject(new Error(`${files[0]?.name ?? "the file"}: the page cannot read it`));
    signal.addEventListener("abort", () => reject(new Error("another file was chosen")));
    worker.postMessage(files);
  }).finally(() => worker.terminate());
}
