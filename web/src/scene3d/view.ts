// The 3D view: scene, camera and lights. It draws only after a change.
import {
  Box3,
  Color,
  DirectionalLight,
  HemisphereLight,
  MOUSE,
  PerspectiveCamera,
  Plane,
  Ray,
  Raycaster,
  Scene,
  TOUCH,
  Vector2,
  Vector3,
  WebGLRenderer,
  type Object3D,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { DeviceState } from "../state_types";
import { Markers } from "./markers";
import { Objects } from "./objects";

const MOST_PIXELS_PER_POINT = 2;

export class View {
  readonly objects: Objects;
  readonly markers = new Markers();
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(35, 1, 1, 1000);
  private readonly renderer: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly raycaster = new Raycaster();
  private dirty = true;
  private framed = "";
  /** Position of the canvas on the page, cached: querying it in every frame would force a layout. */
  private at = new DOMRect();
  private device: DeviceState | undefined;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, MOST_PIXELS_PER_POINT));
    this.objects = new Objects(new Color("#ff7a1a"));
    this.scene.add(this.objects.group, this.markers.group, this.camera);
    const key = new DirectionalLight(0xffffff, 2.2);
    key.position.set(-0.6, 1, 0.8);
    this.camera.add(key);
    this.scene.add(new HemisphereLight(0xffffff, 0x8890a0, 1.5));
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.invalidate());
    this.handOnLeft(true);
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    document.addEventListener("scroll", () => (this.at = canvas.getBoundingClientRect()), {
      capture: true,
      passive: true,
    });
    this.resize();
  }

  invalidate(): void {
    this.dirty = true;
  }

  /** Whether the left mouse button (and one finger) moves the simulated hand or turns the camera. */
  handOnLeft(hand: boolean): void {
    this.controls.mouseButtons = { LEFT: hand ? null : MOUSE.ROTATE, MIDDLE: MOUSE.PAN, RIGHT: MOUSE.ROTATE };
    this.controls.touches = { ONE: hand ? null : TOUCH.ROTATE, TWO: TOUCH.DOLLY_ROTATE };
  }

  /** Off while the wheel changes the depth of the hand. */
  set zooming(on: boolean) {
    this.controls.enableZoom = on;
  }

  setBackground(colour: string): void {
    this.scene.background = new Color(colour);
    this.invalidate();
  }

  add(part: Object3D): void {
    this.scene.add(part);
    this.invalidate();
  }
  remove(part: Object3D): void {
    this.scene.remove(part);
    this.invalidate();
  }

  setDevice(device: DeviceState): void {
    this.device = device;
    this.markers.setDevice(device);
    const place = device.name + device.T_world_device.join();
    if (place !== this.framed) this.home();
    this.framed = place;
    this.invalidate();
  }

  /** Moves the camera to where the user of the device sits. */
  home(): void {
    if (!this.device) return;
    const box = new Box3().setFromObject(this.markers.group.children[0]!);
    const centre = box.getCenter(new Vector3());
    const T = this.device.T_world_device;
    const axis = (i: number): Vector3 => new Vector3(T[4 * i]!, T[4 * i + 1]!, T[4 * i + 2]!).normalize();
    const radius = 0.5 * box.getSize(new Vector3()).length();
    const narrow = Math.min(1, this.camera.aspect);
    const from = axis(2).add(axis(1).multiplyScalar(0.38)).add(axis(0).multiplyScalar(0.45)).normalize();
    this.camera.up.copy(axis(1));
    this.camera.position.copy(centre).addScaledVector(from, (2.5 * radius) / narrow);
    this.camera.near = radius / 50;
    this.camera.far = radius * 50;
    this.camera.updateProjectionMatrix();
    this.controls.target.copy(centre);
    this.controls.update();
    this.invalidate();
  }

  /** The ray through a point on the page, in world units. */
  rayAt(x: number, y: number): Ray {
    const { at } = this;
    const share = new Vector2((2 * (x - at.left)) / at.width - 1, 1 - (2 * (y - at.top)) / at.height);
    this.raycaster.setFromCamera(share, this.camera);
    return this.raycaster.ray.clone();
  }

  /** The page coordinates of a point in the world. */
  pageOf(point: Vector3): { x: number; y: number } {
    const { at } = this;
    const p = point.clone().project(this.camera);
    return { x: at.left + ((p.x + 1) / 2) * at.width, y: at.top + ((1 - p.y) / 2) * at.height };
  }

  /** The plane through a point that faces the camera. */
  planeFacing(point: Vector3): Plane {
    return new Plane().setFromNormalAndCoplanarPoint(this.camera.getWorldDirection(new Vector3()), point);
  }

  /** Right, up and into the screen, of unit length. */
  axes(): { right: Vector3; up: Vector3; into: Vector3 } {
    const into = this.camera.getWorldDirection(new Vector3());
    const right = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
    return { right, up: new Vector3().crossVectors(right, into), into };
  }

  draw(): void {
    if (!this.dirty) return;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    this.renderer.setSize(width, height, false);
    this.at = this.canvas.getBoundingClientRect();
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }
}
