// The 3D view: scene, camera and lights. It draws only after a change, and draws what rests only when that changes.
import {
  Box2,
  Box3,
  Color,
  DirectionalLight,
  HemisphereLight,
  Matrix4,
  Mesh,
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
  type BufferGeometry,
  type Object3D,
} from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import type { DeviceState } from "../state_types";
import { Markers } from "./markers";
import { Objects } from "./objects";
import { Sources } from "./sources";
import { drawsInSoftware, Still } from "./still";

const MOST_PIXELS_PER_POINT = 2;
/** After the last motion, all triangles are drawn again. */
const SETTLE_MS = 250;
/** Frames that take longer while something moves: fewer triangles from then on. */
const SLOW_MS = 45;
/** Around what moves with the hand, for the width of lines and rounding. */
const MARGIN_PX = 3;

export class View {
  readonly objects: Objects;
  readonly markers = new Markers();
  readonly sources = new Sources();
  /** What rests, as a rule. */
  private readonly scene = new Scene();
  /** What moves with the hand. */
  private readonly live = new Scene();
  private readonly liveLight = new DirectionalLight(0xffffff, 2.2);
  private readonly camera = new PerspectiveCamera(35, 1, 1, 1000);
  /** False where the browser has no WebGL: then nothing is drawn, and the rest of the page works. */
  readonly hasPicture: boolean;
  private readonly renderer!: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly raycaster = new Raycaster();
  private readonly still!: Still;
  /** Then every pixel costs: only those that change are drawn, and what moves is drawn without a copy. */
  private readonly software = drawsInSoftware();
  /** What rests has changed since it was drawn. */
  private stillDirty = true;
  /** Where the canvas shows what moves with the hand. */
  private liveAt = new Box2();
  private liveDirty = true;
  private movedAt_ms = -Infinity;
  private drawnAt_ms = 0;
  private slow: boolean;
  private isCoarse = false;
  private wasMoving = false;
  private framed = "";
  /** The workspace as its box is drawn. */
  private boxed = "";
  /** Position of the canvas on the page, cached: querying it in every frame would force a layout. */
  private at = new DOMRect();
  private device: DeviceState | undefined;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.slow = this.software;
    try {
      this.renderer = new WebGLRenderer({ canvas, antialias: !this.software, preserveDrawingBuffer: this.software });
      this.still = new Still(this.renderer, this.software ? 0 : 4);
    } catch (error) {
      console.warn(`no picture: ${String(error)}`);
    }
    this.hasPicture = this.still !== undefined;
    this.objects = new Objects(new Color("#ff7a1a"));
    this.scene.add(this.objects.group, this.sources.group, this.camera);
    this.live.add(this.markers.group, this.sources.live, this.liveLight, new HemisphereLight(0xffffff, 0x606878, 1.1));
    const key = new DirectionalLight(0xffffff, 2.2);
    key.position.set(-0.6, 1, 0.8);
    this.camera.add(key);
    this.scene.add(new HemisphereLight(0xffffff, 0x606878, 1.1));
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener("change", () => this.moved());
    this.handOnLeft(true);
    // After a reset of the graphics card; three restores the rest.
    canvas.addEventListener("webglcontextrestored", () => this.invalidate());
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement!);
    document.addEventListener("scroll", () => (this.at = canvas.getBoundingClientRect()), {
      capture: true,
      passive: true,
    });
    this.resize();
  }

  /** Something that rests has changed. */
  invalidate(): void {
    this.stillDirty = true;
  }

  /** Only the hand and what moves with it. */
  invalidateLive(): void {
    this.liveDirty = true;
  }

  /** The camera or an object moves. */
  moved(): void {
    this.movedAt_ms = performance.now();
    this.stillDirty = true;
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
    const box = new Box3().setFromObject(this.markers.group.children[0]!);
    this.sources.setPlace(box.getCenter(new Vector3()), Math.max(...box.getSize(new Vector3()).toArray()));
    const boxed = JSON.stringify([device.workspace_m, device.T_world_device]);
    if (boxed !== this.boxed) this.invalidate();
    this.boxed = boxed;
    const place = device.name + device.T_world_device.join();
    if (place === this.framed) return;
    this.home();
    this.framed = place;
  }

  /** Moves the camera to where the user of the device sits. */
  home(): void {
    const { device } = this;
    if (!device) return;
    const box = new Box3().setFromObject(this.markers.group.children[0]!);
    const centre = box.getCenter(new Vector3());
    const T = device.T_world_device;
    const axis = (i: number): Vector3 => new Vector3(T[4 * i]!, T[4 * i + 1]!, T[4 * i + 2]!).normalize();
    const radius = 0.5 * box.getSize(new Vector3()).length();
    const narrow = Math.min(1, this.camera.aspect);
    const from = axis(2).add(axis(1).multiplyScalar(0.38)).add(axis(0).multiplyScalar(0.45)).normalize();
    this.camera.up.copy(axis(1));
    this.camera.near = radius / 50;
    this.camera.far = radius * 50;
    this.camera.updateProjectionMatrix();
    // As near as the whole workspace allows.
    for (let away = (2 * radius) / narrow; away < 12 * radius; away *= 1.04) {
      this.camera.position.copy(centre).addScaledVector(from, away);
      this.camera.lookAt(centre);
      this.camera.updateMatrixWorld();
      if (this.cornersOf(device).every((p) => Math.max(Math.abs(p.x), Math.abs(p.y)) < 0.94)) break;
    }
    this.controls.target.copy(centre);
    this.controls.update();
    this.invalidate();
  }

  /** The corners of the workspace on the screen, from -1 to 1. */
  private cornersOf({ workspace_m: { min, max }, T_world_device }: DeviceState): Vector3[] {
    const T = new Matrix4().fromArray(T_world_device);
    return Array.from({ length: 8 }, (_, i) => {
      const at = [0, 1, 2].map((k) => ((i >> k) & 1 ? max : min)[k]!);
      return new Vector3().fromArray(at).applyMatrix4(T).project(this.camera);
    });
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
    if (!this.hasPicture) return;
    const now_ms = performance.now();
    const moving = now_ms - this.movedAt_ms < SETTLE_MS;
    if (moving && this.stillDirty && now_ms - this.drawnAt_ms > SLOW_MS && this.wasMoving) this.slow = true;
    this.wasMoving = moving;
    this.drawnAt_ms = now_ms;
    if (this.isCoarse !== (moving && this.slow)) {
      this.objects.isCoarse = this.isCoarse = moving && this.slow;
      this.stillDirty = true;
    }
    if (!this.stillDirty && !this.liveDirty) return;
    this.liveLight.position.set(-0.6, 1, 0.8).transformDirection(this.camera.matrixWorld);
    // After a motion the coarse meshes go, and the picture is taken.
    if (this.software && moving) this.drawAll();
    else if (this.stillDirty || !this.software) this.drawStill();
    else this.drawLive();
    this.stillDirty = this.liveDirty = false;
  }

  private drawAll(): void {
    this.renderer.autoClear = true;
    this.renderer.render(this.scene, this.camera);
    this.renderer.autoClear = false;
    this.renderer.render(this.live, this.camera);
  }

  private drawStill(): void {
    if (this.stillDirty) this.still.take(this.scene, this.camera);
    this.still.show();
    this.renderer.render(this.live, this.camera);
    if (this.software) this.liveAt = this.liveRegion();
  }

  // Only where the live parts were and are.
  private drawLive(): void {
    const now = this.liveRegion();
    const { min, max } = this.liveAt.union(now);
    this.liveAt = now;
    if (max.x <= min.x || max.y <= min.y) return;
    this.renderer.setScissor(min.x, min.y, max.x - min.x, max.y - min.y);
    this.renderer.setScissorTest(true);
    this.still.show();
    this.renderer.render(this.live, this.camera);
    this.renderer.setScissorTest(false);
  }

  /** Bounds on the canvas of what moves with the hand, in points from its lower left corner. Lines are excluded: the box rests,
   * and the spring is between HIP and proxy. */
  private liveRegion(): Box2 {
    const { camera } = this;
    const size = this.renderer.getSize(new Vector2());
    const all = new Box2(new Vector2(), size);
    const box = new Box3();
    const part = new Box3();
    this.live.updateMatrixWorld();
    this.live.traverseVisible((node) => {
      if (!(node instanceof Mesh)) return;
      const geometry = node.geometry as BufferGeometry;
      if (!geometry.boundingBox) geometry.computeBoundingBox();
      box.union(part.copy(geometry.boundingBox!).applyMatrix4(node.matrixWorld));
    });
    const region = new Box2();
    if (box.isEmpty()) return region;
    for (let i = 0; i < 8; ++i) {
      const corner = new Vector3(...([0, 1, 2] as const).map((k) => ((i >> k) & 1 ? box.max : box.min).getComponent(k)));
      corner.applyMatrix4(camera.matrixWorldInverse);
      if (corner.z > -camera.near) return all; // beside or behind the camera
      corner.applyMatrix4(camera.projectionMatrix);
      region.expandByPoint(new Vector2((corner.x + 1) / 2, (corner.y + 1) / 2).multiply(size));
    }
    region.expandByScalar(MARGIN_PX);
    region.min.floor();
    region.max.ceil();
    return region.intersect(all);
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement!;
    if (width === 0 || height === 0) return;
    if (this.hasPicture) {
      // The zoom of the browser changes it, too.
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, MOST_PIXELS_PER_POINT));
      this.renderer.setSize(width, height, false);
    }
    this.at = this.canvas.getBoundingClientRect();
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.invalidate();
  }
}
