// Written by `wire_docs typescript` from the table in src/wire/messages.h; do not edit. Every message of the wire:
// its fields (named as in docs/wire-messages.md, in camel case) and their layout.
import { define } from "./codec";

export type Vec3 = [number, number, number];
export type Vec4 = [number, number, number, number];

/** Carries a text for a person: severity 0 is normal, 1 a warning, 2 an error. */
export interface Text {
  severity: number;
  level: number;
  text: string;
}
export const Text = /* @__PURE__ */ define<Text>("vrpn_Base text_message", [
  ["severity", "u32"],
  ["level", "u32"],
  ["text", "text", 1024],
]);

/** Asks whether the device is alive. */
export type Ping = Record<string, never>;
export const Ping = /* @__PURE__ */ define<Ping>("vrpn_Base ping_message", []);

/** Answers a ping: the device is alive. */
export type Pong = Record<string, never>;
export const Pong = /* @__PURE__ */ define<Pong>("vrpn_Base pong_message", []);

/** Reports the force at the device. */
export interface Force {
  /** N */
  force: Vec3;
}
export const Force = /* @__PURE__ */ define<Force>("vrpn_ForceDevice Force", [
  ["force", "f64", 3],
]);

/** Reports the surface contact point: where the proxy rests, and the stylus orientation. */
export interface Scp {
  /** m */
  position: Vec3;
  orientation: Vec4;
}
export const Scp = /* @__PURE__ */ define<Scp>("vrpn_ForceDevice SCP", [
  ["position", "f64", 3],
  ["orientation", "f64", 4],
]);

/** Reports a fault: 0 value out of range, 1 duty cycle, 2 force or motor, 3 other, 4 recovered. */
export interface ForceError {
  code: number;
}
export const ForceError = /* @__PURE__ */ define<ForceError>("vrpn_ForceDevice Force_Error", [
  ["code", "i32"],
]);

/** Sets a force that varies linearly with the distance from an origin inside a sphere; all zero (sent reliably) stops it. */
export interface ForceField {
  /** m */
  origin: Vec3;
  /** N */
  force: Vec3;
  /** N/m */
  jacobian: ArrayLike<number>;
  /** m */
  radius: number;
}
export const ForceField = /* @__PURE__ */ define<ForceField>("vrpn_ForceDevice Force_Field", [
  ["origin", "f32", 3],
  ["force", "f32", 3],
  ["jacobian", "f32", 9],
  ["radius", "f32"],
]);

/** Sets a plane a x + b y + c z + d = 0 to touch; starting and stopping it is sent reliably. */
export interface Plane {
  plane: Vec4;
  stiffness: number;
  damping: number;
  dynamicFriction: number;
  staticFriction: number;
  index: number;
  recoveryCycles: number;
}
export const Plane = /* @__PURE__ */ define<Plane>("vrpn_ForceDevice Plane", [
  ["plane", "f32", 4],
  ["stiffness", "f32"],
  ["damping", "f32"],
  ["dynamicFriction", "f32"],
  ["staticFriction", "f32"],
  ["index", "i32"],
  ["recoveryCycles", "i32"],
]);

/** Sets the texture, the buzz and the adhesion of the plane. */
export interface Plane2 {
  normalAdhesion: number;
  lateralAdhesion: number;
  textureAmplitude: number;
  textureWavelength: number;
  buzzAmplitude: number;
  /** Hz */
  buzzFrequency: number;
}
export const Plane2 = /* @__PURE__ */ define<Plane2>("vrpn_ForceDevice Plane2", [
  ["normalAdhesion", "f32"],
  ["lateralAdhesion", "f32"],
  ["textureAmplitude", "f32"],
  ["textureWavelength", "f32"],
  ["buzzAmplitude", "f32"],
  ["buzzFrequency", "f32"],
]);

/** Starts an effect that the device driver defines by number; 0xFFFFFFFF stops it. */
export interface CustomEffect {
  effect: number;
  parameters: ArrayLike<number>;
}
export const CustomEffect = /* @__PURE__ */ define<CustomEffect>("vrpn_ForceDevice Custom Effect", [
  ["effect", "u32"],
  ["parameters", "list", "u32", "f32", 15998],
]);

/** Switches the constraint on (1) or off (0). */
export interface ConstraintEnable {
  enable: number;
}
export const ConstraintEnable = /* @__PURE__ */ define<ConstraintEnable>("vrpn_ForceDevice constraint_enable", [
  ["enable", "i32"],
]);

/** Chooses the constraint: 0 none, 1 point, 2 line, 3 plane. */
export interface ConstraintMode {
  mode: number;
}
export const ConstraintMode = /* @__PURE__ */ define<ConstraintMode>("vrpn_ForceDevice constraint_mode", [
  ["mode", "i32"],
]);

/** Sets the point of a point constraint. */
export interface ConstraintPoint {
  /** m */
  point: Vec3;
}
export const ConstraintPoint = /* @__PURE__ */ define<ConstraintPoint>("vrpn_ForceDevice constraint_point", [
  ["point", "f32", 3],
]);

/** Sets a point of the line of a line constraint. */
export interface ConstraintLinePoint {
  /** m */
  point: Vec3;
}
export const ConstraintLinePoint = /* @__PURE__ */ define<ConstraintLinePoint>("vrpn_ForceDevice constraint_linept", [
  ["point", "f32", 3],
]);

/** Sets the direction of the line of a line constraint. */
export interface ConstraintLineDirection {
  direction: Vec3;
}
export const ConstraintLineDirection = /* @__PURE__ */ define<ConstraintLineDirection>("vrpn_ForceDevice constraint_linedir", [
  ["direction", "f32", 3],
]);

/** Sets a point of the plane of a plane constraint. */
export interface ConstraintPlanePoint {
  /** m */
  point: Vec3;
}
export const ConstraintPlanePoint = /* @__PURE__ */ define<ConstraintPlanePoint>("vrpn_ForceDevice constraint_plpt", [
  ["point", "f32", 3],
]);

/** Sets the normal of the plane of a plane constraint. */
export interface ConstraintPlaneNormal {
  normal: Vec3;
}
export const ConstraintPlaneNormal = /* @__PURE__ */ define<ConstraintPlaneNormal>("vrpn_ForceDevice constraint_plnorm", [
  ["normal", "f32", 3],
]);

/** Sets the spring that holds the constraint. */
export interface ConstraintStiffness {
  /** N/m */
  stiffness: number;
}
export const ConstraintStiffness = /* @__PURE__ */ define<ConstraintStiffness>("vrpn_ForceDevice constraint_KSpring", [
  ["stiffness", "f32"],
]);

/** Adds an object below a parent (-1: the scene). */
export interface AddObject {
  object: number;
  parent: number;
}
export const AddObject = /* @__PURE__ */ define<AddObject>("vrpn_ForceDevice addObject", [
  ["object", "i32"],
  ["parent", "i32"],
]);

/** Adds an object beside the scene, as another root. */
export interface AddObjectExScene {
  object: number;
}
export const AddObjectExScene = /* @__PURE__ */ define<AddObjectExScene>("vrpn_ForceDevice addObjectExScene", [
  ["object", "i32"],
]);

/** Moves an object below another parent. */
export interface MoveToParent {
  object: number;
  parent: number;
}
export const MoveToParent = /* @__PURE__ */ define<MoveToParent>("vrpn_ForceDevice moveToParent", [
  ["object", "i32"],
  ["parent", "i32"],
]);

/** Places an object relative to its parent. */
export interface SetObjectPosition {
  object: number;
  /** m */
  position: Vec3;
}
export const SetObjectPosition = /* @__PURE__ */ define<SetObjectPosition>("vrpn_ForceDevice setObjectPosition", [
  ["object", "i32"],
  ["position", "f32", 3],
]);

/** Turns an object relative to its parent, about an axis. */
export interface SetObjectOrientation {
  object: number;
  axis: Vec3;
  /** rad */
  angle: number;
}
export const SetObjectOrientation = /* @__PURE__ */ define<SetObjectOrientation>("vrpn_ForceDevice setObjectOrientation", [
  ["object", "i32"],
  ["axis", "f32", 3],
  ["angle", "f32"],
]);

/** Scales an object along its own axes. */
export interface SetObjectScale {
  object: number;
  scale: Vec3;
}
export const SetObjectScale = /* @__PURE__ */ define<SetObjectScale>("vrpn_ForceDevice setObjectScale", [
  ["object", "i32"],
  ["scale", "f32", 3],
]);

/** Removes an object. */
export interface RemoveObject {
  object: number;
}
export const RemoveObject = /* @__PURE__ */ define<RemoveObject>("vrpn_ForceDevice removeObject", [
  ["object", "i32"],
]);

/** Sets a vertex of an object's mesh; without triangles, consecutive triples are faces. */
export interface SetVertex {
  object: number;
  vertex: number;
  /** object units */
  position: Vec3;
}
export const SetVertex = /* @__PURE__ */ define<SetVertex>("vrpn_ForceDevice setVertex", [
  ["object", "i32"],
  ["vertex", "i32"],
  ["position", "f32", 3],
]);

/** Sets a vertex normal of an object's mesh. */
export interface SetNormal {
  object: number;
  normal: number;
  direction: Vec3;
}
export const SetNormal = /* @__PURE__ */ define<SetNormal>("vrpn_ForceDevice setNormal", [
  ["object", "i32"],
  ["normal", "i32"],
  ["direction", "f32", 3],
]);

/** Sets a triangle of an object's mesh by vertex and normal numbers (normals -1: none). */
export interface SetTriangle {
  object: number;
  triangle: number;
  vertices: Vec3;
  normals: Vec3;
}
export const SetTriangle = /* @__PURE__ */ define<SetTriangle>("vrpn_ForceDevice setTriangle", [
  ["object", "i32"],
  ["triangle", "i32"],
  ["vertices", "i32", 3],
  ["normals", "i32", 3],
]);

/** Removes a triangle of an object's mesh. */
export interface RemoveTriangle {
  object: number;
  triangle: number;
}
export const RemoveTriangle = /* @__PURE__ */ define<RemoveTriangle>("vrpn_ForceDevice removeTriangle", [
  ["object", "i32"],
  ["triangle", "i32"],
]);

/** Makes mesh edits effective, with this surface. */
export interface UpdateTrimeshChanges {
  object: number;
  stiffness: number;
  damping: number;
  staticFriction: number;
  dynamicFriction: number;
}
export const UpdateTrimeshChanges = /* @__PURE__ */ define<UpdateTrimeshChanges>("vrpn_ForceDevice updateTrimeshChanges", [
  ["object", "i32"],
  ["stiffness", "f32"],
  ["damping", "f32"],
  ["staticFriction", "f32"],
  ["dynamicFriction", "f32"],
]);

/** Moves the vertices of an object's mesh by a row-major 4x4 matrix. */
export interface TransformTrimesh {
  object: number;
  matrix: ArrayLike<number>;
}
export const TransformTrimesh = /* @__PURE__ */ define<TransformTrimesh>("vrpn_ForceDevice transformTrimesh", [
  ["object", "i32"],
  ["matrix", "f32", 16],
]);

/** Chooses a rendering library: 0 Ghost, 1 Hcollide; object -1 means all. */
export interface SetTrimeshType {
  object: number;
  type: number;
}
export const SetTrimeshType = /* @__PURE__ */ define<SetTrimeshType>("vrpn_ForceDevice setTrimeshType", [
  ["object", "i32"],
  ["type", "i32"],
]);

/** Removes an object's mesh. */
export interface ClearTrimesh {
  object: number;
}
export const ClearTrimesh = /* @__PURE__ */ define<ClearTrimesh>("vrpn_ForceDevice clearTrimesh", [
  ["object", "i32"],
]);

/** Places the device in the scene. */
export interface SetHapticOrigin {
  /** m */
  position: Vec3;
  axis: Vec3;
  /** rad */
  angle: number;
}
export const SetHapticOrigin = /* @__PURE__ */ define<SetHapticOrigin>("vrpn_ForceDevice setHapticOrigin", [
  ["position", "f32", 3],
  ["axis", "f32", 3],
  ["angle", "f32"],
]);

/** Scales the device's motion in the scene. */
export interface SetHapticScale {
  scale: number;
}
export const SetHapticScale = /* @__PURE__ */ define<SetHapticScale>("vrpn_ForceDevice setHapticScale", [
  ["scale", "f32"],
]);

/** Places the scene. */
export interface SetSceneOrigin {
  /** m */
  position: Vec3;
  axis: Vec3;
  /** rad */
  angle: number;
}
export const SetSceneOrigin = /* @__PURE__ */ define<SetSceneOrigin>("vrpn_ForceDevice setSceneOrigin", [
  ["position", "f32", 3],
  ["axis", "f32", 3],
  ["angle", "f32"],
]);

/** Is reserved: registered by stock libraries, never sent. */
export type GetNewObjectId = Record<string, never>;
export const GetNewObjectId = /* @__PURE__ */ define<GetNewObjectId>("vrpn_ForceDevice getNewObjectID", []);

/** Starts (1) or stops (0) rendering an object. */
export interface SetObjectIsTouchable {
  object: number;
  touchable: number;
}
export const SetObjectIsTouchable = /* @__PURE__ */ define<SetObjectIsTouchable>("vrpn_ForceDevice setObjectIsTouchable", [
  ["object", "i32"],
  ["touchable", "i16"],
]);

/** Fits the device workspace to a box (min x y z, max x y z) seen through a model matrix (column-major). */
export interface SetWorkspaceBoundingBox {
  model: ArrayLike<number>;
  /** world units */
  box: ArrayLike<number>;
}
export const SetWorkspaceBoundingBox = /* @__PURE__ */ define<SetWorkspaceBoundingBox>("vrpn_ForceDevice setWorkspaceBoundingBox", [
  ["model", "f64", 16],
  ["box", "f64", 6],
]);

/** Fits the device workspace to a view volume, by a model and a projection matrix (column-major). */
export interface SetWorkspaceProjectionMatrix {
  model: ArrayLike<number>;
  projection: ArrayLike<number>;
}
export const SetWorkspaceProjectionMatrix = /* @__PURE__ */ define<SetWorkspaceProjectionMatrix>("vrpn_ForceDevice setWorkspaceProjectionMatrix", [
  ["model", "f64", 16],
  ["projection", "f64", 16],
]);

/** Makes the scene have at least this many objects, numbered from 0. */
export interface SetObjectNumber {
  count: number;
}
export const SetObjectNumber = /* @__PURE__ */ define<SetObjectNumber>("vrpn_ForceDevice setObjectNumber", [
  ["count", "i32"],
]);

/** Sets the pose and scale of an object: a column-major matrix, translation in elements 12 to 14. */
export interface SetTransformMatrix {
  object: number;
  matrix: ArrayLike<number>;
}
export const SetTransformMatrix = /* @__PURE__ */ define<SetTransformMatrix>("vrpn_ForceDevice setTransformMatrix", [
  ["object", "i32"],
  ["matrix", "f64", 16],
]);

/** Sets one property of an object's surface: stiffness, damping, static friction, dynamic friction, popthrough or mass. */
export interface SetHapticProperty {
  object: number;
  property: string;
  value: number;
}
export const SetHapticProperty = /* @__PURE__ */ define<SetHapticProperty>("vrpn_ForceDevice setHapticProperty", [
  ["object", "i32"],
  ["property", "name", 20],
  ["value", "f32"],
]);

/** Chooses the faces that are rendered: 0 front, 1 back, any other value both. */
export interface SetTouchableFace {
  face: number;
}
export const SetTouchableFace = /* @__PURE__ */ define<SetTouchableFace>("vrpn_ForceDevice setTouchableFace", [
  ["face", "i32"],
]);

/** Defines an effect by index: constant, spring, viscous, friction, vibrationMotor or vibrationContact; duration 0 lasts until stopped. */
export interface Effect {
  type: string;
  index: number;
  gain: number;
  /** N */
  magnitude: number;
  /** ms */
  duration: number;
  frequency: number;
  /** world units */
  position: Vec3;
  direction: Vec3;
}
export const Effect = /* @__PURE__ */ define<Effect>("vrpn_ForceDevice Effect", [
  ["type", "name", 20],
  ["index", "i32"],
  ["gain", "f64"],
  ["magnitude", "f64"],
  ["duration", "f64"],
  ["frequency", "f64"],
  ["position", "f64", 3],
  ["direction", "f64", 3],
]);

/** Starts an effect. */
export interface StartEffect {
  index: number;
}
export const StartEffect = /* @__PURE__ */ define<StartEffect>("vrpn_ForceDevice startEffect", [
  ["index", "i32"],
]);

/** Stops an effect. */
export interface StopEffect {
  index: number;
}
export const StopEffect = /* @__PURE__ */ define<StopEffect>("vrpn_ForceDevice stopEffect", [
  ["index", "i32"],
]);

/** Resets workspace, objects and effects to their initial state; the byte has no meaning. */
export interface ResetScene {
  ignored: number;
}
export const ResetScene = /* @__PURE__ */ define<ResetScene>("vrpn_ForceDevice resetScene", [
  ["ignored", "u8"],
]);

/** Reports the depth of penetration. */
export interface Dop {
  /** m */
  depth: number;
}
export const Dop = /* @__PURE__ */ define<Dop>("vrpn_ForceDevice DOP", [
  ["depth", "f64"],
]);

/** Reports whether anything is touched. */
export interface IsTouching {
  touching: number;
}
export const IsTouching = /* @__PURE__ */ define<IsTouching>("vrpn_ForceDevice isTouching", [
  ["touching", "i16"],
]);

/** Reports which object is touched, -1 for none. */
export interface TouchedObject {
  object: number;
}
export const TouchedObject = /* @__PURE__ */ define<TouchedObject>("vrpn_ForceDevice TouchedObject", [
  ["object", "i32"],
]);

/** Reports the angle between stylus and surface normal, 0 without contact. */
export interface Angle {
  /** deg */
  angle: number;
  touching: number;
}
export const Angle = /* @__PURE__ */ define<Angle>("vrpn_ForceDevice Angle", [
  ["angle", "f64"],
  ["touching", "i16"],
]);

/** Reports the pose of a sensor; the filler is ignored. */
export interface TrackerPosQuat {
  sensor: number;
  filler: number;
  /** m */
  position: Vec3;
  orientation: Vec4;
}
export const TrackerPosQuat = /* @__PURE__ */ define<TrackerPosQuat>("vrpn_Tracker Pos_Quat", [
  ["sensor", "i32"],
  ["filler", "i32"],
  ["position", "f64", 3],
  ["orientation", "f64", 4],
]);

/** Reports how fast a sensor moves and by which rotation it turns within an interval. */
export interface TrackerVelocity {
  sensor: number;
  filler: number;
  /** m/s */
  velocity: Vec3;
  rotation: Vec4;
  /** s */
  interval: number;
}
export const TrackerVelocity = /* @__PURE__ */ define<TrackerVelocity>("vrpn_Tracker Velocity", [
  ["sensor", "i32"],
  ["filler", "i32"],
  ["velocity", "f64", 3],
  ["rotation", "f64", 4],
  ["interval", "f64"],
]);

/** Reports how a sensor's velocity changes and by which rotation its turning changes within an interval. */
export interface TrackerAcceleration {
  sensor: number;
  filler: number;
  /** m/s^2 */
  acceleration: Vec3;
  rotation: Vec4;
  /** s */
  interval: number;
}
export const TrackerAcceleration = /* @__PURE__ */ define<TrackerAcceleration>("vrpn_Tracker Acceleration", [
  ["sensor", "i32"],
  ["filler", "i32"],
  ["acceleration", "f64", 3],
  ["rotation", "f64", 4],
  ["interval", "f64"],
]);

/** Reports the pose of the tracker's base in the room. */
export interface TrackerToRoom {
  /** m */
  position: Vec3;
  orientation: Vec4;
}
export const TrackerToRoom = /* @__PURE__ */ define<TrackerToRoom>("vrpn_Tracker To_Room", [
  ["position", "f64", 3],
  ["orientation", "f64", 4],
]);

/** Says how a tracked unit is mounted on its sensor, one message for each sensor; the filler is ignored. */
export interface TrackerUnitToSensor {
  sensor: number;
  filler: number;
  /** m */
  position: Vec3;
  orientation: Vec4;
}
export const TrackerUnitToSensor = /* @__PURE__ */ define<TrackerUnitToSensor>("vrpn_Tracker Unit_To_Sensor", [
  ["sensor", "i32"],
  ["filler", "i32"],
  ["position", "f64", 3],
  ["orientation", "f64", 4],
]);

/** Reports the box in which the tracker works. */
export interface TrackerWorkspace {
  /** m */
  min: Vec3;
  /** m */
  max: Vec3;
}
export const TrackerWorkspace = /* @__PURE__ */ define<TrackerWorkspace>("vrpn_Tracker Workspace", [
  ["min", "f64", 3],
  ["max", "f64", 3],
]);

/** Asks for To_Room. */
export type TrackerRequestToRoom = Record<string, never>;
export const TrackerRequestToRoom = /* @__PURE__ */ define<TrackerRequestToRoom>("vrpn_Tracker Request_Tracker_To_Room", []);

/** Asks for one Unit_To_Sensor per sensor. */
export type TrackerRequestUnitToSensor = Record<string, never>;
export const TrackerRequestUnitToSensor = /* @__PURE__ */ define<TrackerRequestUnitToSensor>("vrpn_Tracker Request_Unit_To_Sensor", []);

/** Asks for Workspace. */
export type TrackerRequestWorkspace = Record<string, never>;
export const TrackerRequestWorkspace = /* @__PURE__ */ define<TrackerRequestWorkspace>("vrpn_Tracker Request_Tracker_Workspace", []);

/** Asks for a report rate. */
export interface TrackerSetUpdateRate {
  /** Hz */
  rate: number;
}
export const TrackerSetUpdateRate = /* @__PURE__ */ define<TrackerSetUpdateRate>("vrpn_Tracker set_update_rate", [
  ["rate", "f64"],
]);

/** Makes the present pose the origin. */
export type TrackerResetOrigin = Record<string, never>;
export const TrackerResetOrigin = /* @__PURE__ */ define<TrackerResetOrigin>("vrpn_Tracker Reset_Origin", []);

/** Reports that a button went down (1) or up (0). */
export interface ButtonChange {
  button: number;
  state: number;
}
export const ButtonChange = /* @__PURE__ */ define<ButtonChange>("vrpn_Button Change", [
  ["button", "i32"],
  ["state", "i32"],
]);

/** Reports the state of every button, on each new connection and for each ping. */
export interface ButtonStates {
  states: ArrayLike<number>;
}
export const ButtonStates = /* @__PURE__ */ define<ButtonStates>("vrpn_Button States", [
  ["states", "list", "i32", "i32", 256],
]);

/** Makes a button (-99: all) momentary (10), a toggle that starts off (20) or one that starts on (21); the time stamp is that of the client's start. */
export interface ButtonAdmin {
  button: number;
  event: number;
}
export const ButtonAdmin = /* @__PURE__ */ define<ButtonAdmin>("vrpn_Button Admin", [
  ["button", "i32"],
  ["event", "i32"],
]);

/** Reports that a button's toggle was switched off (20, also for momentary) or on (21). */
export interface ButtonAlert {
  button: number;
  event: number;
}
export const ButtonAlert = /* @__PURE__ */ define<ButtonAlert>("vrpn_Button Alert", [
  ["button", "i32"],
  ["event", "i32"],
]);

/** Reports the value of every channel; even their number travels as a float. */
export interface AnalogChannels {
  channels: ArrayLike<number>;
}
export const AnalogChannels = /* @__PURE__ */ define<AnalogChannels>("vrpn_Analog Channel", [
  ["channels", "list", "f64", "f64", 128],
]);

/** Asks for the abilities of the server and its device; answered by Capabilities. */
export type QueryCapabilities = Record<string, never>;
export const QueryCapabilities = /* @__PURE__ */ define<QueryCapabilities>("hapticd Query_Capabilities", []);

/** Answers Query_Capabilities: version of the extensions, feature bits, facts of the device. */
export interface Capabilities {
  version: number;
  features: number;
  /** Hz */
  servoRate: number;
  /** Hz */
  reportRate: number;
  /** N */
  peakForce: number;
  buttons: number;
  /** m */
  workspace: ArrayLike<number>;
}
export const Capabilities = /* @__PURE__ */ define<Capabilities>("hapticd Capabilities", [
  ["version", "i32"],
  ["features", "u32"],
  ["servoRate", "f64"],
  ["reportRate", "f64"],
  ["peakForce", "f64"],
  ["buttons", "i32"],
  ["workspace", "f64", 6],
]);

/** Sets a run of vertices of an object from number first on: x y z each. */
export interface MeshVertices {
  object: number;
  first: number;
  /** world units */
  positions: ArrayLike<number>;
}
export const MeshVertices = /* @__PURE__ */ define<MeshVertices>("hapticd Mesh_Vertices", [
  ["object", "i32"],
  ["first", "i32"],
  ["positions", "list", "i32", "f32", 15000],
]);

/** Sets a run of triangles of an object from number first on: three vertex numbers each. */
export interface MeshTriangles {
  object: number;
  first: number;
  vertices: ArrayLike<number>;
}
export const MeshTriangles = /* @__PURE__ */ define<MeshTriangles>("hapticd Mesh_Triangles", [
  ["object", "i32"],
  ["first", "i32"],
  ["vertices", "list", "i32", "i32", 15000],
]);

/** Starts a batch: the client's commands until Batch_Commit become visible in one tick, or not at all. */
export type BatchBegin = Record<string, never>;
export const BatchBegin = /* @__PURE__ */ define<BatchBegin>("hapticd Batch_Begin", []);

/** Ends a batch and makes it visible. */
export type BatchCommit = Record<string, never>;
export const BatchCommit = /* @__PURE__ */ define<BatchCommit>("hapticd Batch_Commit", []);

/** Chooses which reports this client gets and how often; rate 0 keeps the rate as it is. */
export interface Subscribe {
  kinds: number;
  /** Hz */
  rate: number;
}
export const Subscribe = /* @__PURE__ */ define<Subscribe>("hapticd Subscribe", [
  ["kinds", "u32"],
  ["rate", "f64"],
]);

/** Reports one servo tick: its number, its time on the server's monotonic clock, and its values. */
export interface TickReport {
  tick: number;
  /** ns */
  time: number;
  revision: number;
  /** m */
  hand: Vec3;
  /** m */
  proxy: Vec3;
  /** m/s */
  velocity: Vec3;
  orientation: Vec4;
  /** N */
  force: Vec3;
  /** m */
  depth: number;
  object: number;
  buttons: number;
  guardActive: number;
  guardLatched: number;
}
export const TickReport = /* @__PURE__ */ define<TickReport>("hapticd Tick", [
  ["tick", "u64"],
  ["time", "i64"],
  ["revision", "u64"],
  ["hand", "f64", 3],
  ["proxy", "f64", 3],
  ["velocity", "f64", 3],
  ["orientation", "f64", 4],
  ["force", "f64", 3],
  ["depth", "f64"],
  ["object", "i32"],
  ["buttons", "u32"],
  ["guardActive", "u32"],
  ["guardLatched", "u32"],
]);

/** Reports every touched object of a tick: object, point, normal, force on the hand (10 numbers each). */
export interface ContactList {
  tick: number;
  /** ns */
  time: number;
  contacts: ArrayLike<number>;
}
export const ContactList = /* @__PURE__ */ define<ContactList>("hapticd Contacts", [
  ["tick", "u64"],
  ["time", "i64"],
  ["contacts", "list", "i32", "f64", 80],
]);

/** Brings the force to zero within one tick, until re-armed. Any client may. */
export type StopForces = Record<string, never>;
export const StopForces = /* @__PURE__ */ define<StopForces>("hapticd Stop_Forces", []);

/** Clears a stop and latched faults; forces return over 0.5 s. */
export type RearmForces = Record<string, never>;
export const RearmForces = /* @__PURE__ */ define<RearmForces>("hapticd Rearm_Forces", []);

/** Reports, on change, which trips hold the force (bits) and whether it is armed or stopped. */
export interface GuardState {
  active: number;
  latched: number;
  armed: number;
  stopped: number;
}
export const GuardState = /* @__PURE__ */ define<GuardState>("hapticd Guard_State", [
  ["active", "u32"],
  ["latched", "u32"],
  ["armed", "i16"],
  ["stopped", "i16"],
]);

/** Starts a watchdog: a client that then sends none for 500 ms is lost; watch 0 ends it. */
export interface Heartbeat {
  watch: number;
}
export const Heartbeat = /* @__PURE__ */ define<Heartbeat>("hapticd Heartbeat", [
  ["watch", "i16"],
]);

/** Moves the simulated hand's target while hold is set; one client holds it at a time. */
export interface HoldHand {
  hold: number;
  /** world units */
  position: Vec3;
  orientation: Vec4;
  buttons: number;
}
export const HoldHand = /* @__PURE__ */ define<HoldHand>("hapticd Hold_Hand", [
  ["hold", "i16"],
  ["position", "f64", 3],
  ["orientation", "f64", 4],
  ["buttons", "u32"],
]);

/** Replaces the client's contacts near the hand, up to 16 (24 numbers each): felt until they expire. */
export interface RemoteContacts {
  /** ns */
  time: number;
  /** ns */
  stateTime: number;
  contacts: ArrayLike<number>;
}
export const RemoteContacts = /* @__PURE__ */ define<RemoteContacts>("hapticd Remote_Contacts", [
  ["time", "i64"],
  ["stateTime", "i64"],
  ["contacts", "list", "i32", "f64", 384],
]);

/** Sets a force that the server holds for its lifetime, within a budget of energy. */
export interface HeldForce {
  /** ns */
  time: number;
  /** N */
  force: Vec3;
  /** N m */
  torque: Vec3;
  /** s */
  lifetime: number;
}
export const HeldForce = /* @__PURE__ */ define<HeldForce>("hapticd Held_Force", [
  ["time", "i64"],
  ["force", "f64", 3],
  ["torque", "f64", 3],
  ["lifetime", "f64"],
]);

/** Reports the newest tick: pose, velocity, buttons, force written, remote contacts (8 numbers each). */
export interface HandState {
  tick: number;
  /** ns */
  time: number;
  /** ns */
  contactsTime: number;
  /** ns */
  forceTime: number;
  /** m */
  position: Vec3;
  orientation: Vec4;
  /** m/s */
  velocity: Vec3;
  /** rad/s */
  angularVelocity: Vec3;
  /** N */
  force: Vec3;
  /** N */
  heldForce: Vec3;
  /** J */
  energy: number;
  /** rad */
  gripper: number;
  buttons: number;
  flags: number;
  guardActive: number;
  contacts: ArrayLike<number>;
}
export const HandState = /* @__PURE__ */ define<HandState>("hapticd Hand_State", [
  ["tick", "u64"],
  ["time", "i64"],
  ["contactsTime", "i64"],
  ["forceTime", "i64"],
  ["position", "f64", 3],
  ["orientation", "f64", 4],
  ["velocity", "f64", 3],
  ["angularVelocity", "f64", 3],
  ["force", "f64", 3],
  ["heldForce", "f64", 3],
  ["energy", "f64"],
  ["gripper", "f64"],
  ["buttons", "u32"],
  ["flags", "u32"],
  ["guardActive", "u32"],
  ["contacts", "list", "i32", "f64", 128],
]);

/** Presents a token for a role, and a random key that the connections of one program share. */
export interface Identify {
  token: string;
  key: number;
}
export const Identify = /* @__PURE__ */ define<Identify>("hapticd Identify", [
  ["token", "name", 128],
  ["key", "u64"],
]);

/** Gives up the control that `control = "first"` gave to this client, for the next one to command. */
export type ReleaseControl = Record<string, never>;
export const ReleaseControl = /* @__PURE__ */ define<ReleaseControl>("hapticd Release_Control", []);

/** Reports the objects that move, until 1 s after they rest: 13 numbers each, up to 256 in one tick. */
export interface Poses {
  tick: number;
  /** ns */
  time: number;
  poses: ArrayLike<number>;
}
export const Poses = /* @__PURE__ */ define<Poses>("hapticd Poses", [
  ["tick", "u64"],
  ["time", "i64"],
  ["poses", "list", "i32", "f64", 3328],
]);

/** Names an object, for the viewer and for recordings. */
export interface SetObjectName {
  object: number;
  text: string;
}
export const SetObjectName = /* @__PURE__ */ define<SetObjectName>("hapticd Set_Object_Name", [
  ["object", "i32"],
  ["text", "name", 64],
]);

/** Marks a moment, such as "trial 3 begins": recorded, and reported to all clients with its time. */
export interface Marker {
  /** ns */
  time: number;
  text: string;
}
export const Marker = /* @__PURE__ */ define<Marker>("hapticd Marker", [
  ["time", "i64"],
  ["text", "text", 256],
]);

/** Pauses a replayed recording, changes its speed (0 keeps it), or seeks (a negative time does not). */
export interface ReplayControl {
  paused: number;
  speed: number;
  /** s */
  position: number;
}
export const ReplayControl = /* @__PURE__ */ define<ReplayControl>("hapticd Replay_Control", [
  ["paused", "i16"],
  ["speed", "f64"],
  ["position", "f64"],
]);

/** Begins or ends a recording on the server, in a file of this name; answered by a text. */
export interface RecordingControl {
  record: number;
  name: string;
}
export const RecordingControl = /* @__PURE__ */ define<RecordingControl>("hapticd Recording_Control", [
  ["record", "i16"],
  ["name", "name", 128],
]);

/** Every message, in the order of the table. */
export const ALL_MESSAGES = [
  Text,
  Ping,
  Pong,
  Force,
  Scp,
  ForceError,
  ForceField,
  Plane,
  Plane2,
  CustomEffect,
  ConstraintEnable,
  ConstraintMode,
  ConstraintPoint,
  ConstraintLinePoint,
  ConstraintLineDirection,
  ConstraintPlanePoint,
  ConstraintPlaneNormal,
  ConstraintStiffness,
  AddObject,
  AddObjectExScene,
  MoveToParent,
  SetObjectPosition,
  SetObjectOrientation,
  SetObjectScale,
  RemoveObject,
  SetVertex,
  SetNormal,
  SetTriangle,
  RemoveTriangle,
  UpdateTrimeshChanges,
  TransformTrimesh,
  SetTrimeshType,
  ClearTrimesh,
  SetHapticOrigin,
  SetHapticScale,
  SetSceneOrigin,
  GetNewObjectId,
  SetObjectIsTouchable,
  SetWorkspaceBoundingBox,
  SetWorkspaceProjectionMatrix,
  SetObjectNumber,
  SetTransformMatrix,
  SetHapticProperty,
  SetTouchableFace,
  Effect,
  StartEffect,
  StopEffect,
  ResetScene,
  Dop,
  IsTouching,
  TouchedObject,
  Angle,
  TrackerPosQuat,
  TrackerVelocity,
  TrackerAcceleration,
  TrackerToRoom,
  TrackerUnitToSensor,
  TrackerWorkspace,
  TrackerRequestToRoom,
  TrackerRequestUnitToSensor,
  TrackerRequestWorkspace,
  TrackerSetUpdateRate,
  TrackerResetOrigin,
  ButtonChange,
  ButtonStates,
  ButtonAdmin,
  ButtonAlert,
  AnalogChannels,
  QueryCapabilities,
  Capabilities,
  MeshVertices,
  MeshTriangles,
  BatchBegin,
  BatchCommit,
  Subscribe,
  TickReport,
  ContactList,
  StopForces,
  RearmForces,
  GuardState,
  Heartbeat,
  HoldHand,
  RemoteContacts,
  HeldForce,
  HandState,
  Identify,
  ReleaseControl,
  Poses,
  SetObjectName,
  Marker,
  ReplayControl,
  RecordingControl,
] as const;

/** Vertices or triangles in one message at most. */
export const MOST_IN_ONE_MESSAGE = 5000;
/** Bits of Subscribe.kinds. */
export const REPORT_TRACKER = 1;
export const REPORT_FORCE = 2;
export const REPORT_BUTTON = 4;
export const REPORT_ANALOG = 8;
export const REPORT_TICK = 16;
export const REPORT_CONTACTS = 32;
export const REPORT_HAND = 64;
export const REPORT_CONTACT_POINT = 128;
export const REPORT_TOUCH_BUTTON = 256;
export const REPORT_CONTACT_ANALOG = 512;
export const REPORT_HIP = 1024;
export const REPORT_POSES = 2048;
/** Bits of Capabilities.features. */
export const FEATURE_BULK_MESH = 1;
export const FEATURE_BATCH = 2;
export const FEATURE_SUBSCRIBE = 4;
export const FEATURE_STOP = 8;
export const FEATURE_HEARTBEAT = 16;
export const FEATURE_HOLD_HAND = 32;
export const FEATURE_REMOTE_CONTACTS = 64;
