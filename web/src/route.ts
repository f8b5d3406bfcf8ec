// A way for the hand around objects: straight through one it would get stuck, the proxy on the near side, the hand on the far one.
import { type Box3, Matrix4, Ray, Vector3 } from "three";

export interface Room {
  /** What the device reaches, in its own axes: y is up. */
  reach: Box3;
  T_world_device: Matrix4;
  /** Whether an object lies between two points of the world. */
  blocked(from: Vector3, to: Vector3): boolean;
}

/** Waypoints from a place in the open to one that is open towards `viewer`; none when the straight way is free. */
export function wayAround(from: Vector3, to: Vector3, viewer: Vector3, room: Room): Vector3[] {
  if (!room.blocked(from, to)) return [];
  const axis = (i: number): Vector3 => new Vector3().setFromMatrixColumn(room.T_world_device, i).normalize();
  const [side, up] = [axis(0), axis(1)];
  const ways = [up, viewer, side, side.clone().negate(), viewer.clone().negate(), up.clone().negate()];
  const exits = ways.map((way) => exitOf(from, way, room));
  const out = exits.find((exit) => !room.blocked(from, exit)) ?? exits[0]!;
  const before = exitOf(to, viewer, room);
  return [from, out, above(out, room), above(before, room), before, to];
}

/** Where a straight way leaves what the device reaches. */
function exitOf(from: Vector3, way: Vector3, room: Room): Vector3 {
  const T_device_world = room.T_world_device.clone().invert();
  const inside = room.reach.clampPoint(from.clone().applyMatrix4(T_device_world), new Vector3());
  const ray = new Ray(inside, way.clone().transformDirection(T_device_world));
  // From inside the box the meeting is where the ray leaves it.
  const exit = ray.intersectBox(room.reach, new Vector3()) ?? inside;
  return exit.applyMatrix4(room.T_world_device);
}

/** The same place at the upper end of the reach. */
function above(point: Vector3, room: Room): Vector3 {
  const local = point.clone().applyMatrix4(room.T_world_device.clone().invert());
  return local.setY(room.reach.max.y).applyMatrix4(room.T_world_device);
}
