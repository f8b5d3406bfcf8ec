// The objects of the scene: makes them touchable or not, edits their surface and placement, removes them.
import type { Vector3 } from "three";
import { clearTrimesh, type Outgoing, removeObject, setHapticProperty, setObjectIsTouchable } from "../wire";
import { colourOfObject } from "../scene3d/colours";
import type { ObjectState, SceneState } from "../state_types";
import { countText, el, Rows, setText } from "./dom";
import { PoseForm } from "./pose";
import { SurfaceForm } from "./surface";
import { Switch } from "./switch";

type Send = (...messages: Outgoing[]) => void;

const MOST_ROWS = 200;

interface Item {
  o: ObjectState;
  scene: SceneState;
}

class ObjectRow {
  readonly root: HTMLElement;
  private readonly name = el("strong");
  private readonly facts = el("span", { className: "quiet" });
  private readonly touchable: Switch;
  private readonly surface: SurfaceForm;
  private readonly pose: PoseForm;
  private readonly surfacePart = el("details");
  private readonly posePart = el("details");

  constructor(
    private readonly id: number,
    send: Send,
    centreOf: (id: number) => Vector3,
  ) {
    this.touchable = new Switch("touchable", `Object ${id} is touchable`, (on) =>
      send(setObjectIsTouchable(id, on)),
    );
    this.surface = new SurfaceForm((property, share) => send(setHapticProperty(id, property, share)));
    this.pose = new PoseForm(id, send, centreOf);
    const remove = el("button", { type: "button", className: "small", ariaLabel: `Remove object ${id}` }, "Remove");
    // Object 0 always exists: it becomes empty.
    remove.addEventListener("click", () => send(id === 0 ? clearTrimesh(id) : removeObject(id)));
    const surface = el("summary", {}, "Surface");
    const placement = el("summary", {}, "Placement");
    // At the click, not at the later "toggle": by then a quick hand has begun to type.
    surface.addEventListener("click", () => this.last && this.surface.update(this.last.o, this.last.scene.surface_at_1));
    placement.addEventListener("click", () => this.last && this.pose.update(this.last.o, this.last.scene));
    this.surfacePart.append(surface, this.surface.root);
    this.posePart.append(placement, this.pose.root, remove);
    const swatch = el("span", { className: "swatch", ariaHidden: "true" });
    swatch.style.background = `#${colourOfObject(id).getHexString()}`;
    const head = el("div", { className: "row" }, swatch, this.name, this.facts, this.touchable.root);
    this.root = el("li", { data: { object: String(id) } }, head, this.surfacePart, this.posePart);
  }

  private last: Item | undefined;

  update(item: Item): void {
    const { o, scene } = (this.last = item);
    const note = o.stiffness_N_per_m > 0 ? "" : ", no stiffness: cannot be felt";
    setText(this.name, o.name || `Object ${this.id}`);
    this.name.title = `Object ${this.id}`;
    setText(this.facts, o.triangles === 0 ? "no mesh" : `${countText(o.triangles)} triangles${note}`);
    this.touchable.update(o.touchable);
    if (this.surfacePart.open) this.surface.update(o, scene.surface_at_1);
    if (this.posePart.open) this.pose.update(o, scene);
  }
}

export class ObjectsPanel {
  private readonly list = el("ul", { className: "cards" });
  private readonly more = el("p", { className: "quiet" });
  private readonly rows: Rows<Item, ObjectRow>;

  constructor(parent: HTMLElement, send: Send, centreOf: (id: number) => Vector3) {
    this.rows = new Rows(
      this.list,
      ({ o }) => String(o.id),
      ({ o }) => new ObjectRow(o.id, send, centreOf),
      MOST_ROWS,
    );
    parent.append(this.list, this.more);
  }

  /** Another scene: what is being typed is about none of its objects. */
  clear(): void {
    this.rows.update([]);
  }

  update(scene: SceneState | undefined, touched: number): void {
    this.rows.update(scene ? scene.objects.map((o) => ({ o, scene })) : []);
    const left = (scene?.objects.length ?? 0) - MOST_ROWS;
    setText(this.more, left > 0 ? `and ${countText(left)} more` : "");
    for (const item of this.list.children)
      (item as HTMLElement).dataset["touched"] = String(
        (item as HTMLElement).dataset["object"] === String(touched),
      );
  }
}
