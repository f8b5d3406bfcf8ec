// Asks the server for its state four times a second, and for the meshes that are new in it.
import type { ObjectState, ServerState } from "./state_types";

const EVERY_MS = 250;
const RETRY_MS = 1000;
/** Triangles that the server sends of a scene. */
const MOST_SHOWN = 100_000;

export interface DisplayMesh {
  positions: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
}

/** Reads what GET /api/mesh answers; throws when it is something else. */
export function decodeMesh(bytes: ArrayBuffer): DisplayMesh {
  const view = new DataView(bytes);
  if (bytes.byteLength < 16 || view.getUint32(0) !== 0x48444d31)
    throw new Error("the answer to /api/mesh is no mesh");
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
  private notBefore_ms = 0;
  /** Another one: what is under way belongs to a scene that is no longer shown. */
  private round = 0;

  constructor(
    private readonly onMesh: (object: number, mesh: DisplayMesh) => void,
    private readonly onGone: (object: number) => void,
  ) {}

  clear(): void {
    for (const id of this.have.keys()) this.onGone(id);
    this.have.clear();
    ++this.round;
  }

  update(scene: number, objects: ObjectState[]): void {
    for (const id of [...this.have.keys()]) {
      if (objects.some((o) => o.id === id && o.triangles > 0)) continue;
      this.have.delete(id);
      this.onGone(id);
    }
    const crowd = crowdOf(objects);
    const missing = objects.find((o) => o.triangles > 0 && this.have.get(o.id) !== keyOf(o, crowd));
    if (missing && !this.busy && performance.now() > this.notBefore_ms)
      void this.fetch(scene, missing, crowd);
  }

  // A mesh that is still being made (503), or gone by now (404), is asked for again with a later state.
  private async fetch(scene: number, object: ObjectState, crowd: number): Promise<void> {
    this.busy = true;
    const { round } = this;
    try {
      const answer = await fetch(`/api/mesh?scene=${scene}&object=${object.id}&geometry=${object.geometry}`);
      if (answer.status !== 200) {
        this.notBefore_ms = performance.now() + RETRY_MS;
        return;
      }
      const mesh = decodeMesh(await answer.arrayBuffer());
      if (round !== this.round) return;
      this.have.set(object.id, keyOf(object, crowd));
      this.onMesh(object.id, mesh);
    } catch {
      // The state tells that the server is gone.
    } finally {
      this.busy = false;
    }
  }
}

// An object's share of what is drawn changes with the others: asked for again when they have grown or shrunk a lot.
function crowdOf(objects: ObjectState[]): number {
  const all = objects.reduce((sum, o) => sum + o.triangles, 0);
  return Math.max(0, Math.round(Math.log(all / MOST_SHOWN) / Math.log(1.5)));
}

const keyOf = (o: ObjectState, crowd: number): string => `${o.geometry}/${crowd}`;
