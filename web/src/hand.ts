// The simulated hand, held by the pointer: a drag over an object strokes it, pressed in a little; a drag beside it, or with the
// "plane" setting, moves in the plane through the hand that faces the camera. The wheel changes the depth, arrow keys do the same.
import { Vector3 } from "three";
import { type Room, wayAround } from "./route";
import { holdHand, type Outgoing } from "./wire";
import type { View } from "./scene3d/view";

export type DragMode = "surface" | "plane";

/** What the hand needs to know of the present moment; lengths in world units. */
export interface HandNow {
  hand: Vector3;
  /** Where the tip rests: the proxy, a little off the surface that it touches. */
  clear: Vector3;
  orientation: [number, number, number, number];
  /** World units in a millimetre of the device. */
  unit: number;
  room: Room;
}

const PRESS_MM = 4;
const MOST_PRESS_MM = 25;
const WHEEL_MM = 1;
const KEY_MM = 2;
const REFRESH_MS = 200;
const LEG_MS = 900;
const IDLE_MS = 60_000;

export class Hand {
  mode: DragMode = "surface";
  held = false;
  /** Whether the left button is the hand's. */
  enabled = true;
  private dragging = false;
  private refusedUntilUp = false;
  private press_mm = PRESS_MM;
  private pointer = { x: 0, y: 0 };
  private target = new Vector3();
  private route: Vector3[] = [];
  private legSince = 0;
  private sent = 0;
  private used = 0;
  private onSurface = false;
  /** The pointer has moved, the target not yet. */
  private aimLater = false;
  /** The target has changed since it was sent. */
  private fresh = false;
  private orientation: [number, number, number, number] = [0, 0, 0, 1];

  constructor(
    private readonly view: View,
    private readonly send: (message: Outgoing) => boolean,
    private readonly now: () => HandNow | undefined,
    private readonly onChange: () => void,
  ) {
    const { canvas } = view;
    canvas.addEventListener("pointerdown", (e) => this.down(e));
    canvas.addEventListener("pointermove", (e) => this.move(e));
    canvas.addEventListener("pointerup", () => this.up());
    canvas.addEventListener("pointercancel", () => this.up());
    canvas.addEventListener("wheel", (e) => this.wheel(e), { passive: false });
    canvas.addEventListener("keydown", (e) => this.key(e));
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

  /** The server said that somebody else holds it, or the connection is gone. */
  lost(): void {
    this.held = false;
    this.refusedUntilUp = this.dragging;
    this.route = [];
    this.onChange();
  }

  /** Once a frame: sends where the hand shall be. */
  frame(time_ms: number): void {
    if (!this.held) return;
    if (time_ms - this.used > IDLE_MS && !this.dragging) return this.letGo();
    this.advance(time_ms);
    if (time_ms - this.sent < REFRESH_MS && !this.fresh) return;
    this.fresh = false;
    this.sent = time_ms;
    this.send(holdHand(true, (this.route[0] ?? this.target).toArray(), this.orientation));
  }

  private down(e: PointerEvent): void {
    if (e.button !== 0 || !this.enabled) return;
    const now = this.now();
    if (!now) return;
    this.view.canvas.setPointerCapture(e.pointerId);
    this.dragging = true;
    this.view.zooming = false;
    this.pointer = { x: e.clientX, y: e.clientY };
    if (!this.held) this.take(now);
    this.aim();
    this.route = this.around(now);
    this.legSince = performance.now();
  }

  private take(now: HandNow): void {
    this.held = true;
    this.press_mm = PRESS_MM;
    this.orientation = now.orientation;
    this.target.copy(now.hand);
    this.onChange();
  }

  private move(e: PointerEvent): void {
    if (!this.dragging || !this.held) return;
    this.pointer = { x: e.clientX, y: e.clientY };
    this.aimLater = true;
  }

  private up(): void {
    this.dragging = this.refusedUntilUp = false;
    this.view.zooming = true;
  }

  private wheel(e: WheelEvent): void {
    if (!this.dragging || this.refusedUntilUp) return;
    e.preventDefault();
    this.deeper(e.deltaY < 0 ? WHEEL_MM : -WHEEL_MM);
  }

  private key(e: KeyboardEvent): void {
    const now = this.now();
    const way = KEYS[e.key];
    if (!way || !now || !this.enabled) return;
    e.preventDefault();
    if (!this.held) this.take(now);
    const { right, up } = this.view.axes();
    const step = KEY_MM * now.unit * (e.shiftKey ? 5 : 1);
    this.target.addScaledVector(right, way[0] * step).addScaledVector(up, way[1] * step);
    if (way[2] !== 0) this.target.addScaledVector(this.view.axes().into, way[2] * step);
    this.touchedNow();
  }

  private touchedNow(): void {
    this.used = performance.now();
    this.fresh = true;
  }

  /** Positive: away from the viewer, into the object. */
  private deeper(mm: number): void {
    const now = this.now();
    if (!now) return;
    if (this.onSurface) {
      this.press_mm = Math.min(Math.max(this.press_mm + mm, -5), MOST_PRESS_MM);
      this.aim();
    } else {
      this.target.addScaledVector(this.view.axes().into, mm * now.unit);
    }
    this.touchedNow();
    this.onChange();
  }

  // Where the pointer means: on the surface below it, else in the plane through the target that faces the camera.
  private aim(): void {
    const now = this.now();
    if (!now) return;
    this.aimLater = false;
    const ray = this.view.rayAt(this.pointer.x, this.pointer.y);
    const distance = this.mode === "surface" ? this.view.objects.distance(ray) : Infinity;
    this.onSurface = Number.isFinite(distance);
    if (this.onSurface) {
      ray.at(distance + this.press_mm * now.unit, this.target);
    } else {
      ray.intersectPlane(this.view.planeFacing(this.target.clone()), this.target);
    }
    this.touchedNow();
  }

  private around(now: HandNow): Vector3[] {
    const { into } = this.view.axes();
    const back_mm = this.onSurface ? this.press_mm + 2 : 0;
    const open = this.target.clone().addScaledVector(into, -back_mm * now.unit);
    return wayAround(now.clear, open, into.negate(), now.room);
  }

  private advance(time_ms: number): void {
    if (this.aimLater) this.aim();
    const now = this.now();
    const next = this.route[0];
    if (!next || !now) return;
    if (now.hand.distanceTo(next) > 4 * now.unit && time_ms - this.legSince < LEG_MS) return;
    this.route.shift();
    this.legSince = time_ms;
    this.fresh = true;
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
