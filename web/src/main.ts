// The page: everything that it shows, and what connects the parts.
import { Box3, Matrix4, Vector3 } from "three";
import "uplot/dist/uPlot.min.css";
import "./viewer.css";
import { DropMesh } from "./drop_mesh";
import { type DragMode, Hand, type HandNow } from "./hand";
import { Link } from "./link";
import { LivePlots } from "./live_plots";
import { showNotice, toast } from "./notice";
import { ClientsPanel } from "./panels/clients";
import { byId, setText } from "./panels/dom";
import { EffectsPanel } from "./panels/effects";
import { GuardPanel } from "./panels/guard";
import { ObjectsPanel } from "./panels/objects";
import { css } from "./plots/plot";
import { type Quantity, rampCss, rangeOf } from "./scene3d/colours";
import { View } from "./scene3d/view";
import { Meshes, pollState } from "./state";
import type { DeviceState, ObjectState, SceneState, ServerState } from "./state_types";
import { startTheme } from "./theme";
import * as wire from "./wire";

const REPORTS_HZ = 125;
const STOPPED = 1 << 13;
const READOUT_MS = 80;

class Page {
  private state: ServerState | undefined;
  private device: DeviceState | undefined;
  private scene: SceneState | undefined;
  private tick: wire.Tick | undefined;
  private contacts: wire.Contact[] = [];
  private fresh = false;
  private readoutAt = 0;
  private answers = true;
  /** How many were drawn. */
  frames = 0;

  private readonly view = new View(byId<HTMLCanvasElement>("view"));
  private readonly link = new Link(
    () => this.linkChanged(),
    (message, age_s) => this.received(message, age_s),
  );
  private readonly plots = new LivePlots();
  private readonly hand = new Hand(
    this.view,
    (m) => this.link.send(m),
    () => this.handNow(),
    () => this.showHand(),
  );
  private readonly meshes = new Meshes(
    (id, mesh) => this.setMesh(() => this.view.objects.setMesh(id, mesh)),
    (id) => this.setMesh(() => this.view.objects.remove(id)),
  );
  private readonly drop = new DropMesh({
    link: this.link,
    view: this.view,
    device: () => this.device,
    objects: () => this.objects(),
  });
  private readonly guard = new GuardPanel(byId("guard"));
  private readonly clients = new ClientsPanel(byId("clients"));
  private readonly objectsPanel = new ObjectsPanel(byId("objects"), (...m) => this.send(...m));
  private readonly effects = new EffectsPanel(byId("effects"), (...m) => this.send(...m));
  private readonly deviceChoice = byId<HTMLSelectElement>("device");
  private readonly quantity = byId<HTMLSelectElement>("quantity");

  start(): void {
    startTheme(() => this.restyle());
    byId("ramp").style.background = rampCss();
    this.bindControls();
    this.showNotice();
    pollState((state) => this.stateCame(state));
    const frame = (time_ms: number): void => {
      this.frame(time_ms);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  private bindControls(): void {
    byId("stop").addEventListener("click", () => this.stop());
    byId("rearm").addEventListener("click", () => this.send(wire.rearmForces()));
    byId("home").addEventListener("click", () => this.view.home());
    byId("let-go").addEventListener("click", () => this.hand.letGo());
    this.quantity.addEventListener("change", () => this.showObjects());
    this.deviceChoice.addEventListener("change", () => this.chooseDevice(this.deviceChoice.value));
    byId("drag-is").addEventListener("change", (e) => this.chooseDrag((e.target as HTMLInputElement).value));
    window.addEventListener("keydown", (e) => this.key(e), { capture: true });
  }

  private key(e: KeyboardEvent): void {
    if (e.key === "Escape") return this.stop();
    const typing = e.target instanceof HTMLElement && e.target.matches("input[type=number], select");
    if (!typing && e.key.toLowerCase() === "l" && !e.ctrlKey && !e.metaKey && !e.altKey) this.hand.letGo();
  }

  private stop(): void {
    if (!this.link.send(wire.stopForces()))
      toast("Not connected: the stop did not reach the server. Use the device's own switch.", 2);
  }

  private send(...messages: wire.Outgoing[]): void {
    if (!this.link.send(...messages)) toast("Not connected: nothing was sent.", 2);
  }

  private chooseDrag(value: string): void {
    const camera = value === "camera";
    this.view.handOnLeft(!camera);
    this.hand.enabled = !camera;
    if (!camera) this.hand.mode = value as DragMode;
    this.showHand();
  }

  private restyle(): void {
    this.view.setBackground(css("--view"));
    this.view.markers.setColours({
      hand: css("--hand"),
      proxy: css("--proxy"),
      force: css("--force"),
      normal: css("--normal"),
      box: css("--box"),
    });
    this.plots.restyle();
  }

  // What the server says four times a second.

  private stateCame(state: ServerState | undefined): void {
    this.answers = state !== undefined;
    if (state) {
      this.state = state;
      this.showDevices(state.devices);
      const device = state.devices.find((d) => d.name === this.deviceChoice.value) ?? state.devices[0];
      if (device && !this.device) this.link.connect(device.name);
      this.device = device;
      this.scene = device && state.scenes[device.scene];
      if (device) this.show(device, state);
    }
    this.showNotice();
  }

  private show(device: DeviceState, state: ServerState): void {
    this.view.setDevice(device);
    this.guard.update(device);
    this.clients.update(state.clients);
    this.effects.update(this.scene?.effects ?? []);
    this.plots.state(device, performance.now() / 1000);
    this.meshes.update(device.scene, this.objects());
    this.showObjects();
    this.drop.update(this.objects());
    this.showArmed(device.guard.stopped || device.guard.latched.length > 0);
    this.showHand();
    const { server } = state;
    byId("recording").hidden = server.recording === null;
    setText(byId("recording"), `● ${server.recording ?? ""}`);
    setText(
      byId("about"),
      `hapticd ${server.version}, ${device.driver} at ${device.rate_Hz} Hz${device.realtime ? "" : ", not realtime"}, up for ${durationText(server.uptime_s)}`,
    );
  }

  private objects(): ObjectState[] {
    return this.scene?.objects ?? [];
  }

  private showObjects(): void {
    const quantity = this.quantity.value as Quantity;
    this.view.objects.update(this.objects(), quantity);
    this.objectsPanel.update(this.objects(), this.tick?.object ?? -1);
    setText(byId("legend-to"), quantity === "stiffness" ? `${rangeOf(this.objects(), quantity)} N/m` : "1");
    this.view.invalidate();
  }

  private setMesh(change: () => void): void {
    change();
    this.showObjects();
  }

  private showDevices(devices: DeviceState[]): void {
    const names = devices.map((d) => d.name);
    if (names.join("\n") === [...this.deviceChoice.options].map((o) => o.value).join("\n")) return;
    const chosen = this.deviceChoice.value;
    this.deviceChoice.replaceChildren(...names.map((name) => new Option(name, name, false, name === chosen)));
  }

  private chooseDevice(name: string): void {
    this.hand.letGo();
    this.link.use(name);
    this.meshes.clear();
    this.tick = undefined;
    this.subscribe();
  }

  private showNotice(): void {
    const noDevice = this.state?.devices.length === 0;
    if (this.link.state === "lost" || (!this.answers && this.state)) return showNotice("lost");
    if (noDevice) return showNotice("no device");
    if (!this.device || this.link.state === "connecting") return showNotice("connecting");
    showNotice(
      this.objects().some((o) => o.triangles > 0) || (this.scene?.planes.length ?? 0) > 0 ? "" : "empty",
    );
  }

  // The connection.

  private linkChanged(): void {
    const label = byId("link");
    document.body.classList.toggle("lost", this.link.state === "lost");
    const { state } = this.link;
    setText(label, state === "open" ? "connected" : state);
    label.dataset["level"] = state === "open" ? "good" : state === "lost" ? "bad" : "";
    if (state === "open") this.subscribe();
    if (state === "lost") {
      this.hand.lost();
      for (const id of ["force", "depth", "touching"]) setText(byId(id), "–");
      this.meshes.clear(); // another server may come, and number its shapes alike
    }
    this.showNotice();
  }

  private subscribe(): void {
    this.link.send(wire.subscribe(wire.REPORT_TICK | wire.REPORT_CONTACTS | wire.REPORT_BUTTON, REPORTS_HZ));
  }

  private received(message: wire.Incoming, age_s: number): void {
    if (this.device && !this.device.names.includes(message.device)) return;
    switch (message.name) {
      case wire.TICK:
        return this.tickCame(wire.decodeTick(message.payload), age_s);
      case wire.CONTACTS:
        this.contacts = wire.decodeContacts(message.payload);
        return;
      case wire.GUARD_STATE: {
        const guard = wire.decodeGuardState(message.payload);
        return this.showArmed(guard.stopped || guard.latched !== 0);
      }
      case wire.TEXT:
        return this.textCame(wire.decodeText(message.payload));
    }
  }

  private tickCame(tick: wire.Tick, age_s: number): void {
    this.tick = tick;
    this.fresh = true;
    this.plots.tick(tick, Math.hypot(...tick.force_N), this.depth_mm(tick), age_s * 1000);
  }

  private textCame({ severity, text }: wire.ServerText): void {
    if (text.startsWith("Hold_Hand refused")) this.hand.lost();
    toast(text, severity);
  }

  // The hand.

  /** World units in a millimetre of the device. */
  private unit(): number {
    return this.device ? new Matrix4().fromArray(this.device.T_world_device).getMaxScaleOnAxis() / 1000 : 1;
  }

  private depth_mm(tick: wire.Tick): number {
    return (tick.depth * (this.device?.world_per_reported ?? 1000)) / this.unit();
  }

  private handNow(): HandNow | undefined {
    const { tick, device } = this;
    if (!tick || !device?.simulated || this.link.state !== "open") return undefined;
    const unit = this.unit();
    const clear = this.view.markers.world(tick.proxy);
    for (const contact of this.contacts) clear.addScaledVector(new Vector3(...contact.normal), 2 * unit);
    const { min, max } = device.workspace_m;
    const room = {
      reach: new Box3(new Vector3().fromArray(min), new Vector3().fromArray(max)),
      T_world_device: new Matrix4().fromArray(device.T_world_device),
      blocked: (from: Vector3, to: Vector3) => this.view.objects.between(from, to),
    };
    return { hand: this.view.markers.world(tick.hand), clear, orientation: tick.orientation, unit, room };
  }

  private showHand(): void {
    const { device, hand } = this;
    const usable = device?.simulated === true && hand.enabled;
    this.view.canvas.dataset["hand"] = String(usable);
    byId("let-go").hidden = !hand.held;
    byId("hand-bar").hidden = !device || !hand.enabled;
    setText(byId("hand-says"), this.handText());
  }

  private handText(): string {
    const { device, hand } = this;
    if (!device) return "";
    if (!device.simulated) return "A real hand holds this device.";
    if (hand.held)
      return hand.strokes
        ? `You hold the hand, pressing ${hand.pressing_mm.toFixed(0)} mm in. Wheel: deeper.`
        : "You hold the hand. Wheel: depth.";
    if (device.held_by !== null) return `Client ${device.held_by} holds the hand.`;
    return "Drag over an object to touch it. Right button: camera.";
  }

  private showArmed(stopped: boolean): void {
    byId<HTMLButtonElement>("rearm").disabled = !stopped;
    document.body.classList.toggle("stopped", stopped);
  }

  // Each frame.

  private frame(time_ms: number): void {
    this.hand.frame(time_ms);
    if (this.tick && this.fresh) {
      this.fresh = false;
      const contacts = this.tick.object < 0 && this.tick.depth === 0 ? [] : this.contacts;
      this.view.markers.update(this.tick, contacts);
      this.view.objects.touch(this.tick.object);
      this.view.invalidate();
      if (time_ms - this.readoutAt > READOUT_MS) this.readout(this.tick, time_ms);
    }
    this.view.draw();
    this.plots.draw();
    ++this.frames;
  }

  private readout(tick: wire.Tick, time_ms: number): void {
    this.readoutAt = time_ms;
    setText(byId("force"), Math.hypot(...tick.force_N).toFixed(2));
    setText(byId("depth"), `${this.depth_mm(tick).toFixed(2)} mm`);
    const stopped = (tick.guardActive & STOPPED) !== 0 ? " (stopped)" : "";
    setText(byId("touching"), (tick.object >= 0 ? `object ${tick.object}` : "nothing") + stopped);
  }
}

function durationText(seconds: number): string {
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

const viewer = new Page();
viewer.start();
// For the tests, and for the curious at the console.
Object.assign(window, { viewer });
