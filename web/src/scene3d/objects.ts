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
  type Vector3,
} from "three";
import type { DisplayMesh } from "../state";
import { felt, type ObjectState } from "../state_types";
import { type Quantity, rampColour, rangeOf, valueOf } from "./colours";
import { RayMesh } from "./ray_mesh";

interface Shown {
  mesh: Mesh<BufferGeometry, MeshStandardMaterial>;
  rays: RayMesh;
  rim: { value: number };
  triangles: number;
}

const NOT_FELT = new Color("#8a9099");

/** A light along the rim of a mesh, 0 or 1: for the object that is touched. */
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
    // Flat shading needs no normals, and shows the triangles that are felt.
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
    const rim = withRim(material, this.rimColour);
    rim.value = id === this.touched ? 1 : 0;
    this.shown.set(id, { mesh, rim, rays: new RayMesh(display), triangles: display.triangles.length / 3 });
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
      const isFelt = felt(state);
      mesh.material.color.copy(isFelt ? rampColour(valueOf(state, quantity) / end) : NOT_FELT);
      mesh.material.transparent = !isFelt;
      mesh.material.opacity = isFelt ? 1 : 0.35;
      mesh.material.depthWrite = isFelt;
    }
  }

  /** Highlights the object that is touched; -1: none. */
  touch(id: number): void {
    if (id === this.touched) return;
    this.touched = id;
    for (const [each, { rim }] of this.shown) rim.value = each === id ? 1 : 0;
  }

  /** Distance along the ray to what can be felt, or Infinity. */
  distance(ray: Ray): number {
    let best = Infinity;
    for (const state of this.states) {
      const shown = this.shown.get(state.id);
      if (shown && felt(state)) best = Math.min(best, shown.rays.distance(ray, shown.mesh.matrix));
    }
    return best;
  }

  /** Whether something that can be felt lies between two points. */
  between(from: Vector3, to: Vector3): boolean {
    const way = to.clone().sub(from);
    const length = way.length();
    return length > 0 && this.distance(new Ray(from, way.divideScalar(length))) < length;
  }
}
