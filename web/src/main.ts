// The page: creates all parts and connects them.
import { Box3, Matrix4, Ray, Vector3 } from "three";
import "uplot/dist/uPlot.min.css";
import "./viewer.css";
import { DropMesh } from "./drop_mesh";
import { type DragMode, Hand, type HandContext, refusesHand } from "./hand";
import { bindLetterKeys } from "./letter_keys";
import { Link } from "./link";
import { LivePlots } from "./live_plots";
import { showNotice, toast } from "./notice";
import { ClientsPanel } from "./panels/clients";
import { byId, setText } from "./panels/dom";
import { EffectsPanel } from "./panels/effects";
import { GuardPanel } from "./panels/guard";
import { ObjectsPanel } from "./panels/objects";
import { ReplayBar } from "./panels/replay";
import { ServersPanel } from "./panels/servers";
import { SourcesPanel } from "./panels/sources";
import { css } from "./plots/plot";
import { type Quantity, rampCss, rangeOf } from "./scene3d/colours";
import { View } from "./scene3d/view";
import { REFUSAL, TRIPS } from "./server_tables";
import { pollServers } from "./servers";
import { Meshes, pollState } from "./state";
import type { DeviceState, ObjectState, SceneState, ServerState } from "./state_types";
import { effectNames, feltForces, nameOfObject, type RemoteContact } from "./sources";
import { startTheme } from "./theme";
import { bindToken, credentials } from "./token";
import * as wire from "./wire";

const REPORTS_HZ = 125;
const READOUT_MS = 80;
/** For which a server may leave the button of the recording without an effect. */
const RECORD_MS = 5000;

class Page {
  private state: ServerState | undefined;
  private device: DeviceState | undefined;
  private scene: SceneState | undefined;
  private tick: wire.Tick | undefined;
  private contacts: wire.Contact[] = [];
  private remote: RemoteContact[] = [];
  private marked = 0;
  private recording = false;
  /** A recording is being begun or ended until then. */
  private recordAgainAt_ms = 0;
  /** When each trip acted last. */
  private readonly tripAt_ms = new Map<string, number>();
  private tickIsNew = false;
  private readoutAt_ms = 0;
  private serverResponds = true;
  /** A stop was sent, and the server has not reported it yet. */
  private stopUnconfirmed = false;
  /** Of meshes that arrived or went, the picture does not know yet. */
  private meshesChanged = false;
  /** What the left mouse button does. */
  private drag = "surface";
  /** Number of drawn frames. */
  frames = 0;

  private readonly view = new View(byId<HTMLCanvasElement>("view"));
  private readonly link = new Link(
    () => this.onLinkState(),
    (message, age_s) => this.onMessage(message, age_s),
    credentials,
  );
  private readonly plots = new LivePlots();
  private readonly hand = new Hand(
    this.view,
    (m) => this.link.send(m),
    () => this.handContext(),
    () => this.showHand(),
  );
  private readonly meshes = new Meshes(
    (id, mesh) => {
      this.view.objects.setMesh(id, mesh);
      this.meshesChanged = true;
    },
    (id) => {
      this.view.objects.remove(id);
      this.meshesChanged = true;
    },
  );
  private readonly drop = new DropMesh({
    link: this.link,
    view: this.view,
    device: () => this.device,
    scene: () => this.scene,
    replays: () => !!this.state?.server.replay,
  });
  private readonly guard = new GuardPanel(byId("guard"));
  private readonly clients = new ClientsPanel(byId("clients"));
  private readonly objectsPanel = new ObjectsPanel(
    byId("objects"),
    (...m) => this.command(...m),
    (id) => this.view.objects.centreOf(id),
  );
  private readonly sourcesPanel = new SourcesPanel(byId("sources"), (...m) => this.command(...m));
  private readonly replay = new ReplayBar((...m) => this.send(...m));
  private readonly effects = new EffectsPanel(byId("effects"), (...m) => this.command(...m));
  private readonly deviceChoice = byId<HTMLSelectElement>("device");
  private readonly quantity = byId<HTMLSelectElement>("quantity");
  private readonly lettersAct = bindLetterKeys();

  start(): void {
    startTheme(() => this.restyle());
    byId("ramp").style.background = rampCss();
    this.bindControls();
    this.showNotice();
    pollState(
      (state) => this.onState(state),
      () => this.meshes.deform,
    );
    const servers = new ServersPanel(byId("servers"));
    pollServers((found) => servers.update(found));
    const frame = (time_ms: number): void => {
      this.frame(time_ms);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  private bindControls(): void {
    byId("stop").addEventListener("click", () => this.stop());
    byId("rearm").addEventListener("click", () => this.send(wire.rearmForces()));
    bindToken((...m) => this.send(...m));
    byId("home").addEventListener("click", () => this.view.home());
    byId("let-go").addEventListener("click", () => this.hand.letGo());
    this.quantity.addEventListener("change", () => this.showObjects());
    byId<HTMLInputElement>("arrows").addEventListener("change", (e) => {
      this.view.sources.arrows = (e.target as HTMLInputElement).checked;
      this.tickIsNew = true;
    });
    byId("record").addEventListener("click", (e) => this.record(e));
    byId("mark").addEventListener("submit", (e) => {
      e.preventDefault();
      this.mark();
    });
    this.deviceChoice.addEventListener("change", () => this.chooseDevice(this.deviceChoice.value));
    byId("drag-is").addEventListener("change", (e) => this.chooseDrag((e.target as HTMLInputElement).value));
    window.addEventListener("keydown", (e) => this.key(e), { capture: true });
  }

  private key(e: KeyboardEvent): void {
    if (e.key === "Escape") return this.stop();
    const typing =
      e.target instanceof HTMLElement && e.target.matches("input[type=number], input[type=text], input[type=password], select");
    if (typing || e.ctrlKey || e.metaKey || e.altKey || !this.lettersAct()) return;
    if (e.key.toLowerCase() === "l") this.hand.letGo();
    if (e.key.toLowerCase() === "m" && !e.repeat) this.mark();
  }

  /** Marks the moment, in the recording and for all clients. */
  private mark(): void {
    const input = byId<HTMLInputElement>("mark-text");
    this.send(wire.mark(input.value.trim() || `mark ${++this.marked}`));
  }

  /** Begins or ends the recording; not again with the second click of two, nor before the server has done it. */
  private record(e: MouseEvent): void {
    if (e.detail > 1 || performance.now() < this.recordAgainAt_ms) return;
    if (this.link.send(wire.recordingControl(!this.recording))) this.recordAgainAt_ms = performance.now() + RECORD_MS;
    else toast("Not connected: the command was not sent.", 2);
  }

  private stop(): void {
    this.stopUnconfirmed = this.link.sendAtOnce(wire.stopForces());
    if (!this.stopUnconfirmed)
      toast("Not connected: the stop did not reach the server. Use the switch on the device.", 2);
    else if (!this.serverResponds || this.link.unanswered)
      this.warnOfStop();
  }

  private warnOfStop(): void {
    toast("The server does not answer: the stop may not have reached it. Use the switch on the device.", 2);
  }

  private send(...messages: wire.Outgoing[]): void {
    if (!this.link.send(...messages)) toast("Not connected: the command was not sent.", 2);
  }

  // A command of the scene belongs to the batch of a mesh that is being sent. A second connection for the mesh would be
  // another client, which the server may not let command.
  private command(...messages: wire.Outgoing[]): void {
    this.send(...messages);
    if (this.drop.sending !== "")
      toast(`This takes effect when ${this.drop.sending} is complete. STOP acts at once.`, 1);
  }

  private chooseDrag(value: string): void {
    this.drag = value;
    const camera = value === "camera";
    this.view.handOnLeft(!camera);
    this.hand.enabled = !camera;
    if (!camera) this.hand.mode = value as DragMode;
    this.showHand();
  }

  private restyle(): void {
    this.view.setBackground(css("--view"));
    this.view.markers.setColours({
      hip: css("--hand"),
      proxy: css("--proxy"),
      force: css("--force"),
      normal: css("--normal"),
      box: css("--box"),
    });
    this.view.sources.setColours(css("--source"), css("--second"));
    this.plots.restyle();
  }

  // The state of the server, four times per second.

  private onState(state: ServerState | undefined): void {
    this.serverResponds = state !== undefined;
    this.showLink();
    if (!state && this.state) this.clearReadout();
    if (state) {
      // Started anew, it has another scene.
      if (this.state && this.state.server.run !== state.server.run) this.forgetScene();
      this.state = state;
      this.showDevices(state.devices);
      const device = state.devices.find((d) => d.name === this.deviceChoice.value) ?? state.devices[0];
      if (device && this.link.device === "") this.link.connect(device.name);
      // A restarted server may have other devices: commands, and a stop, to one that is gone would reach nothing.
      else if (device && device.name !== this.link.device) this.chooseDevice(device.name);
      this.device = device;
      this.scene = device && state.scenes[device.scene];
      if (device) this.show(device, state);
    }
    this.showNotice();
  }

  private show(device: DeviceState, state: ServerState): void {
    this.view.setDevice(device);
    this.guard.update(device, this.recentTrips());
    this.clients.update(state.clients);
    this.effects.update(this.scene?.effects ?? [], this.scene?.vibration_contact_unit ?? "rad/s");
    this.plots.state(device, performance.now() / 1000);
    this.sourcesPanel.update(this.scene, this.remote);
    if (this.view.sources.update(this.scene)) this.view.invalidate();
    this.meshes.update(device.scene, this.objects());
    this.showObjects();
    this.drop.update(this.objects());
    this.showArmed(device.guard.stopped, device.guard.latched.length > 0);
    this.showHand();
    const { server } = state;
    this.replay.update(server.replay);
    // In a replay there is no hand to move; the choice stands for the live server that follows.
    const drag = server.replay ? "camera" : document.querySelector<HTMLInputElement>("#drag-is input:checked")!.value;
    if (drag !== this.drag) this.chooseDrag(drag);
    const recording = server.recording !== null;
    if (recording !== this.recording) this.recordAgainAt_ms = 0;
    this.recording = recording;
    byId("record").classList.toggle("on", recording);
    setText(byId("record"), this.recording ? "End recording" : "Record");
    byId("recording").hidden = !this.recording;
    setText(byId("recording"), `● ${server.recording ?? ""}`);
    byId("recording").title = server.recording ?? "";
    setText(
      byId("about"),
      `hapticd ${server.version}, ${server.replay ? `replays ${server.replay.file}` : `${device.driver} at ${device.rate_Hz} Hz${device.realtime ? "" : ", not realtime"}`}, running for ${durationText(server.uptime_s)}`,
    );
  }

  private objects(): ObjectState[] {
    return this.scene?.objects ?? [];
  }

  private showObjects(): void {
    const quantity = this.quantity.value as Quantity;
    if (this.view.objects.update(this.objects(), quantity)) this.view.invalidate();
    this.objectsPanel.update(this.scene, this.tick?.object ?? -1);
    byId("legend-scale").hidden = quantity === "object";
    setText(byId("legend-to"), quantity === "stiffness" ? `${rangeOf(this.objects(), quantity)} N/m` : "1");
  }

  /** Once in a frame: of a thousand objects many arrive between two frames. */
  private showMeshes(): void {
    this.meshesChanged = false;
    this.showObjects();
    this.view.invalidate();
  }

  private recentTrips(): string[] {
    const since = performance.now() - 1000;
    return [...this.tripAt_ms].filter(([, at]) => at > since).map(([name]) => name);
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
    this.forgetScene();
    this.plots.clear();
    this.tripAt_ms.clear();
    this.contacts = [];
    this.remote = [];
    this.tick = undefined;
    this.tickIsNew = false;
    // Now, not with the next state: the ticks of the other device go on.
    this.device = this.state?.devices.find((d) => d.name === name);
    this.scene = this.device && this.state?.scenes[this.device.scene];
    this.subscribe();
    if (this.device && this.state) this.show(this.device, this.state);
  }

  /** The scene that follows is another one. */
  private forgetScene(): void {
    this.meshes.clear();
    this.drop.clear();
    this.drop.endPreview();
    this.objectsPanel.clear();
    this.effects.clear();
    this.sourcesPanel.clear();
  }

  private showNotice(): void {
    const noDevice = this.state?.devices.length === 0;
    if (this.link.state === "lost" || (!this.serverResponds && this.state)) return showNotice("lost");
    if (noDevice) return showNotice("no device");
    if (!this.device || this.link.state === "connecting") return showNotice("connecting");
    if (!this.view.hasPicture) return showNotice("no WebGL");
    const loading = !byId("drop-panel").hidden; // its picture is under the notice
    showNotice(
      loading ||
        this.state?.server.replay || // an empty scene stays so
        this.objects().some((o) => o.triangles > 0) || (this.scene?.planes.length ?? 0) > 0 ? "" : "empty",
    );
  }

  // The connection.

  private onLinkState(): void {
    const { state } = this.link;
    document.body.classList.toggle("lost", state === "lost");
    this.showLink();
    if (state === "open") this.subscribe();
    if (state === "lost") {
      this.recordAgainAt_ms = 0;
      if (this.stopUnconfirmed) this.warnOfStop();
      this.stopUnconfirmed = false;
      this.hand.onLost();
      this.clearReadout();
      this.drop.clear();
      this.meshes.clear(); // another server numbers its shapes from 1, too
    }
    this.showNotice();
  }

  private showLink(): void {
    const { state } = this.link;
    const silent = state === "open" && (!this.serverResponds || this.link.unanswered);
    const label = byId("link");
    setText(label, silent ? "no answer" : state === "open" ? "connected" : state);
    label.dataset["level"] = silent || state === "lost" ? "bad" : state === "open" ? "good" : "";
  }

  // What is not known is a dash, not a number of before.
  private clearReadout(): void {
    this.tick = undefined;
    this.tickIsNew = false;
    for (const id of ["force", "depth", "touching"]) setText(byId(id), "–");
    this.guard.lost();
    this.plots.lost();
    this.view.markers.hide();
    this.view.sources.hide();
    this.view.invalidateLive();
    this.showHeld("NO CONNECTION");
    this.showHand();
  }

  private subscribe(): void {
    const kinds =
      wire.REPORT_TICK | wire.REPORT_CONTACTS | wire.REPORT_BUTTON | wire.REPORT_HAND | wire.REPORT_POSES;
    this.link.send(wire.subscribe(kinds, REPORTS_HZ));
  }

  private onMessage(message: wire.Incoming, age_s: number): void {
    if (this.device && !this.device.names.includes(message.device)) return;
    switch (message.name) {
      case wire.TICK:
        return this.onTick(wire.decodeTick(message.payload), age_s);
      case wire.CONTACTS:
        this.contacts = wire.decodeContacts(message.payload);
        return;
      case wire.HAND_STATE:
        this.remote = wire.decodeRemoteContacts(message.payload);
        return;
      case wire.POSES: // of the tick that follows, so that force and cause are drawn at one time
        if (this.view.objects.place(wire.decodePoses(message.payload), performance.now())) this.view.moved();
        return;
      case wire.MARKER: {
        const { time, text } = wire.decodeMarker(message.payload);
        this.plots.marker(time / 1e9, text);
        return toast(`Marked: ${text}`, 0);
      }
      case wire.GUARD_STATE: {
        const guard = wire.decodeGuardState(message.payload);
        return this.showArmed(guard.stopped, guard.latched !== 0);
      }
      case wire.TEXT:
        return this.onText(wire.decodeText(message.payload));
    }
  }

  private onTick(tick: wire.Tick, age_s: number): void {
    this.tick = tick;
    this.tickIsNew = true;
    for (const [name, trip] of Object.entries(TRIPS))
      if ((tick.guardActive & (1 << trip.bit)) !== 0) this.tripAt_ms.set(name, performance.now());
    this.plots.tick(tick, Math.hypot(...tick.force_N), this.depth_mm(tick), age_s * 1000);
  }

  private onText({ severity, level, text }: wire.ServerText): void {
    if (refusesHand(level, text)) this.hand.onLost();
    // The text about its begin said why.
    if (severity === 2) this.recordAgainAt_ms = 0; // it may be the answer
    if (level === REFUSAL.batchRefused) return this.drop.refused(text);
    toast(text, severity);
  }

  // The simulated hand.

  /** World units per millimetre of the device. */
  private worldPerMm(): number {
    return this.device ? new Matrix4().fromArray(this.device.T_world_device).getMaxScaleOnAxis() / 1000 : 1;
  }

  private depth_mm(tick: wire.Tick): number {
    return (tick.depth * (this.device?.world_per_reported ?? 1000)) / this.worldPerMm();
  }

  private handContext(): HandContext | undefined {
    const { tick, device } = this;
    if (!tick || !device?.simulated || this.link.state !== "open") return undefined;
    const worldPerMm = this.worldPerMm();
    const freePoint = this.view.markers.world(tick.proxy);
    for (const contact of this.contacts)
      freePoint.addScaledVector(new Vector3(...contact.normal), 2 * worldPerMm);
    const { min, max } = device.workspace_m;
    const surroundings = {
      workspace: new Box3(new Vector3().fromArray(min), new Vector3().fromArray(max)),
      T_world_device: new Matrix4().fromArray(device.T_world_device),
      blocked: (from: Vector3, to: Vector3) => this.view.objects.between(from, to),
    };
    return {
      hip: this.view.markers.world(tick.hand),
      freePoint,
      orientation: tick.orientation,
      worldPerMm,
      surroundings,
    };
  }

  private showHand(): void {
    const { device, hand } = this;
    const usable = device?.simulated === true && hand.enabled;
    this.view.canvas.dataset["hand"] = String(usable);
    byId("let-go").hidden = !hand.held;
    const text = this.handText();
    byId("hand-bar").hidden = !hand.enabled || text === "";
    setText(byId("hand-status"), text);
  }

  private handText(): string {
    const { device, hand } = this;
    if (!device || this.link.state !== "open" || !this.serverResponds) return "";
    if (!device.simulated) return "A user holds this device; the page cannot move it.";
    if (hand.held)
      return hand.strokes
        ? `You hold the simulated hand, pressing ${hand.pressing_mm.toFixed(0)} mm deep. Wheel: depth.`
        : "You hold the simulated hand. Wheel: depth.";
    if (device.held_by !== null) return `Client ${device.held_by} holds the simulated hand.`;
    return "Drag over an object to touch it. Right mouse button: camera.";
  }

  private showArmed(stopped: boolean, tripped: boolean): void {
    if (stopped) this.stopUnconfirmed = false;
    byId<HTMLButtonElement>("rearm").disabled = !stopped && !tripped;
    document.body.classList.toggle("stopped", stopped || tripped);
    this.showHeld(stopped ? "STOPPED" : tripped ? "TRIPPED" : "");
  }

  /** Why there is no force, in letters that are read across a lab. */
  private showHeld(word: string): void {
    byId("stage").dataset["held"] = word;
    setText(byId("held"), word); // screen readers read it, too
  }

  // Every frame.

  private frame(time_ms: number): void {
    this.hand.frame(time_ms);
    if (this.meshesChanged) this.showMeshes();
    if (this.tick && this.tickIsNew) {
      this.tickIsNew = false;
      const contacts = this.tick.object < 0 && this.tick.depth === 0 ? [] : this.contacts;
      const { markers, objects, sources } = this.view;
      markers.update(this.tick, contacts);
      const scale = this.device?.world_per_reported ?? 1000;
      sources.tick(this.tick, contacts, this.remote, this.scene, scale, markers.perNewton);
      const hip = markers.world(this.tick.hand);
      markers.setShadow(objects.surface(new Ray(hip, markers.down)));
      if (objects.touch(this.tick.object)) this.view.invalidate();
      this.view.invalidateLive();
      if (time_ms - this.readoutAt_ms > READOUT_MS) this.readout(this.tick, time_ms);
    }
    this.view.draw();
    this.plots.draw();
    ++this.frames;
  }

  private readout(tick: wire.Tick, time_ms: number): void {
    this.readoutAt_ms = time_ms;
    setText(byId("force"), Math.hypot(...tick.force_N).toFixed(2));
    setText(byId("depth"), `${this.depth_mm(tick).toFixed(2)} mm`);
    const stopped = (tick.guardActive & (1 << TRIPS.stopped.bit)) !== 0 ? " (stopped)" : "";
    setText(byId("touching"), this.touchingText(tick) + stopped);
  }

  // Everything that may push: objects, planes, and what needs no surface.
  private touchingText(tick: wire.Tick): string {
    const { scene } = this;
    const inContact = tick.object >= 0 || tick.depth > 0;
    const touched = new Set(inContact ? this.contacts.map((c) => c.object) : []);
    if (inContact) touched.add(tick.object);
    const names = [...touched].sort((a, b) => a - b).map((id) => {
      if (id >= 0) return nameOfObject(scene, id);
      return scene?.planes.length === 1 ? `plane ${scene.planes[0]!.index}` : "a plane";
    });
    const scale = this.device?.world_per_reported ?? 1000;
    // What needs no surface, as far as it pushes here; effects have no report of their own.
    for (const { name } of feltForces({ ...tick, object: -1, depth: 0 }, [], this.remote, scene, scale))
      if (!name.startsWith("effect")) names.push(name);
    if (Math.hypot(...tick.force_N) > 0) names.push(...effectNames(scene));
    return names.join(", ") || "nothing";
  }
}

function durationText(seconds: number): string {
  if (seconds < 120) return `${seconds.toFixed(0)} s`;
  return seconds < 7200 ? `${(seconds / 60).toFixed(0)} min` : `${(seconds / 3600).toFixed(1)} h`;
}

const viewer = new Page();
viewer.start();
// For the tests and for the browser's console.
Object.assign(window, { viewer });
