// Loads a mesh file that the user drops onto the page or chooses: reads, places and sends it, then waits for the server.
import { byId, countText, el, setText } from "./panels/dom";
import type { Link } from "./link";
import { readMeshBeside } from "./mesh/read_beside";
import { isMeshFile } from "./mesh/mesh_files";
import { Placing } from "./mesh/placing";
import { upload } from "./mesh/upload";
import type { FileMesh } from "./mesh/weld";
import type { View } from "./scene3d/view";
import type { DeviceState, ObjectState } from "./state_types";

export interface DropContext {
  link: Link;
  view: View;
  device(): DeviceState | undefined;
  objects(): ObjectState[];
}

export class DropMesh {
  private readonly panel = byId("drop-panel");
  private readonly message = el("p", { role: "status" });
  private readonly close = el("button", { type: "button", className: "small" }, "Close");
  private readonly bar = el("progress", { max: 1, value: 0, hidden: true });
  private placing: Placing | undefined;
  private awaited: { object: number; geometry: number; name: string } | undefined;

  constructor(private readonly context: DropContext) {
    this.close.addEventListener("click", () => (this.panel.hidden = true));
    this.panel.append(this.message, this.bar, this.close);
    const chooser = byId<HTMLInputElement>("mesh-file");
    byId("load-mesh").addEventListener("click", () => chooser.click());
    chooser.addEventListener("change", () => {
      void this.open([...(chooser.files ?? [])]);
      chooser.value = "";
    });
    byId("load-bunny").addEventListener("click", () => void this.loadBunny());
    document.addEventListener("dragover", (e) => {
      e.preventDefault();
      document.body.classList.add("dropping");
    });
    document.addEventListener("dragleave", (e) => {
      if (e.relatedTarget === null) document.body.classList.remove("dropping");
    });
    document.addEventListener("drop", (e) => {
      e.preventDefault();
      document.body.classList.remove("dropping");
      void this.open([...(e.dataTransfer?.files ?? [])]);
    });
  }

  /** Looks for the sent mesh in a new state. */
  update(objects: ObjectState[]): void {
    const loaded =
      this.awaited &&
      objects.find(
        (o) => o.id === this.awaited!.object && o.triangles > 0 && o.geometry !== this.awaited!.geometry,
      );
    if (!loaded) return;
    this.show(
      `${this.awaited!.name} is now object ${loaded.id} with ${countText(loaded.triangles)} triangles.`,
      "good",
    );
    this.awaited = undefined;
  }

  private async open(files: File[]): Promise<void> {
    if (files.length === 0) return;
    const device = this.context.device();
    this.panel.hidden = false;
    if (!device) return this.show("No device is connected yet: try again in a moment.", "bad");
    this.placing?.end();
    this.show(`Reading ${files[0]!.name} …`);
    await new Promise((resolve) => setTimeout(resolve, 30)); // lets the browser show the text first
    try {
      const { name, mesh } = await readMeshBeside(files);
      this.place(name, mesh, device);
      const others = files.filter((f) => f.name !== name && isMeshFile(f.name));
      if (others.length > 0)
        this.show(`One file at a time: ${others.map((f) => f.name).join(", ")} not loaded.`, "bad");
    } catch (error) {
      this.show((error as Error).message, "bad");
    }
  }

  /** The mesh that every server brings along, at its usual place. */
  private async loadBunny(): Promise<void> {
    const device = this.context.device();
    if (!device) return;
    this.panel.hidden = false;
    this.placing?.end();
    try {
      const response = await fetch("bunny.obj");
      if (!response.ok) throw new Error(`the server has no bunny (status ${response.status})`);
      const { mesh } = await readMeshBeside([new File([await response.blob()], "bunny.obj")]);
      const placing = new Placing("bunny.obj", mesh, this.context.view, device, this.context.objects());
      this.placing = placing;
      await this.load("bunny.obj", mesh, placing);
    } catch (error) {
      this.show((error as Error).message, "bad");
    }
  }

  private place(name: string, mesh: FileMesh, device: DeviceState): void {
    const placing = new Placing(name, mesh, this.context.view, device, this.context.objects());
    const load = el("button", { type: "submit", className: "primary" }, "Load into the scene");
    const cancel = el("button", { type: "button" }, "Cancel");
    cancel.addEventListener("click", () => {
      placing.end();
      this.panel.hidden = true;
    });
    placing.root.append(el("div", { className: "row" }, load, cancel));
    placing.root.addEventListener("submit", (e) => {
      e.preventDefault();
      void this.load(name, mesh, placing);
    });
    this.placing = placing;
    this.show("");
    this.panel.append(placing.root);
    load.focus();
  }

  private async load(name: string, mesh: FileMesh, placing: Placing): Promise<void> {
    const placement = placing.placement();
    const before = this.context.objects().find((o) => o.id === placement.object)?.geometry ?? -1;
    placing.end();
    this.bar.hidden = false;
    this.show(`Sending ${name} …`);
    try {
      await upload(this.context.link.channel(), mesh, placement, (share) => (this.bar.value = share));
      this.show(`${name} is sent; the server is processing it …`);
      this.awaited = { object: placement.object, geometry: before, name };
    } catch (error) {
      this.show(`${name}: ${(error as Error).message}`, "bad");
    }
    this.bar.hidden = true;
  }

  private show(text: string, level = ""): void {
    setText(this.message, text);
    this.message.dataset["level"] = level;
    this.close.hidden = level === "";
  }
}
