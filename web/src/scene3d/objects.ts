// The touchable objects: a mesh each, coloured by its surface.
import { type BufferGeometry, Color, DoubleSide, Group, Matrix4, Mesh, MeshLambertMaterial, Ray, Vector3 } from "three";
import { MeshBVH } from "three-mesh-bvh";
import type { DisplayMesh } from "../state";
import { isFelt, type ObjectState } from "../state_types";
import { colourOf, type Quantity, rangeOf } from "./colours";
import { coarse, smoothGeometry } from "./creases";

/** A mesh with more triangles is drawn with fewer while something moves, where drawing is slow. */
const COARSE_TRIANGLES = 9000;
/** Poses of the stream are newer than the polled state for this long. */
const STREAMED_MS = 900;

interface Shown {
  mesh: Mesh<BufferGeometry, MeshLambertMaterial>;
  fine: BufferGeometry;
  coarse: BufferGeometry | undefined;
  /** When the stream placed it last. */
  streamedAt_ms: number;
  /** None for a mesh without triangles. */
  bvh: MeshBVH | undefined;
  rim: { value: number };
  triangles: number;
}

const NOT_FELT = new Color("#8a9099");

/** Adds a light along the rim of a mesh, 0 or 1, which marks the touched object. */
function withRim(material: MeshLambertMaterial, colour: Color): { value: number } {
  const rim = { value: 0 };
  material.onBeforeCompile = (shader) => {
    shader.uniforms["rim"] = rim;
    shader.uniforms["rimColour"] = { value: colour };
    shader.fragmentShader = `uniform float rim;\nuniform vec3 rimColour;\n${shader.fragmentShader}`.replace(
      "#include <emissivemap_fragment>",
      "float facing = abs(dot(normalize(vViewPosition), normal));\ntotalEmissiveRadiance += rim * rimColour * (0.08 + 0.9 * pow(1.0 - facing, 3.0));",
    );
  };
  return rim;
}

export class Objects {
  readonly group = new Group();
  private readonly shown = new Map<number, Shown>();
  private states: ObjectState[] = [];
  private touched = -1;

  constructor(private readonly rimColour: Color) {}

  get triangles(): number {
    let sum = 0;
    for (const { triangles } of this.shown.values()) sum += triangles;
    return sum;
  }

  setMesh(id: number, display: DisplayMesh): void {
    this.remove(id);
    const geometry = smoothGeometry(display);
    const material = new MeshLambertMaterial({ side: DoubleSide });
    const mesh = new Mesh(geometry, material);
    mesh.matrixAutoUpdate = false;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    // Reorders the index of the geometry; the picture stays the same.
    const bvh = display.triangles.length > 0 ? new MeshBVH(geometry) : undefined;
    const rim = withRim(material, this.rimColour);
    rim.value = id === this.touched ? 1 : 0;
    const triangles = display.triangles.length / 3;
    const few = triangles > 2 * COARSE_TRIANGLES ? smoothGeometry(coarse(display, COARSE_TRIANGLES)) : undefined;
    this.shown.set(id, { mesh, fine: geometry, coarse: few, rim, bvh, triangles, streamedAt_ms: -Infinity });
  }

  /** Fewer triangles, or all. */
  set isCoarse(on: boolean) {
    for (const { mesh, fine, coarse } of this.shown.values()) mesh.geometry = (on && coarse) || fine;
  }

  /** Places objects as the servo had them in a tick. True when one of them is drawn. */
  place(poses: [object: number, matrix: number[]][], now_ms: number): boolean {
    let any = false;
    for (const [id, matrix] of poses) {
      const shown = this.shown.get(id);
      if (!shown) continue;
      shown.streamedAt_ms = now_ms;
      if (shown.mesh.matrix.elements.every((x, i) => x === matrix[i])) continue; // it rests
      shown.mesh.matrix.fromArray(matrix);
      shown.mesh.matrixWorldNeedsUpdate = true;
      any = true;
    }
    return any;
  }

  /** Centre of an object's mesh, in the frame of the mesh. */
  centreOf(id: number): Vector3 {
    const geometry = this.shown.get(id)?.fine;
    if (!geometry) return new Vector3();
    geometry.computeBoundingBox();
    return geometry.boundingBox!.getCenter(new Vector3());
  }

  /** Where the objects are drawn, T_world_mesh. */
  matrixOf(id: number): number[] | undefined {
    return this.shown.get(id)?.mesh.matrix.toArray();
  }

  remove(id: number): void {
    const shown = this.shown.get(id);
    if (!shown) return;
    this.group.remove(shown.mesh);
    shown.fine.dispose();
    shown.coarse?.dispose();
    shown.mesh.material.dispose();
    this.shown.delete(id);
  }

  /** Poses and colours. True when the picture changed. */
  update(states: ObjectState[], quantity: Quantity): boolean {
    this.states = states;
    const end = rangeOf(states, quantity);
    const now_ms = performance.now();
    let changed = false;
    for (const state of states) {
      const shown = this.shown.get(state.id);
      if (!shown) continue;
      const { mesh } = shown;
      if (now_ms - shown.streamedAt_ms > STREAMED_MS) {
        const place = new Matrix4().fromArray(state.T_world_object).multiply(new Matrix4().fromArray(state.T_object_mesh));
        changed ||= !place.equals(mesh.matrix);
        mesh.matrix.copy(place);
        mesh.matrixWorldNeedsUpdate = true;
      }
      const opaque = isFelt(state);
      const colour = opaque ? colourOf(state, quantity, end) : NOT_FELT;
      changed ||= !mesh.material.color.equals(colour) || mesh.material.transparent === opaque;
      mesh.material.color.copy(colour);
      if (mesh.material.transparent === opaque) mesh.material.needsUpdate = true;
      mesh.material.transparent = !opaque;
      mesh.material.opacity = opaque ? 1 : 0.35;
      mesh.material.depthWrite = opaque;
    }
    return changed;
  }

  /** Highlights the touched object; -1: none. True when the picture changed. */
  touch(id: number): boolean {
    if (id === this.touched) return false;
    this.touched = id;
    for (const [each, { rim }] of this.shown) rim.value = each === id ? 1 : 0;
    return true;
  }

  /** The first surface below a ray (unit direction, world units), with its normal; undefined when it meets none. */
  surface(ray: Ray): { point: Vector3; normal: Vector3 } | undefined {
    let best: { point: Vector3; normal: Vector3 } | undefined;
    for (const { bvh, mesh } of this.shown.values()) {
      if (!bvh) continue;
      const local = new Ray().copy(ray).applyMatrix4(mesh.matrix.clone().invert());
      const hit = bvh.raycastFirst(local, DoubleSide) as { point: Vector3; face: { normal: Vector3 } } | null;
      if (!hit) continue;
      const point = hit.point.clone().applyMatrix4(mesh.matrix);
      if (best && point.distanceTo(ray.origin) > best.point.distanceTo(ray.origin)) continue;
      const normal = hit.face.normal.clone().transformDirection(mesh.matrix);
      best = { point, normal: normal.dot(ray.direction) > 0 ? normal.negate() : normal };
    }
    return best;
  }

  /** Distance along the ray (unit direction, world units) to the first object that can be felt, or Infinity. */
  distance(ray: Ray): number {
    let best = Infinity;
    for (const state of this.states) {
      const shown = this.shown.get(state.id);
      if (shown?.bvh && isFelt(state)) best = Math.min(best, distanceTo(shown.bvh, ray, shown.mesh.matrix));
    }
    return best;
  }

  /** Whether an object that can be felt lies between two points. */
  between(from: Vector3, to: Vector3): boolean {
    const segment = to.clone().sub(from);
    const length = segment.length();
    return length > 0 && this.distance(new Ray(from, segment.divideScalar(length))) < length;
  }
}

function distanceTo(bvh: MeshBVH, ray: Ray, T_world_mesh: Matrix4): number {
  const local = new Ray().copy(ray).applyMatrix4(T_world_mesh.clone().invert());
  const hit = bvh.raycastFirst(local, DoubleSide) as { point: Vector3 } | null;
  return hit ? hit.point.clone().applyMatrix4(T_world_mesh).distanceTo(ray.origin) : Infinity;
}
