// Sends a mesh to the server in a batch, so that it appears in one tick or not at all.
import * as wire from "../wire";
import type { Channel } from "../link";
import type { FileMesh } from "./weld";

const MAX_QUEUED_BYTES = 1_000_000;

export interface Placement {
  object: number;
  /** Of the file, for people. */
  name: string;
  /** The object does not exist yet: the scene must first grow to hold it. */
  isNew: boolean;
  /** As setTransformMatrix() takes it: below the parent, in units of the object. */
  matrix: number[];
  surface: [wire.SurfaceProperty, number][];
}

const pause = (ms: number): Promise<void> => new Promise((resolve) => setTimeout(resolve, ms));

/** Sends the mesh; calls back with the sent share from 0 to 1. Throws when the connection is lost. */
export async function upload(
  channel: Channel,
  mesh: FileMesh,
  to: Placement,
  onShare: (share: number) => void,
): Promise<void> {
  const { object } = to;
  const lost = "the connection was lost; the server discarded the mesh";
  const send = (...messages: wire.Outgoing[]): void => {
    if (!channel.send(...messages)) throw new Error(lost);
  };
  // What waits in a socket that has ended waits for ever.
  const drain = async (most: number, every_ms: number): Promise<void> => {
    while (channel.waiting > most) {
      if (!channel.open) throw new Error(lost);
      await pause(every_ms);
    }
  };
  // Another page may have sent a mesh to the same new object meanwhile: two meshes would become one.
  send(wire.batchBegin(), ...(to.isNew ? [wire.setObjectNumber(object + 1)] : []), wire.clearTrimesh(object));
  send(wire.setObjectName(object, to.name));
  send(wire.setTransformMatrix(object, to.matrix), wire.setObjectIsTouchable(object, true));
  for (const [property, value] of to.surface) send(wire.setHapticProperty(object, property, value));
  const step = 3 * wire.MOST_IN_ONE_MESSAGE;
  const all = mesh.positions.length + mesh.triangles.length;
  const part = async (first: number, message: wire.Outgoing, sent: number): Promise<void> => {
    send(message);
    await drain(MAX_QUEUED_BYTES, 5);
    if (first % (8 * step) === 0) {
      onShare(sent / all);
      await pause(0); // lets the page respond to the user
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
  await drain(0, 20);
  onShare(1);
}
