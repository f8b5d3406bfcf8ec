// The forces of a tick by their source. The server reports those of contacts and of remote contacts; those of planes come with
// the contacts; those of force fields and the constraint follow from the scene; what is left belongs to the effects.
import type { ConstraintState, FieldState, SceneState } from "./state_types";
import type { Contact, Tick, Vec3 } from "./wire";

export interface RemoteContact {
  id: number;
  /** World units / 1000. */
  proxy: Vec3;
  force_N: Vec3;
  depth: number;
}

export interface SourceForce {
  name: string;
  /** World units. */
  at: Vec3;
  force_N: Vec3;
}

const LEAST_N = 0.02;
const length = (v: Vec3): number => Math.hypot(...v);
const scaled = (v: Vec3, by: number): Vec3 => [v[0] * by, v[1] * by, v[2] * by];
const sum = (a: Vec3, b: Vec3): Vec3 => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];

/** The name of an object for people. */
export function nameOfObject(scene: SceneState | undefined, id: number): string {
  const name = scene?.objects.find((o) => o.id === id)?.name;
  return name ? name : `object ${id}`;
}

/** Force of a field at a point in world units. */
export function fieldForce(field: FieldState, at: Vec3): Vec3 {
  const from: Vec3 = [at[0] - field.origin[0]!, at[1] - field.origin[1]!, at[2] - field.origin[2]!];
  if (field.radius !== null && length(from) > field.radius) return [0, 0, 0];
  const J = field.jacobian_N_per_unit;
  const row = (i: number): number =>
    field.force_N[i]! + J[3 * i]! * from[0] + J[3 * i + 1]! * from[1] + J[3 * i + 2]! * from[2];
  return [row(0), row(1), row(2)];
}

/** Force of the constraint at a point in world units; `metre`: device metres per world unit. */
export function constraintForce(c: ConstraintState, at: Vec3, metre: number): Vec3 {
  const away: Vec3 = [c.point[0]! - at[0], c.point[1]! - at[1], c.point[2]! - at[2]];
  const size = Math.hypot(...c.direction) || 1;
  const d = c.direction.map((x) => x / size);
  const along = away[0] * d[0]! + away[1] * d[1]! + away[2] * d[2]!;
  const on: Vec3 = [along * d[0]!, along * d[1]!, along * d[2]!];
  const pull: Vec3 = c.mode === "plane" ? on : c.mode === "line" ? sum(away, scaled(on, -1)) : away;
  return scaled(pull, c.stiffness_N_per_m * metre);
}

/** Running effects, by name. */
export const effectNames = (scene: SceneState | undefined): string[] =>
  (scene?.effects ?? []).filter((e) => e.active).map((e) => `effect ${e.index} (${e.type})`);

/**
 * The sources that push in this tick, each with its force before the guard where that is known. `scale`: world units of one
 * reported metre.
 */
export function feltForces(
  tick: Tick,
  contacts: Contact[],
  remote: RemoteContact[],
  scene: SceneState | undefined,
  scale: number,
): SourceForce[] {
  const hip = scaled(tick.hand, scale);
  const forces: SourceForce[] = [];
  if (tick.object >= 0 || tick.depth > 0) {
    for (const c of contacts) {
      const plane = scene?.planes.length === 1 ? `plane ${scene.planes[0]!.index}` : "planes";
      forces.push({
        name: c.object >= 0 ? nameOfObject(scene, c.object) : plane,
        at: scaled(c.point, scale),
        force_N: c.force_N,
      });
    }
  }
  for (const c of remote) forces.push({ name: `remote contact ${c.id}`, at: scaled(c.proxy, scale), force_N: c.force_N });
  for (const field of scene?.fields ?? []) forces.push({ name: "force field", at: hip, force_N: fieldForce(field, hip) });
  const c = scene?.constraint;
  if (c) forces.push({ name: `constraint (${c.mode})`, at: hip, force_N: constraintForce(c, hip, 1 / scale) });
  const effects = effectNames(scene);
  const written = tick.force_N;
  if (effects.length > 0 && length(written) > 0) {
    const known = forces.reduce((all, f) => sum(all, f.force_N), [0, 0, 0] as Vec3);
    forces.push({ name: effects.join(", "), at: hip, force_N: sum(written, scaled(known, -1)) });
  }
  return forces.filter((f) => length(f.force_N) >= LEAST_N);
}
