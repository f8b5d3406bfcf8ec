// The touchable objects: a mesh each, coloured by its surface.
import {
  BufferAttribute,
  BufferGeometry,
  Color,
  DoubleSide,
  Group,
  Matrix4,
  Mesh,
  MeshStandardMaterial,
  Ray,
  Vector3,
} from "three";
import { MeshBVH } from "three-mesh-bvh";
import type { DisplayMesh } from "../state";
import { isFelt, type ObjectState } from "../state_types";
import { type Quantity, rampColour, rangeOf, valueOf } from "./colours";

interface Shown {
  mesh: Mesh<BufferGeometry, MeshStandardMaterial>;
  /** None for a mesh without triangles. */
  bvh: MeshBVH | undefined;
  rim: { value: number };
  triangles: number;
}

const NOT_FELT = new Color("#8a9099");

/** Adds a light along the rim of a mesh, 0 or 1, which marks the touched object. */
function withRim(material: MeshStandardMaterial, colour: Color): { value: number } {
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
    const geometry = new BufferGeometry();
    geometry.setAttribute("position", new BufferAttribute(display.positions, 3));
    geometry.setIndex(new BufferAttribute(display.triangles, 1));
    // Flat shading needs no normals and shows the triangles.
    const material = new MeshStandardMaterial({
      flatShading: true,
      roughness: 0.75,
      metalness: 0,
      side: DoubleSide,
    });
    const mesh = new Mesh(geometry, material);
    mesh.matrixAutoUpdate = false;
    mesh.frustumCulled = false;
    this.group.add(mesh);
    // Reorders the index of the geometry; the picture stays the same.
    const bvh = display.triangles.length > 0 ? new MeshBVH(geometry) : undefined;
    const rim = withRim(material, this.rimColour);
    rim.value = id === this.touched ? 1 : 0;
    this.shown.set(id, { mesh, rim, bvh, triangles: display.triangles.length / 3 });
  }

  remove(id: number): void {
    const shown = this.shown.get(id);
    if (!shown) return;
    this.group.remove(shown.mesh);
    shown.mesh.geometry.dispose();
    shown.mesh.material.dispose();
    this.shown.delete(id);
  }

  /** Poses and colours. */
  update(states: ObjectState[], quantity: Quantity): void {
    this.states = states;
    const end = rangeOf(states, quantity);
    for (const state of states) {
      const shown = this.shown.get(state.id);
      if (!shown) continue;
      const { mesh } = shown;
      mesh.matrix.fromArray(state.T_world_object).multiply(new Matrix4().fromArray(state.T_object_mesh));
      mesh.matrixWorldNeedsUpdate = true;
      const opaque = isFelt(state);
      mesh.material.color.copy(opaque ? rampColour(valueOf(state, quantity) / end) : NOT_FELT);
      mesh.material.transparent = !opaque;
      mesh.material.opacity = opaque ? 1 : 0.35;
      mesh.material.depthWrite = opaque;
    }
  }

  /** Highlights the touched object; -1: none. */
  touch(id: number): void {
    if (id === this.touched) return;
    this.touched = id;
    for (const [each, { rim }] of this.shown) rim.value = each === id ? 1 : 0;
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
