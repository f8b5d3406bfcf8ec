// The response of GET /api/state.

export interface Histogram {
  p50: number;
  p99: number;
  p999: number;
  max: number;
  bins: [from_us: number, count: number][];
}

export interface DeviceState {
  name: string;
  names: string[];
  driver: string;
  simulated: boolean;
  scene: number;
  workspace_m: { min: number[]; max: number[] };
  T_world_device: number[];
  world_per_reported: number;
  peak_force_N: number;
  rate_Hz: number;
  realtime: boolean;
  hand: string;
  held_by: number | null;
  fault: string;
  guard: { armed: boolean; stopped: boolean; active: string[]; latched: string[] };
  loop: {
    ticks: number;
    overruns: number;
    dropped_reports: number;
    period_us: Histogram;
    wakeup_us: Histogram;
    compute_us: Histogram;
  };
}

export interface ClientState {
  id: number;
  address: string;
  mode: string;
  role: string;
  devices: string[];
  connected_s: number;
  rate_Hz: number;
  bytes_in: number;
  bytes_out: number;
  dropped: number;
  ignored_datagrams: number;
  queued_bytes: number;
  commands: boolean;
}

/** SI; named as in the state. */
export interface SurfaceState {
  stiffness_N_per_m: number;
  damping_Ns_per_m: number;
  static_friction: number;
  dynamic_friction: number;
  popthrough: number;
}

export interface ObjectState extends SurfaceState {
  id: number;
  /** A file, as a rule; may be empty. */
  name: string;
  parent: number;
  touchable: boolean;
  /** Of one unit of the object: setTransformMatrix() takes its translation in these. */
  world_units: number;
  vertices: number;
  triangles: number;
  geometry: number;
  display_triangles: number;
  T_world_object: number[];
  /** As setTransformMatrix() takes it. */
  T_parent_object: number[];
  T_object_mesh: number[];
  mass_kg: number;
}

export type VibrationUnit = "rad/s" | "Hz";

export interface EffectState {
  index: number;
  type: string;
  active: boolean;
  magnitude_N: number;
  gain: number;
  duration_ms: number;
  frequency_Hz: number;
  position: number[];
  direction: number[];
}

export interface PlaneState {
  index: number;
  plane: number[];
  stiffness_N_per_m: number;
  damping_Ns_per_m: number;
  static_friction: number;
  dynamic_friction: number;
}

/** World units. */
export interface FieldState {
  origin: number[];
  force_N: number[];
  /** Row by row. */
  jacobian_N_per_unit: number[];
  /** null: everywhere. */
  radius: number | null;
}

export interface ConstraintState {
  mode: string;
  point: number[];
  direction: number[];
  stiffness_N_per_m: number;
}

/** A replayed recording; times in seconds since its first event. */
export interface ReplayState {
  file: string;
  position_s: number;
  speed: number;
  paused: boolean;
  ended: boolean;
  loop: boolean;
  /** null while the server reads the file. */
  duration_s: number | null;
  contacts: [from_s: number, to_s: number][];
  trips: [at_s: number, name: string][];
  markers: [at_s: number, text: string][];
}

export interface SceneState {
  devices: string[];
  revision: number;
  /** Of the objects whose parent is -1. */
  T_world_scene: number[];
  objects: ObjectState[];
  /** At 1 of setHapticProperty(); null until the scene has replied. */
  surface_at_1: SurfaceState | null;
  /** In which setEffect() takes the frequency of a vibrationContact. */
  vibration_contact_unit: VibrationUnit;
  effects: EffectState[];
  planes: PlaneState[];
  constraint: ConstraintState | null;
  fields: FieldState[];
}

export interface ServerState {
  server: { version: string; run: string; uptime_s: number; recording: string | null; replay: ReplayState | null };
  devices: DeviceState[];
  clients: ClientState[];
  scenes: SceneState[];
}

/** One server of the response of GET /api/servers. */
export interface NetworkServer {
  name: string;
  address: string;
  port: number;
  /** As a client opens them: "Phantom@192.168.1.7:3883". */
  devices: string[];
  /** Empty: none. */
  page: string;
  tls: boolean;
  version: string;
  this_server: boolean;
}

/** Whether the object can exert a force: it is touchable, has a stiffness and a mesh. */
export const isFelt = (o: ObjectState): boolean => o.touchable && o.stiffness_N_per_m > 0 && o.triangles > 0;
