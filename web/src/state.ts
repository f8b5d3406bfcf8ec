// Polls the server's state four times per second, and fetches the meshes that are new in it.
import type { ObjectState, ServerState } from "./state_types";

const EVERY_MS = 250;
/** While meshes deform. */
const EVERY_DEFORMING_MS = 60;
/** Without a server: each failed request is a line in the browser's console. */
const EVERY_LOST_MS = 2000;
/** Without a further byte of a state. */
const SILENT_MS = 3000;
const RETRY_MS = 1000;
/** Limit of the server for the display meshes of a scene together. */
const MAX_DISPLAY_TRIANGLES = 100_000;

export interface DisplayMesh {
  positions: Float32Array<ArrayBuffer>;
  triangles: Uint32Array<ArrayBuffer>;
}

/** Decodes a response of GET /api/mesh; throws when it is malformed. */
export function decodeMesh(bytes: ArrayBuffer): DisplayMesh {
  const view = new DataView(bytes);
  if (bytes.byteLength < 16 || view.getUint32(0) !== 0x48444d31)
    throw new Error("the response of /api/mesh is not a mesh");
  const vertices = view.getUint32(4, true);
  const triangles = view.getUint32(8, true);
  if (bytes.byteLength !== 16 + 12 * vertices + 12 * triangles) throw new Error("the response of /api/mesh is truncated");
  return {
    positions: new Float32Array(bytes, 16, 3 * vertices),
    triangles: new Uint32Array(bytes, 16 + 12 * vertices, 3 * triangles),
  };
}

/** The state, or undefined. On a slow network that of many objects takes seconds: it is given up when nothing more of it comes. */
async function fetchState(): Promise<ServerState | undefined> {
  const request = new AbortController();
  let timer: ReturnType<typeof setTimeout> | undefined;
  const goesOn = (): void => {
    clearTimeout(timer);
    timer = setTimeout(() => request.abort(), SILENT_MS);
  };
  try {
    goesOn();
    const response = await fetch("/api/state", { signal: request.signal });
    if (!response.ok || !response.body) return undefined;
    const decoder = new TextDecoder();
    let text = "";
    const reader = response.body.getReader();
    for (let part = await reader.read(); !part.done; part = await reader.read()) {
      goesOn();
      text += decoder.decode(part.value, { stream: true });
    }
    return JSON.parse(text + decoder.decode()) as ServerState;
  } catch {
    return undefined; // the server does not respond
  } finally {
    clearTimeout(timer);
  }
}

/** Calls back with each new state; `undefined` when the server does not respond. The next one comes soon once `deforms` is true. */
export function pollState(onState: (state: ServerState | undefined) => void, deforms: () => boolean): void {
  const next = (wait_ms: number): void => {
    const step_ms = Math.min(wait_ms, EVERY_DEFORMING_MS);
    window.setTimeout(() => void (wait_ms === step_ms || deforms() ? poll() : next(wait_ms - step_ms)), step_ms);
  };
  const poll = async (): Promise<void> => {
    const from_ms = performance.now();
    const state = await fetchState();
    // A slow network has room for the reports, too.
    const took_ms = performance.now() - from_ms;
    try {
      onState(state);
    } finally {
      if (state) next(Math.max(EVERY_MS, took_ms));
      else window.setTimeout(() => void poll(), EVERY_LOST_MS);
    }
  };
  void poll();
}

/** What is known of a mesh that the page shows. */
interface Shown {
  geometry: number;
  detailLevel: number;
}

/** The display meshes of one scene: fetches them one after the other when their shape has changed. */
export class Meshes {
  private readonly have = new Map<number, Shown>();
  private request: AbortController | undefined;
  private notBefore_ms = 0;
  private scene = 0;
  private objects: ObjectState[] = [];
  /** A known mesh had another shape in the last state. */
  private changed = false;

  constructor(
    private readonly onMesh: (object: number, mesh: DisplayMesh) => void,
    private readonly onGone: (object: number) => void,
  ) {}

  /** Whether meshes deform, and the last shape has come: a state before would make the request void. */
  get deform(): boolean {
    return this.changed && !this.request;
  }

  clear(): void {
    for (const id of this.have.keys()) this.onGone(id);
    this.have.clear();
    this.objects = [];
    // Its answer would be of another scene, and over a network that is gone it may never come.
    this.request?.abort();
    this.request = undefined;
  }

  update(scene: number, objects: ObjectState[]): void {
    this.scene = scene;
    this.objects = objects;
    this.changed = objects.some((o) => (this.have.get(o.id) ?? o).geometry !== o.geometry);
    const withMesh = new Set(objects.filter((o) => o.triangles > 0).map((o) => o.id));
    for (const id of [...this.have.keys()]) {
      if (withMesh.has(id)) continue;
      this.have.delete(id);
      this.onGone(id);
    }
    this.next();
  }

  private next(): void {
    const detailLevel = detailLevelOf(this.objects);
    const isShown = ({ id, geometry }: ObjectState): boolean => {
      const shown = this.have.get(id);
      return shown?.geometry === geometry && shown.detailLevel === detailLevel;
    };
    const missing = this.objects.find((o) => o.triangles > 0 && !isShown(o));
    if (missing && !this.request && performance.now() > this.notBefore_ms)
      void this.fetch(this.scene, missing, detailLevel);
  }

  // 503: still being simplified; 404: no longer there, or of another shape by now. A later state triggers the next attempt.
  private async fetch(scene: number, object: ObjectState, detailLevel: number): Promise<void> {
    const request = (this.request = new AbortController());
    const { signal } = request;
    let arrived = false;
    try {
      const url = `/api/mesh?scene=${scene}&object=${object.id}&geometry=${object.geometry}`;
      const response = await fetch(url, { signal });
      if (response.status !== 200) {
        if (response.status !== 404) this.notBefore_ms = performance.now() + RETRY_MS;
        return;
      }
      const mesh = decodeMesh(await response.arrayBuffer());
      if (signal.aborted) return;
      this.have.set(object.id, { geometry: object.geometry, detailLevel });
      this.onMesh(object.id, mesh);
      arrived = true;
    } catch {
      // pollState() reports that the server does not respond.
    } finally {
      if (this.request === request) this.request = undefined;
    }
    if (arrived) this.next(); // the state that follows is a quarter of a second away
  }
}

// Other objects reduce an object's share of the display triangles. The level changes, and the mesh is fetched again, when
// the size of the scene changes by half.
function detailLevelOf(objects: ObjectState[]): number {
  const all = objects.reduce((sum, o) => sum + o.triangles, 0);
  return Math.max(0, Math.round(Math.log(all / MAX_DISPLAY_TRIANGLES) / Math.log(1.5)));
}
