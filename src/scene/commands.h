// Every command of the scene, as plain values in the client's own units.
//
// "World units" are the client's; "metres" are the unit of stock VRPN calls, world / 1000 whatever the
// workspace. Values are unchecked: the builder checks them and answers with notices.
//
// To add a command: its struct with kInfo here, at the END of CommandVariant, and its handler: handle() in
// object_commands.cpp or free_force_commands.cpp, apply() in builder.cpp, by its Target. The decoder converts
// the message that kInfo names; recordings store the members as they are, so a command in use never changes
// them.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "geometry/triangle_mesh.h"
#include "scene/command_info.h"

namespace hapticd::scene {

using geometry::Triangle;
using geometry::Vec3;
using geometry::Vec3f;

// Objects and their meshes.

/// Creates the missing ones of the objects 0…count-1. Never removes any.
struct SetObjectNumber {
  static constexpr CommandInfo kInfo{"SetObjectNumber", "vrpn_ForceDevice setObjectNumber", Target::objects,
                                     "count"};
  std::int32_t count = 0;
};

/// Sets a run of vertices from number `first` on. Without triangles, consecutive triples are faces.
struct SetVertices {
  static constexpr CommandInfo kInfo{"SetVertices", kNoMessage, Target::objects,
                                     "object",      "first",    "positions"};
  std::int32_t object = 0;
  std::int32_t first = 0;
  std::vector<Vec3f> positions;  ///< object units
};

/// Sets a run of triangles from number `first` on. The mesh is indexed from then on and, unless the triangles
/// came in bulk, in metres as in stock VRPN.
struct SetTriangles {
  static constexpr CommandInfo kInfo{"SetTriangles", kNoMessage,  Target::objects, "object",
                                     "first",        "triangles", "makesMetres"};
  std::int32_t object = 0;
  std::int32_t first = 0;
  std::vector<Triangle> triangles;
  bool makesMetres = true;
};

/// Accepted and ignored with a notice: normals follow from the triangles.
struct SetNormal {
  static constexpr CommandInfo kInfo{"SetNormal", kNoMessage, Target::objects, "object"};
  std::int32_t object = 0;
};

struct RemoveTriangle {
  static constexpr CommandInfo kInfo{"RemoveTriangle", "vrpn_ForceDevice removeTriangle", Target::objects,
                                     "object", "triangle"};
  std::int32_t object = 0;
  std::int32_t triangle = 0;
};

/// Removes all vertices and triangles; the next vertices form triples again.
struct ClearMesh {
  static constexpr CommandInfo kInfo{"ClearMesh", "vrpn_ForceDevice clearTrimesh", Target::objects, "object"};
  std::int32_t object = 0;
};

/// Places the mesh in its object; replaces the previous placement. Row-major, translation in 3, 7, 11,
/// metres.
struct TransformMesh {
  static constexpr CommandInfo kInfo{"TransformMesh", "vrpn_ForceDevice transformTrimesh", Target::objects,
                                     "object", "matrix"};
  std::int32_t object = 0;
  std::array<float, 16> matrix{};
};

/// Accepted and ignored with a notice: there is one collision algorithm.
struct SetTrimeshType {
  static constexpr CommandInfo kInfo{"SetTrimeshType", "vrpn_ForceDevice setTrimeshType", Target::objects,
                                     "object", "type"};
  std::int32_t object = 0;
  std::int32_t type = 0;
};

/// Creates an object in metres, or moves an existing one below another parent; -1 is the scene.
struct AddObject {
  static constexpr CommandInfo kInfo{"AddObject", "vrpn_ForceDevice addObject", Target::objects, "object",
                                     "parent"};
  std::int32_t object = 0;
  std::int32_t parent = -1;
};

/// Creates an object that the origin of the scene does not move.
struct AddObjectExScene {
  static constexpr CommandInfo kInfo{"AddObjectExScene", "vrpn_ForceDevice addObjectExScene", Target::objects,
                                     "object"};
  std::int32_t object = 0;
};

struct MoveToParent {
  static constexpr CommandInfo kInfo{"MoveToParent", "vrpn_ForceDevice moveToParent", Target::objects,
                                     "object", "parent"};
  std::int32_t object = 0;
  std::int32_t parent = -1;
};

/// Removes an object and its descendants. Object 0 becomes empty instead.
struct RemoveObject {
  static constexpr CommandInfo kInfo{"RemoveObject", "vrpn_ForceDevice removeObject", Target::objects,
                                     "object"};
  std::int32_t object = 0;
};

/// Pose and scale below the parent: 16 doubles, column-major, translation in 12, 13, 14, object units.
struct SetTransform {
  static constexpr CommandInfo kInfo{"SetTransform", "vrpn_ForceDevice setTransformMatrix", Target::objects,
                                     "object", "matrix"};
  std::int32_t object = 0;
  std::array<double, 16> matrix{};
};

struct SetObjectPosition {
  static constexpr CommandInfo kInfo{"SetObjectPosition", "vrpn_ForceDevice setObjectPosition",
                                     Target::objects, "object", "position_m"};
  std::int32_t object = 0;
  Vec3 position_m = Vec3::Zero();
};

struct SetObjectOrientation {
  static constexpr CommandInfo kInfo{"SetObjectOrientation",
                                     "vrpn_ForceDevice setObjectOrientation",
                                     Target::objects,
                                     "object",
                                     "axis",
                                     "angle_rad"};
  std::int32_t object = 0;
  Vec3 axis = Vec3::UnitZ();
  double angle_rad = 0;
};

struct SetObjectScale {
  static constexpr CommandInfo kInfo{"SetObjectScale", "vrpn_ForceDevice setObjectScale", Target::objects,
                                     "object", "scale"};
  std::int32_t object = 0;
  Vec3 scale = Vec3::Ones();
};

struct SetTouchable {
  static constexpr CommandInfo kInfo{"SetTouchable", "vrpn_ForceDevice setObjectIsTouchable", Target::objects,
                                     "object", "touchable"};
  std::int32_t object = 0;
  bool touchable = true;
};

/// A name for people; without effect on forces.
struct SetObjectName {
  static constexpr CommandInfo kInfo{"SetObjectName", "hapticd Set_Object_Name", Target::objects, "object",
                                     "text"};
  std::int32_t object = 0;
  std::string text;
};

// Surfaces.

/// One property by name: "stiffness", "damping", "static friction", "dynamic friction", "popthrough" in 0…1,
/// "mass" in kg.
struct SetSurfaceProperty {
  static constexpr CommandInfo kInfo{
      "SetSurfaceProperty", "vrpn_ForceDevice setHapticProperty", Target::objects, "object", "name", "value"};
  std::int32_t object = 0;
  std::string name;
  double value = 0;
};

/// Stock units: stiffness 1 is 1000 N/m, damping 0.005 is 5 N·s/m. Also publishes mesh edits at once.
struct SetSurface {
  static constexpr CommandInfo kInfo{"SetSurface",     "vrpn_ForceDevice updateTrimeshChanges",
                                     Target::objects,  "object",
                                     "stiffness",      "damping",
                                     "staticFriction", "dynamicFriction"};
  std::int32_t object = 0;
  double stiffness = 0;
  double damping = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;
};

/// 0 front, 1 back, anything else both; for all objects.
struct SetTouchableFaces {
  static constexpr CommandInfo kInfo{"SetTouchableFaces", "vrpn_ForceDevice setTouchableFace", Target::scene,
                                     "faces"};
  std::int32_t faces = 2;
};

// The map between the device and the world.

/// Fits the clip cube of the projection to the device workspace. Matrices are column-major.
struct SetWorkspaceProjection {
  static constexpr CommandInfo kInfo{"SetWorkspaceProjection",
                                     "vrpn_ForceDevice setWorkspaceProjectionMatrix", Target::scene, "model",
                                     "projection"};
  std::array<double, 16> model{};
  std::array<double, 16> projection{};
};

/// Fits the box (min xyz, max xyz, world units), transformed by `model`, to the device workspace.
struct SetWorkspaceBox {
  static constexpr CommandInfo kInfo{"SetWorkspaceBox", "vrpn_ForceDevice setWorkspaceBoundingBox",
                                     Target::scene, "model", "box"};
  std::array<double, 16> model{};
  std::array<double, 6> box{};
};

/// Places the device in the world.
struct SetHapticOrigin {
  static constexpr CommandInfo kInfo{
      "SetHapticOrigin", "vrpn_ForceDevice setHapticOrigin", Target::scene, "position_m", "axis",
      "angle_rad"};
  Vec3 position_m = Vec3::Zero();
  Vec3 axis = Vec3::UnitZ();
  double angle_rad = 0;
};

struct SetHapticScale {
  static constexpr CommandInfo kInfo{"SetHapticScale", "vrpn_ForceDevice setHapticScale", Target::scene,
                                     "scale"};
  double scale = 1;
};

/// Places the scene in the world.
struct SetSceneOrigin {
  static constexpr CommandInfo kInfo{"SetSceneOrigin", "vrpn_ForceDevice setSceneOrigin",
                                     Target::objects,  "position_m",
                                     "axis",           "angle_rad"};
  Vec3 position_m = Vec3::Zero();
  Vec3 axis = Vec3::UnitZ();
  double angle_rad = 0;
};

// Forces that belong to no object. The client that last set or started one owns it.

/// Defines or redefines an effect; kEffectKinds in effect.h has the types.
struct DefineEffect {
  static constexpr CommandInfo kInfo{"DefineEffect", "vrpn_ForceDevice Effect",
                                     Target::forces, "type",
                                     "index",        "gain",
                                     "magnitude_N",  "duration_ms",
                                     "frequency",    "position",
                                     "direction"};
  std::string type;
  std::int32_t index = 0;
  double gain = 0;  ///< N/mm, viscous N/(mm/s)
  double magnitude_N = 0;
  double duration_ms = 0;  ///< 0: until stopped
  double frequency = 0;
  Vec3 position = Vec3::Zero();  ///< world units
  Vec3 direction = Vec3::Zero();
};

struct StartEffect {
  static constexpr CommandInfo kInfo{"StartEffect", "vrpn_ForceDevice startEffect", Target::forces, "index"};
  std::int32_t index = 0;
};

struct StopEffect {
  static constexpr CommandInfo kInfo{"StopEffect", "vrpn_ForceDevice stopEffect", Target::forces, "index"};
  std::int32_t index = 0;
};

/// Starts an effect as if so long ago. Recordings that begin while the server runs have it.
struct ContinueEffect {
  static constexpr CommandInfo kInfo{"ContinueEffect", kNoMessage, Target::forces, "index", "ran_ns"};
  std::int32_t index = 0;
  std::int64_t ran_ns = 0;
};

/// a x + b y + c z + d = 0 with d in metres; a zero normal removes it. Stock units as in SetSurface.
struct SetPlane {
  static constexpr CommandInfo kInfo{"SetPlane",        kNoMessage,      Target::forces, "index",
                                     "plane",           "stiffness",     "damping",      "staticFriction",
                                     "dynamicFriction", "recoveryCycles"};
  std::int32_t index = 0;
  std::array<double, 4> plane{};
  double stiffness = 0;
  double damping = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;
  std::int32_t recoveryCycles = 1;  ///< milliseconds over which a new plane fades in
};

/// Adhesion, texture and buzz of plane 0.
struct SetPlaneDetail {
  static constexpr CommandInfo kInfo{"SetPlaneDetail",      "vrpn_ForceDevice Plane2", Target::forces,
                                     "adhesionNormal_N",    "adhesionLateral_N",       "textureAmplitude_m",
                                     "textureWavelength_m", "buzzAmplitude_m",         "buzzFrequency_Hz"};
  double adhesionNormal_N = 0;
  double adhesionLateral_N = 0;
  double textureAmplitude_m = 0;
  double textureWavelength_m = 0;
  double buzzAmplitude_m = 0;
  double buzzFrequency_Hz = 0;
};

/// F = force + jacobian (x - origin) within the radius; all zero stops it.
struct SetForceField {
  static constexpr CommandInfo kInfo{"SetForceField", "vrpn_ForceDevice Force_Field",
                                     Target::forces,  "origin_m",
                                     "force_N",       "jacobian_N_per_m",
                                     "radius_m"};
  Vec3 origin_m = Vec3::Zero();
  Vec3 force_N = Vec3::Zero();
  std::array<double, 9> jacobian_N_per_m{};  ///< row by row
  double radius_m = 0;
};

struct SetConstraintEnabled {
  static constexpr CommandInfo kInfo{"SetConstraintEnabled", "vrpn_ForceDevice constraint_enable",
                                     Target::forces, "enabled"};
  bool enabled = false;
};

/// 0 none, 1 point, 2 line, 3 plane.
struct SetConstraintMode {
  static constexpr CommandInfo kInfo{"SetConstraintMode", "vrpn_ForceDevice constraint_mode", Target::forces,
                                     "mode"};
  std::int32_t mode = 0;
};

enum class ConstraintVector { point, linePoint, lineDirection, planePoint, planeNormal };

/// One of the vectors of the constraint: points in metres, directions of any length.
struct SetConstraintVector {
  static constexpr CommandInfo kInfo{"SetConstraintVector", kNoMessage, Target::forces, "which", "value"};
  ConstraintVector which = ConstraintVector::point;
  Vec3 value = Vec3::Zero();
};

struct SetConstraintStiffness {
  static constexpr CommandInfo kInfo{"SetConstraintStiffness", "vrpn_ForceDevice constraint_KSpring",
                                     Target::forces, "stiffness_N_per_m"};
  double stiffness_N_per_m = 0;
};

/// Effect 0 is a buzz: amplitude (N), frequency (Hz), duration (s), direction xyz; missing ones have
/// defaults.
struct StartCustomEffect {
  static constexpr CommandInfo kInfo{"StartCustomEffect", kNoMessage, Target::forces, "effect", "parameters"};
  std::uint32_t effect = 0;
  std::vector<float> parameters;
};

struct StopCustomEffect {
  static constexpr CommandInfo kInfo{"StopCustomEffect", kNoMessage, Target::forces};
};

/// The forces that the client owns ramp out, although it stays connected. Takes effect in an open batch, too.
/// The server issues it for a client that it does not hear.
struct ReleaseForces {
  static constexpr CommandInfo kInfo{"ReleaseForces", kNoMessage, Target::forces};
};

// The scene as a whole.

/// Resets workspace, objects and forces to the initial state.
struct ResetScene {
  static constexpr CommandInfo kInfo{"ResetScene", kNoMessage, Target::scene};
};

/// The commands of this client until CommitBatch take effect together, in one snapshot, or not at all.
struct BeginBatch {
  static constexpr CommandInfo kInfo{"BeginBatch", "hapticd Batch_Begin", Target::scene};
};
struct CommitBatch {
  static constexpr CommandInfo kInfo{"CommitBatch", "hapticd Batch_Commit", Target::scene};
};

/// The open batch of the client was refused as a whole: what follows until CommitBatch is dropped, too.
/// Recordings that begin while the server runs have it.
struct RefuseBatch {
  static constexpr CommandInfo kInfo{"RefuseBatch", kNoMessage, Target::scene};
};

/// What commands that set a mesh cannot say of it. Recordings that begin while the server runs have it.
struct ContinueMesh {
  static constexpr CommandInfo kInfo{"ContinueMesh", kNoMessage,    Target::objects,
                                     "object",       "hasDeformed", "edited_ns"};
  std::int32_t object = 0;
  /// 1: vertices have moved since its triangles were set; 2: others were published before these.
  std::int32_t hasDeformed = 0;
  std::int64_t edited_ns = -1;  ///< so long ago the first edit began that is not published; -1: there is none
};

/// Meshes that were published are not built again for so long. Recordings that begin while the server runs
/// have it.
struct PauseRebuilds {
  static constexpr CommandInfo kInfo{"PauseRebuilds", kNoMessage, Target::objects, "pause_ns"};
  std::int64_t pause_ns = 0;
};

/// The check of the mesh of an object is due in this time; the first one, with object -1, replaces those that
/// the commands of the scene have begun. Recordings that begin while the server runs have it.
struct ContinueCheck {
  static constexpr CommandInfo kInfo{"ContinueCheck", kNoMessage,  Target::objects,
                                     "object",        "isCurrent", "due_ns"};
  std::int32_t object = -1;
  std::int32_t isCurrent = 0;  ///< 0: the mesh has changed since; nothing is left to check
  std::int64_t due_ns = 0;
};

/// Recordings store the position in this list as the number of a command: append, never reorder or remove.
using CommandVariant =
    std::variant<SetObjectNumber, SetVertices, SetTriangles, SetNormal, RemoveTriangle, ClearMesh,
                 TransformMesh, SetTrimeshType, AddObject, AddObjectExScene, MoveToParent, RemoveObject,
                 SetTransform, SetObjectPosition, SetObjectOrientation, SetObjectScale, SetTouchable,
                 SetSurfaceProperty, SetSurface, SetTouchableFaces, SetWorkspaceProjection, SetWorkspaceBox,
                 SetHapticOrigin, SetHapticScale, SetSceneOrigin, DefineEffect, StartEffect, StopEffect,
                 SetPlane, SetPlaneDetail, SetForceField, SetConstraintEnabled, SetConstraintMode,
                 SetConstraintVector, SetConstraintStiffness, StartCustomEffect, StopCustomEffect, ResetScene,
                 BeginBatch, CommitBatch, ReleaseForces, SetObjectName, ContinueEffect, RefuseBatch,
                 ContinueMesh, PauseRebuilds, ContinueCheck>;

/// Any one command; std::visit, std::get and their like work on it. Copying, moving and destroying are
/// compiled once, in commands.cpp: a variant of so many structs costs every file that holds one several
/// seconds of compile time.
class SceneCommand : public CommandVariant {
 public:
  SceneCommand();
  template <class Command>
  requires requires { std::remove_cvref_t<Command>::kInfo; }
  SceneCommand(Command&& command)
      : CommandVariant(std::in_place_type<std::remove_cvref_t<Command>>, std::forward<Command>(command)) {}
  SceneCommand(const SceneCommand& other);
  SceneCommand(SceneCommand&& other) noexcept;
  SceneCommand& operator=(const SceneCommand& other);
  SceneCommand& operator=(SceneCommand&& other) noexcept;
  ~SceneCommand();
};

/// Which part of a scene executes the command.
Target targetOf(const SceneCommand& command);

/// Calls `visit.operator()<C>()` for each type of command, in the order of CommandVariant.
template <class Visit>
constexpr void forEachCommand(Visit&& visit) {
  [&]<class... C>(const std::variant<C...>*) {
    (visit.template operator()<C>(), ...);
  }(static_cast<const CommandVariant*>(nullptr));
}

/// Approximate size of a command in memory.
std::size_t bytesOf(const SceneCommand& command);

}  // namespace hapticd::scene
