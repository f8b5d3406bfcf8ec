// Which objects the meshes of the page become, while some of them are on their way.
import type { ObjectState } from "../state_types";

type Known = Pick<ObjectState, "id" | "name" | "triangles" | "geometry">;

interface Sent {
  object: number;
  /** Of the object before. */
  geometry: number;
  name: string;
}

export interface UnderWay {
  /** It is not yet in the server's state. */
  isUnderWay(): boolean;
  takeBack(): void;
}

export class Targets {
  /** What is being sent, or was sent and is not yet in the server's state; in this order. */
  private readonly underWay: Sent[] = [];

  /** The object that a new mesh becomes: an empty one, which every scene starts with, or one more. */
  next(objects: Known[]): { object: number; isNew: boolean } {
    const taken = this.underWay.map((sent) => sent.object);
    const empty = objects.find((o) => o.triangles === 0 && !taken.includes(o.id));
    if (empty) return { object: empty.id, isNew: false };
    return { object: Math.max(-1, ...objects.map((o) => o.id), ...taken) + 1, isNew: true };
  }

  /** A mesh is being sent: its object is no place for another new one. */
  begin(object: number, name: string, objects: Known[]): UnderWay {
    const sent = { object, name, geometry: objects.find((o) => o.id === object)?.geometry ?? -1 };
    this.underWay.push(sent);
    return { isUnderWay: () => this.underWay.includes(sent), takeBack: () => this.end(sent) };
  }

  /** The meshes that are new in the server's state; `present`: the name there, another one if another program sent a mesh, too. */
  arrived(objects: Known[]): { name: string; present: string; object: number; triangles: number }[] {
    return [...this.underWay].flatMap((sent) => {
      const found = objects.find((o) => o.id === sent.object && o.triangles > 0 && o.geometry !== sent.geometry);
      if (!found) return [];
      this.end(sent);
      for (const later of this.underWay) if (later.object === found.id) later.geometry = found.geometry;
      return { name: sent.name, present: found.name, object: found.id, triangles: found.triangles };
    });
  }

  /** After the connection or the scene has changed, nothing of it arrives. */
  clear(): void {
    this.underWay.length = 0;
  }

  private end(sent: Sent): void {
    const at = this.underWay.indexOf(sent);
    if (at >= 0) this.underWay.splice(at, 1);
  }
}
