// Loads a mesh file that the user drops onto the page or chooses: reads, places and sends it, then waits for the server.
import { byId, countText, el, setText } from "./panels/dom";
import type { Channel, Link } from "./link";
import { readMeshBeside } from "./mesh/read_beside";
import { isMeshFile } from "./mesh/mesh_files";
import { Placing } from "./mesh/placing";
import { Targets, type UnderWay } from "./mesh/targets";
import { upload } from "./mesh/upload";
import type { FileMesh } from "./mesh/weld";
import { toast } from "./notice";
import { objectName } from "./wire";
import type { View } from "./scene3d/view";
import type { DeviceState, ObjectState, SceneState } from "./state_types";

export interface DropContext {
  link: Link;
  view: View;
  device(): DeviceState | undefined;
  scene(): SceneState | undefined;
  /** The server replays a recording, whose scene is as it was. */
  replays(): boolean;
}

export class DropMesh {
  private readonly panel = byId("drop-panel");
  private readonly message = el("p", { role: "status" });
  private readonly close = el("button", { type: "button", className: "small" }, "Close");
  private readonly bar = el("progress", { max: 1, value: 0, hidden: true });
  private placing: Placing | undefined;
  private readonly targets = new Targets();
  /** Of the newest choice of a file: one that is still being read is given up for it. */
  private choice = new AbortController();
  /** Ends with the upload that was asked for last. */
  private uploads: Promise<void> = Promise.resolve();
  /** The mesh that was sent last. */
  private last: { name: string; way: UnderWay } | undefined;
  /** The mesh that is being sent; empty: none. */
  sending = "";

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

  /** Looks for the sent meshes in a new state. */
  update(objects: ObjectState[]): void {
    for (const { name, present, object, triangles } of this.targets.arrived(objects)) {
      if (present === objectName(name))
        this.show(`${name} is now object ${object} with ${countText(triangles)} triangles.`, "good");
      else this.show(`${name} was sent, but another program made ${present || "another mesh"} of object ${object}.`, "bad");
    }
  }

  /** The connection was lost, or the states that follow are of another scene. */
  clear(): void {
    const unseen = this.last?.way.isUnderWay() ? this.last.name : "";
    this.targets.clear();
    if (unseen !== "")
      this.show(`${unseen}: the connection or the scene changed before it was seen there. Load it again if it is missing.`, "bad");
  }

  /** A mesh that is being placed was placed in the workspace of another device, or in another scene. */
  endPreview(): void {
    if (!this.placing?.root.isConnected) return;
    this.placing.end();
    this.choose();
    this.show("This is another scene: drop the file again.", "bad");
  }

  /** The server refused the batch of the mesh that was sent last, with a text for each kind of message in it. */
  refused(why: string): void {
    if (!this.last?.way.isUnderWay()) return;
    this.last.way.takeBack();
    this.show(`${this.last.name}: ${why}`, "bad");
  }

  private async open(files: File[]): Promise<void> {
    if (files.length === 0) return;
    if (this.context.replays()) return toast("This server replays a recording: nothing can be loaded into its scene.", 1);
    const device = this.context.device();
    this.panel.hidden = false;
    if (!device) return this.show("No device is connected yet: try again in a moment.", "bad");
    this.placing?.end();
    const choice = this.choose();
    this.show(`Reading ${files[0]!.name} …`);
    await new Promise((resolve) => setTimeout(resolve, 30)); // lets the browser show the text first
    if (choice.aborted) return;
    try {
      const { name, mesh } = await readMeshBeside(files, choice);
      if (choice.aborted) return;
      this.place(name, mesh, device);
      const others = files.filter((f) => f.name !== name && isMeshFile(f.name));
      if (others.length > 0)
        this.show(`One file at a time: ${others.map((f) => f.name).join(", ")} not loaded.`, "bad");
    } catch (error) {
      if (!choice.aborted) this.show((error as Error).message, "bad");
    }
  }

  private choose(): AbortSignal {
    this.choice.abort();
    this.choice = new AbortController();
    return this.choice.signal;
  }

  /** The mesh that every server brings along, at its usual place. */
  private async loadBunny(): Promise<void> {
    const device = this.context.device();
    if (!device) return;
    this.panel.hidden = false;
    this.placing?.end();
    const choice = this.choose();
    try {
      const response = await fetch("bunny.obj");
      if (!response.ok) throw new Error(`the server has no bunny (status ${response.status})`);
      const { mesh } = await readMeshBeside([new File([await response.blob()], "bunny.obj")], choice);
      if (choice.aborted) return;
      this.load("bunny.obj", mesh, this.newPlacing("bunny.obj", mesh, device));
    } catch (error) {
      if (!choice.aborted) this.show((error as Error).message, "bad");
    }
  }

  private newPlacing(name: string, mesh: FileMesh, device: DeviceState): Placing {
    const scene = this.context.scene();
    const { object } = this.targets.next(scene?.objects ?? []);
    return (this.placing = new Placing(name, mesh, this.context.view, device, scene, object));
  }

  private place(name: string, mesh: FileMesh, device: DeviceState): void {
    const placing = this.newPlacing(name, mesh, device);
    const load = el("button", { type: "submit", className: "primary" }, "Load into the scene");
    const cancel = el("button", { type: "button" }, "Cancel");
    cancel.addEventListener("click", () => {
      placing.end();
      this.panel.hidden = true;
    });
    placing.root.append(el("div", { className: "row" }, load, cancel));
    placing.root.addEventListener("submit", (e) => {
      e.preventDefault();
      this.load(name, mesh, placing);
    });
    this.show("");
    this.panel.append(placing.root);
    load.focus();
  }

  // One mesh after the other: within a connection the server takes everything between begin and commit of a batch as one.
  private load(name: string, mesh: FileMesh, placing: Placing): void {
    placing.end();
    const channel = this.context.link.channel();
    const device = this.context.device()?.name;
    if (this.sending !== "") this.show(`${name} waits until ${this.sending} is sent …`);
    this.uploads = this.uploads.then(() => this.send(name, mesh, placing, channel, device));
  }

  private async send(name: string, mesh: FileMesh, placing: Placing, channel: Channel, device?: string): Promise<void> {
    const scene = this.context.scene();
    const objects = scene?.objects ?? [];
    const removed = placing.removedTarget(objects);
    if (removed !== undefined) return this.show(`${name}: object ${removed} was removed. Drop the file again.`, "bad");
    const placement = placing.placement(this.targets.next(objects), scene);
    const way = this.targets.begin(placement.object, name, objects);
    this.last = { name, way };
    this.sending = name;
    this.bar.value = 0;
    this.bar.hidden = false;
    this.show(`Sending ${name} …`);
    try {
      if (this.context.device()?.name !== device) throw new Error("another device was chosen before it could be sent");
      await upload(channel, mesh, placement, (share) => (this.bar.value = share));
      // A small mesh may be in the server's state before its last bytes are known to have left.
      if (way.isUnderWay()) this.show(`${name} is sent; the server is processing it …`, "waiting");
    } catch (error) {
      way.takeBack();
      const text = `${name}: ${(error as Error).message}`;
      this.show(text, "bad");
      toast(text, 2); // the text of the next upload replaces the other
    }
    this.bar.hidden = true;
    this.sending = "";
    await channel.read(); // a refusal of this one is none of the next
  }

  private show(text: string, level = ""): void {
    setText(this.message, text);
    this.message.dataset["level"] = level;
    this.close.hidden = level === "";
    if (level === "bad") this.panel.hidden = false;
  }
}
