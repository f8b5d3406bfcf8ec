// Sends a mesh to the server in a batch, so that it appears in one tick or not at all.
import * as wire from "../wire";
import type { Link } from "../link";
import type { FileMesh } from "./weld";

const MAX_QUEUED_BYTES = 1_000_000;

export interface Placement {
  object: number;
  /** Of the file, for people. */
  name: string;
  /** The object does not exist yet: the scene must first grow to hold it. */
  isNew: boolean;
  T_world_mesh: number[];
  surface: [wire.SurfaceProperty, number][];
}

/** Sends the mesh; calls back with the sent share from 0 to 1. Throws when the connection is lost. */
export async function upload(
  link: Link,
  mesh: FileMesh,
  to: Placement,
  onShare: (share: number) => void,
): Promise<void> {
  const { object } = to;
  const send = (...messages: wire.Outgoing[]): void => {
    if (!link.send(...messages))
      throw new Error("the connection was lost; the server discarded the mesh");
  };
  send(wire.batchBegin(), ...(to.isNew ? [wire.setObjectNumber(object + 1)] : [wire.clearTrimesh(object)]));
  send(wire.setObjectName(object, to.name));
  send(wire.setTransformMatrix(object, to.T_world_mesh), wire.setObjectIsTouchable(object, true));
  for (const [property, value] of to.surface) send(wire.setHapticProperty(object, property, value));
  const step = 3 * wire.MOST_IN_ONE_MESSAGE;
  const all = mesh.positions.length + mesh.triangles.length;
  const part = async (first: number, message: wire.Outgoing, sent: number): Promise<void> => {
    send(message);
    while (link.waiting > MAX_QUEUED_BYTES) await new Promise((resolve) => setTimeout(resolve, 5));
    if (first % (8 * step) === 0) {
      onShare(sent / all);
      await new Promise((resolve) => setTimeout(resolve, 0)); // lets the page respond to the user
    }
  };
  for (let i = 0; i < mesh.positions.length; i += step)
    await part(i, wire.meshVertices(object, i / 3, mesh.positions.subarray(i, i + step)), i);
  for (let i = 0; i < mesh.triangles.length; i += step) {
    await part(
      i,
      wire.meshTriangles(object, i / 3, mesh.triangles.subarray(i, i + step)),
      mesh.positions.length + i,
    );
  }
  send(wire.batchCommit());
  while (link.waiting > 0) await new Promise((resolve) => setTimeout(resolve, 20));
  onShare(1);
}
