// Asks the server for its state four times a second, and for the meshes that are new in it.
import type { ObjectState, ServerState } from "./state_types";

const EVERY_MS = 250;

export interface DisplayMesh {
  positions: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
}

/** Reads what GET /api/mesh answers; throws when it is something else. */
export function decodeMesh(bytes: ArrayBuffer): DisplayMesh {
  const view = new DataView(bytes);
  if (bytes.byteLength < 16 || view.getUint32(0) !== 0x48444d31) throw new Error("the answer to /api/mesh is no mesh");
  const vertices = view.getUint32(4, true);
  const triangles = view.getUint32(8, true);
  if (bytes.byteLength !== 16 + 12 * vertices + 12 * triangles) throw new Error("a mesh of /api/mesh is cut");
  return {
    positions: new Float32Array(bytes, 16, 3 * vertices),
    triangles: new Uint32Array(bytes, 16 + 12 * vertices, 3 * triangles),
  };
}

/** Calls back with each new state. `undefined`: no answer. */
export function pollState(onState: (state: ServerState | undefined) => void): void {
  const poll = async (): Promise<void> => {
    let state: ServerState | undefined;
    try {
      const answer = await fetch("/api/state", { signal: AbortSignal.timeout(3000) });
      if (answer.ok) state = (await answer.json()) as ServerState;
    } catch {
      // No server: said by undefined.
    }
    onState(state);
    window.setTimeout(() => void poll(), EVERY_MS);
  };
  void poll();
}

/** The display meshes of one scene, fetched one at a time when their geometry has changed. */
export class Meshes {
  private readonly have = new Map<number, string>();
  private busy = false;

  constructor(
    private readonly onMesh: (object: number, mesh: DisplayMesh) => void,
    private readonly onGone: (object: number) => void,
  ) {}

  clear(): void {
    for (const id of this.have.keys()) this.onGone(id);
    this.have.clear();
  }

  update(scene: number, objects: ObjectState[]): void {
    for (const id of [...this.have.keys()]) {
      if (objects.some((o) => o.id === id && o.triangles > 0)) continue;
      this.have.delete(id);
      this.onGone(id);
    }
    const missing = objects.find((o) => o.triangles > 0 && this.have.get(o.id) !== keyOf(o));
    if (missing && !this.busy) void this.fetch(scene, missing);
  }

  // A mesh that is still being made (503), or gone by now (404), is asked for again with a later state.
  private async fetch(scene: number, object: ObjectState): Promise<void> {
    this.busy = true;
    try {
      const answer = await fetch(`/api/mesh?scene=${scene}&object=${object.id}&geometry=${object.geometry}`);
      if (answer.status !== 200) return;
      const mesh = decodeMesh(await answer.arrayBuffer());
      this.have.set(object.id, keyOf(object));
      this.onMesh(object.id, mesh);
    } catch {
      // The state tells that the server is gone.
    } finally {
      this.busy = false;
    }
  }
}

// The share of an object in the display's budget changes with the other objects.
const keyOf = (o: ObjectState): string => `${o.geometry}/${o.display_triangles}`;
