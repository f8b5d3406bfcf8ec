// The objects of the scene: makes them touchable or not, edits their surface, removes their mesh.
import { clearTrimesh, type Outgoing, setHapticProperty, setObjectIsTouchable } from "../wire";
import type { ObjectState } from "../state_types";
import { countText, el, Rows, setText } from "./dom";
import { SurfaceForm } from "./surface";
import { Switch } from "./switch";

type Send = (...messages: Outgoing[]) => void;

class ObjectRow {
  readonly root: HTMLElement;
  private readonly facts = el("span", { className: "quiet" });
  private readonly touchable: Switch;
  private readonly surface: SurfaceForm;
  private readonly details = el("details");

  constructor(id: number, send: Send) {
    this.touchable = new Switch("touchable", `Object ${id} is touchable`, (on) =>
      send(setObjectIsTouchable(id, on)),
    );
    this.surface = new SurfaceForm((property, share) => send(setHapticProperty(id, property, share)));
    const remove = el("button", { type: "button", className: "small" }, "Remove mesh");
    remove.addEventListener("click", () => send(clearTrimesh(id)));
    this.details.append(el("summary", {}, "Surface"), this.surface.root, remove);
    const head = el(
      "div",
      { className: "row" },
      el("strong", {}, `Object ${id}`),
      this.facts,
      this.touchable.root,
    );
    this.root = el("li", { data: { object: String(id) } }, head, this.details);
  }

  update(o: ObjectState): void {
    const note = o.stiffness_N_per_m > 0 ? "" : ", no stiffness: cannot be felt";
    setText(this.facts, o.triangles === 0 ? "no mesh" : `${countText(o.triangles)} triangles${note}`);
    this.touchable.update(o.touchable);
    if (this.details.open) this.surface.update(o);
  }
}

export class ObjectsPanel {
  private readonly list = el("ul", { className: "cards" });
  private readonly rows: Rows<ObjectState, ObjectRow>;

  constructor(parent: HTMLElement, send: Send) {
    this.rows = new Rows(
      this.list,
      (o) => String(o.id),
      (o) => new ObjectRow(o.id, send),
    );
    parent.append(this.list);
  }

  update(objects: ObjectState[], touched: number): void {
    this.rows.update(objects);
    for (const item of this.list.children)
      (item as HTMLElement).dataset["touched"] = String(
        (item as HTMLElement).dataset["object"] === String(touched),
      );
  }
}
