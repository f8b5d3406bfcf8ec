// A route for the HIP around objects. On a straight path through an object it would get stuck: the proxy on the near side, the
// HIP on the far side.
import { type Box3, Matrix4, Ray, Vector3 } from "three";

export interface Surroundings {
  /** In the frame of the device, whose y axis is up; metres. */
  workspace: Box3;
  T_world_device: Matrix4;
  /** Whether an object lies between two points in the world. */
  blocked(from: Vector3, to: Vector3): boolean;
}

/** Waypoints from a free point to one that is free in the direction `viewer`; none when the straight path is free. */
export function routeAround(from: Vector3, to: Vector3, viewer: Vector3, surroundings: Surroundings): Vector3[] {
  if (!surroundings.blocked(from, to)) return [];
  const axis = (i: number): Vector3 => new Vector3().setFromMatrixColumn(surroundings.T_world_device, i).normalize();
  const [side, up] = [axis(0), axis(1)];
  const directions = [up, viewer, side, side.clone().negate(), viewer.clone().negate(), up.clone().negate()];
  const exits = directions.map((direction) => exitOf(from, direction, surroundings));
  const out = exits.find((exit) => !surroundings.blocked(from, exit)) ?? exits[0]!;
  const before = exitOf(to, viewer, surroundings);
  return [from, out, raised(out, surroundings), raised(before, surroundings), before, to];
}

/** The point where a straight path leaves the workspace. */
function exitOf(from: Vector3, direction: Vector3, surroundings: Surroundings): Vector3 {
  const T_device_world = surroundings.T_world_device.clone().invert();
  const inside = surroundings.workspace.clampPoint(from.clone().applyMatrix4(T_device_world), new Vector3());
  const ray = new Ray(inside, direction.clone().transformDirection(T_device_world));
  // From inside a box the intersection is the point where the ray leaves it.
  const exit = ray.intersectBox(surroundings.workspace, new Vector3()) ?? inside;
  return exit.applyMatrix4(surroundings.T_world_device);
}

/** The same point moved to the top of the workspace. */
function raised(point: Vector3, surroundings: Surroundings): Vector3 {
  const local = point.clone().applyMatrix4(surroundings.T_world_device.clone().invert());
  return local.setY(surroundings.workspace.max.y).applyMatrix4(surroundings.T_world_device);
}
