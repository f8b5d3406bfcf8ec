// The objects of the scene: touchable or not, their surface, removal.
import { clearTrimesh, type Outgoing, setHapticProperty, setObjectIsTouchable } from "../wire";
import type { DeviceState, ObjectState } from "../state_types";
import { countText, el, Rows, setText } from "./dom";
import { materialsOf, SurfaceForm } from "./surface";

type Send = (...messages: Outgoing[]) => void;

class ObjectRow {
  readonly root: HTMLElement;
  private readonly facts = el("span", { className: "quiet" });
  private readonly touchable = el("input", { type: "checkbox" });
  private readonly surface: SurfaceForm;
  private readonly details = el("details");

  constructor(
    id: number,
    send: Send,
    private readonly device: () => DeviceState,
  ) {
    this.touchable.ariaLabel = `Object ${id} is touchable`;
    this.touchable.addEventListener("change", () => send(setObjectIsTouchable(id, this.touchable.checked)));
    this.surface = new SurfaceForm((property, share) => send(setHapticProperty(id, property, share)));
    const remove = el("button", { type: "button", className: "small" }, "Remove the mesh");
    remove.addEventListener("click", () => send(clearTrimesh(id)));
    this.details.append(el("summary", {}, "Surface"), this.surface.root, remove);
    const head = el(
      "div",
      { className: "row" },
      el("strong", {}, `Object ${id}`),
      this.facts,
      el("label", { className: "switch" }, this.touchable, "touchable"),
    );
    this.root = el("li", { data: { object: String(id) } }, head, this.details);
  }

  update(o: ObjectState): void {
    const empty = o.triangles === 0;
    setText(
      this.facts,
      empty
        ? "no mesh"
        : `${countText(o.triangles)} triangles${o.stiffness_N_per_m > 0 ? "" : ", no stiffness: not felt"}`,
    );
    if (document.activeElement !== this.touchable || this.touchable.checked === o.touchable)
      this.touchable.checked = o.touchable;
    if (this.details.open) this.surface.update(o, materialsOf(this.device()));
  }
}

export class ObjectsPanel {
  private readonly list = el("ul", { className: "cards" });
  private readonly rows: Rows<ObjectState, ObjectRow>;

  constructor(parent: HTMLElement, send: Send, device: () => DeviceState) {
    this.rows = new Rows(
      this.list,
      (o) => o.id,
      (o) => new ObjectRow(o.id, send, device),
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
