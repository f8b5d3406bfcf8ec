// The simulated hand, moved with the pointer. A drag over an object strokes it, with the HIP a little below the surface. A drag
// beside objects, or in "plane" mode, moves the HIP in the plane through it that faces the camera. The wheel changes the depth;
// the keyboard moves the HIP, too.
import { Vector3 } from "three";
import { routeAround, type Surroundings } from "./route";
import { REFUSAL } from "./server_tables";
import { holdHand, type Outgoing } from "./wire";
import type { View } from "./scene3d/view";

export type DragMode = "surface" | "plane";

/** The current state that decides where the hand may move; positions in world units. */
export interface HandContext {
  hip: Vector3;
  /** A point near the proxy, 2 mm outside the touched surfaces, where a route can start. */
  freePoint: Vector3;
  orientation: [number, number, number, number];
  /** World units per millimetre of the device. */
  worldPerMm: number;
  surroundings: Surroundings;
}

const PRESS_MM = 4;
const MAX_PRESS_MM = 25;
const WHEEL_MM = 1;
const KEY_MM = 2;
const REFRESH_MS = 200;
const LEG_TIMEOUT_MS = 900;
const IDLE_MS = 60_000;
/** A finger takes the hand once it has moved this far, or has stayed this long: the second finger of a pinch may follow. */
const FINGER_PX = 8;
const FINGER_MS = 150;
const IDLE_CHECK_MS = 1000;

const REFUSALS: readonly number[] = [REFUSAL.handNotSimulated, REFUSAL.handHeldByOther, REFUSAL.handPoseInvalid];

/** Whether a text of the server refuses the hand to this page. Every kind of command may be not permitted: the text names it. */
export const refusesHand = (level: number, text: string): boolean =>
  REFUSALS.includes(level) || (level === REFUSAL.notPermitted && text.includes("Hold_Hand refused"));

export class Hand {
  mode: DragMode = "surface";
  held = false;
  /** Whether the left mouse button moves the hand. */
  enabled = true;
  private dragging = false;
  /** The finger, or the mouse, that drags. */
  private pointerId = -1;
  private ignoredUntilUp = false;
  /** The finger that may be the first of two, where it touched. */
  private finger: { id: number; x: number; y: number; since_ms: number } | undefined;
  private press_mm = PRESS_MM;
  private pointer = { x: 0, y: 0 };
  private target = new Vector3();
  private route: Vector3[] = [];
  private legSince_ms = 0;
  private sentAt_ms = 0;
  private usedAt_ms = 0;
  private onSurface = false;
  /** The pointer has moved, the target not yet. */
  private aimPending = false;
  /** The target has changed since it was sent. */
  private targetChanged = false;
  private orientation: [number, number, number, number] = [0, 0, 0, 1];

  constructor(
    private readonly view: View,
    private readonly send: (message: Outgoing) => boolean,
    private readonly context: () => HandContext | undefined,
    private readonly onChange: () => void,
  ) {
    const { canvas } = view;
    // Before the camera: it asks whether it may zoom.
    canvas.addEventListener("pointerdown", (e) => this.down(e), { capture: true });
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", (e) => this.up(e));
    canvas.addEventListener("pointercancel", (e) => this.cancel(e));
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
    // Not with the frames: a hidden page has none.
    window.setInterval(() => this.letGoWhenIdle(), IDLE_CHECK_MS);
  }

  get pressing_mm(): number {
    return this.press_mm;
  }
  get strokes(): boolean {
    return this.onSurface;
  }

  letGo(): void {
    if (!this.held) return;
    this.held = this.dragging = false;
    this.route = [];
    this.send(holdHand(false, [0, 0, 0], [0, 0, 0, 1]));
    this.view.zooming = true;
    this.onChange();
  }

  /** The server refused the hand to this page, or the connection was lost. */
  onLost(): void {
    this.held = false;
    this.ignoredUntilUp = this.dragging;
    this.finger = undefined;
    this.route = [];
    this.onChange();
  }

  /** Call once per frame: sends the target of the hand. */
  frame(time_ms: number): void {
    if (this.finger && performance.now() - this.finger.since_ms > FINGER_MS) this.press(this.finger);
    if (!this.held) return;
    this.advance(time_ms);
    if (time_ms - this.sentAt_ms < REFRESH_MS && !this.targetChanged) return;
    this.targetChanged = false;
    this.sentAt_ms = time_ms;
    this.send(holdHand(true, (this.route[0] ?? this.target).toArray(), this.orientation));
  }

  private down(e: PointerEvent): void {
    if (!e.isPrimary) return this.stay(); // two fingers move the camera
    if (e.button !== 0 || !this.enabled || !this.context()) return;
    this.view.canvas.setPointerCapture(e.pointerId);
    const finger = { id: e.pointerId, x: e.clientX, y: e.clientY, since_ms: performance.now() };
    if (e.pointerType === "touch") this.finger = finger;
    else this.press(finger);
  }

  /** The drag begins. */
  private press({ id, x, y }: { id: number; x: number; y: number }): void {
    this.finger = undefined;
    const context = this.context();
    if (!context || !this.enabled) return;
    this.dragging = true;
    this.pointerId = id;
    this.view.zooming = false;
    this.pointer = { x, y };
    if (!this.held) this.take(context);
    this.aim();
    this.route = this.routeToTarget(context);
    this.legSince_ms = performance.now();
  }

  private take(context: HandContext): void {
    this.held = true;
    this.press_mm = PRESS_MM;
    this.orientation = context.orientation;
    this.target.copy(context.hip);
    this.onChange();
  }

  private move(e: PointerEvent): void {
    const { finger } = this;
    if (finger?.id === e.pointerId && Math.hypot(e.clientX - finger.x, e.clientY - finger.y) > FINGER_PX) this.press(finger);
    if (!this.dragging || !this.held || e.pointerId !== this.pointerId) return;
    this.pointer = { x: e.clientX, y: e.clientY };
    this.aimPending = true;
  }

  private up(e: PointerEvent): void {
    if (this.finger?.id === e.pointerId) this.press(this.finger); // a tap
    if (e.pointerId === this.pointerId) this.stay();
  }

  private cancel(e: PointerEvent): void {
    if (this.finger?.id === e.pointerId) this.finger = undefined;
    if (e.pointerId === this.pointerId) this.stay();
  }

  /** The drag ends; the hand stays where it is. */
  private stay(): void {
    if (this.held && this.aimPending) this.aim(); // before the camera moves
    this.dragging = this.ignoredUntilUp = false;
    this.finger = undefined;
    this.view.zooming = true;
  }

  private wheel(e: WheelEvent): void {
    if (!this.dragging || this.ignoredUntilUp) return;
    e.preventDefault();
    this.changeDepth(e.deltaY < 0 ? WHEEL_MM : -WHEEL_MM);
  }

  private key(e: KeyboardEvent): void {
    if (e.ctrlKey || e.metaKey || e.altKey) return; // keys of the browser
    const context = this.context();
    const direction = KEYS[e.key];
    if (!direction || !context || !this.enabled) return;
    e.preventDefault();
    if (!this.held) this.take(context);
    const { right, up } = this.view.axes();
    const step = KEY_MM * context.worldPerMm * (e.shiftKey ? 5 : 1);
    this.target.addScaledVector(right, direction[0] * step).addScaledVector(up, direction[1] * step);
    if (direction[2] !== 0) this.target.addScaledVector(this.view.axes().into, direction[2] * step);
    this.keepInside(context.surroundings);
    this.noteUse();
  }

  private letGoWhenIdle(): void {
    if (performance.now() - this.usedAt_ms > IDLE_MS && !this.dragging) this.letGo();
  }

  private noteUse(): void {
    this.usedAt_ms = performance.now();
    this.targetChanged = true;
  }

  /** Positive: away from the viewer, into the object. */
  private changeDepth(mm: number): void {
    const context = this.context();
    if (!context) return;
    if (this.onSurface) {
      this.press_mm = Math.min(Math.max(this.press_mm + mm, -5), MAX_PRESS_MM);
      this.aim();
    } else {
      this.target.addScaledVector(this.view.axes().into, mm * context.worldPerMm);
      this.keepInside(context.surroundings);
    }
    this.noteUse();
    this.onChange();
  }

  // As the server does: of steps that led outside, the first one back moves the hand.
  private keepInside({ workspace, T_world_device }: Surroundings): void {
    this.target.applyMatrix4(T_world_device.clone().invert()).clamp(workspace.min, workspace.max).applyMatrix4(T_world_device);
  }

  // Sets the target to the surface below the pointer, or to the plane through the target that faces the camera.
  private aim(): void {
    const context = this.context();
    if (!context) return;
    this.aimPending = false;
    const ray = this.view.rayAt(this.pointer.x, this.pointer.y);
    const distance = this.mode === "surface" ? this.view.objects.distance(ray) : Infinity;
    this.onSurface = Number.isFinite(distance);
    if (this.onSurface) {
      ray.at(distance + this.press_mm * context.worldPerMm, this.target);
    } else {
      ray.intersectPlane(this.view.planeFacing(this.target.clone()), this.target);
    }
    this.noteUse();
  }

  private routeToTarget(context: HandContext): Vector3[] {
    const { into } = this.view.axes();
    const back_mm = this.onSurface ? this.press_mm + 2 : 0;
    const open = this.target.clone().addScaledVector(into, -back_mm * context.worldPerMm);
    return routeAround(context.freePoint, open, into.negate(), context.surroundings);
  }

  private advance(time_ms: number): void {
    if (this.aimPending) this.aim();
    const context = this.context();
    const next = this.route[0];
    if (!next || !context) return;
    if (context.hip.distanceTo(next) > 4 * context.worldPerMm && time_ms - this.legSince_ms < LEG_TIMEOUT_MS) return;
    this.route.shift();
    this.legSince_ms = time_ms;
    this.targetChanged = true;
  }
}

/** Right, up, into the screen. */
const KEYS: Record<string, [number, number, number]> = {
  ArrowRight: [1, 0, 0],
  ArrowLeft: [-1, 0, 0],
  ArrowUp: [0, 1, 0],
  ArrowDown: [0, -1, 0],
  PageDown: [0, 0, 1],
  PageUp: [0, 0, -1],
};
