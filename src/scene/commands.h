// Every verb a client can say to the scene, as plain values in the client's own units.
//
// "World units" are the client's; "metres" here are the stock VRPN calls' unit, which is world / 1000
// whatever the workspace. Values are as they came: the builder checks them and answers with notices.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::scene {

using geometry::Triangle;
using geometry::Vec3;
using geometry::Vec3f;

// Objects and their meshes.

/// The scene has at least this many objects, ids 0…count-1. Never removes any.
struct SetObjectNumber {
  std::int32_t count = 0;
};

/// A run of vertices from number `first` on. Without triangles, consecutive triples are faces.
struct SetVertices {
  std::int32_t object = 0;
  std::int32_t first = 0;
  std::vector<Vec3f> positions;  ///< object units
};

/// A run of triangles from number `first` on. From then on the mesh is indexed and, as stock VRPN has it, in
/// metres; not so when they come in bulk.
struct SetTriangles {
  std::int32_t object = 0;
  std::int32_t first = 0;
  std::vector<Triangle> triangles;
  bool makesMetres = true;
};

/// Accepted and ignored: normals follow from the triangles.
struct SetNormal {
  std::int32_t object = 0;
};

struct RemoveTriangle {
  std::int32_t object = 0;
  std::int32_t triangle = 0;
};

/// All vertices and triangles go; the next vertices make triples again.
struct ClearMesh {
  std::int32_t object = 0;
};

/// Places the mesh in its object; replaces the one before. Row-major, translation in 3, 7, 11, metres.
struct TransformMesh {
  std::int32_t object = 0;
  std::array<float, 16> matrix{};
};

/// Accepted and ignored: there is one way to collide.
struct SetTrimeshType {
  std::int32_t object = 0;
  std::int32_t type = 0;
};

/// Parent -1 is the scene.
struct AddObject {
  std::int32_t object = 0;
  std::int32_t parent = -1;
};

/// A root of its own: the scene's origin does not move it.
struct AddObjectExScene {
  std::int32_t object = 0;
};

struct MoveToParent {
  std::int32_t object = 0;
  std::int32_t parent = -1;
};

/// With all that hangs below it. Object 0 becomes empty instead.
struct RemoveObject {
  std::int32_t object = 0;
};

/// Pose and scale below the parent: 16 doubles, column-major, translation in 12, 13, 14, object units.
struct SetTransform {
  std::int32_t object = 0;
  std::array<double, 16> matrix{};
};

struct SetObjectPosition {
  std::int32_t object = 0;
  Vec3 position_m = Vec3::Zero();
};

struct SetObjectOrientation {
  std::int32_t object = 0;
  Vec3 axis = Vec3::UnitZ();
  double angle_rad = 0;
};

struct SetObjectScale {
  std::int32_t object = 0;
  Vec3 scale = Vec3::Ones();
};

struct SetTouchable {
  std::int32_t object = 0;
  bool touchable = true;
};

// Surfaces.

/// One property by name: "stiffness", "damping", "static friction", "dynamic friction", "popthrough" in 0…1,
/// "mass" in kg.
struct SetSurfaceProperty {
  std::int32_t object = 0;
  std::string name;
  double value = 0;
};

/// Stock units: stiffness 1 is 1000 N/m, damping 0.005 is 5 N·s/m. Also makes mesh edits felt at once.
struct SetSurface {
  std::int32_t object = 0;
  double stiffness = 0;
  double damping = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;
};

/// 0 front, 1 back, anything else both; for all objects.
struct SetTouchableFaces {
  std::int32_t faces = 2;
};

// Between the device and the world.

/// Matrices are column-major; the clip cube of the projection is fitted to the device workspace.
struct SetWorkspaceProjection {
  std::array<double, 16> model{};
  std::array<double, 16> projection{};
};

/// The box (min xyz, max xyz, world units), seen through `model`, is fitted to the device workspace.
struct SetWorkspaceBox {
  std::array<double, 16> model{};
  std::array<double, 6> box{};
};

/// Where the device stands in the world.
struct SetHapticOrigin {
  Vec3 position_m = Vec3::Zero();
  Vec3 axis = Vec3::UnitZ();
  double angle_rad = 0;
};

struct SetHapticScale {
  double scale = 1;
};

/// Where the scene stands in the world.
struct SetSceneOrigin {
  Vec3 position_m = Vec3::Zero();
  Vec3 axis = Vec3::UnitZ();
  double angle_rad = 0;
};

// Forces that belong to no object. They are owned by the client that last set or started them.

/// Defines or redefines an effect: constant, spring, viscous, friction, vibrationMotor, vibrationContact.
struct DefineEffect {
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
  std::int32_t index = 0;
};

struct StopEffect {
  std::int32_t index = 0;
};

/// a x + b y + c z + d = 0 with d in metres; a zero normal removes it. Stock units as in SetSurface.
struct SetPlane {
  std::int32_t index = 0;
  std::array<double, 4> plane{};
  double stiffness = 0;
  double damping = 0;
  double staticFriction = 0;
  double dynamicFriction = 0;
  std::int32_t recoveryCycles = 1;  ///< milliseconds over which a new plane comes in
};

/// Adhesion, texture and buzz of plane 0.
struct SetPlaneDetail {
  double adhesionNormal_N = 0;
  double adhesionLateral_N = 0;
  double textureAmplitude_m = 0;
  double textureWavelength_m = 0;
  double buzzAmplitude_m = 0;
  double buzzFrequency_Hz = 0;
};

/// F = force + jacobian (x - origin) within the radius; all zero stops it.
struct SetForceField {
  Vec3 origin_m = Vec3::Zero();
  Vec3 force_N = Vec3::Zero();
  std::array<double, 9> jacobian_N_per_m{};  ///< row by row
  double radius_m = 0;
};

struct SetConstraintEnabled {
  bool enabled = false;
};

/// 0 none, 1 point, 2 line, 3 plane.
struct SetConstraintMode {
  std::int32_t mode = 0;
};

enum class ConstraintVector { point, linePoint, lineDirection, planePoint, planeNormal };

/// One of the vectors of the constraint: points in metres, directions of any length.
struct SetConstraintVector {
  ConstraintVector which = ConstraintVector::point;
  Vec3 value = Vec3::Zero();
};

struct SetConstraintStiffness {
  double stiffness_N_per_m = 0;
};

/// Effect 0 is a buzz: amplitude (N), frequency (Hz), duration (s), direction xyz; missing ones by default.
struct StartCustomEffect {
  std::uint32_t effect = 0;
  std::vector<float> parameters;
};

struct StopCustomEffect {};

// The scene as a whole.

/// Workspace, objects and effects back to the initial state.
struct ResetScene {};

/// What this client says until CommitBatch takes effect at once, in one snapshot, or not at all.
struct BeginBatch {};
struct CommitBatch {};

using SceneCommand =
    std::variant<SetObjectNumber, SetVertices, SetTriangles, SetNormal, RemoveTriangle, ClearMesh,
                 TransformMesh, SetTrimeshType, AddObject, AddObjectExScene, MoveToParent, RemoveObject,
                 SetTransform, SetObjectPosition, SetObjectOrientation, SetObjectScale, SetTouchable,
                 SetSurfaceProperty, SetSurface, SetTouchableFaces, SetWorkspaceProjection, SetWorkspaceBox,
                 SetHapticOrigin, SetHapticScale, SetSceneOrigin, DefineEffect, StartEffect, StopEffect,
                 SetPlane, SetPlaneDetail, SetForceField, SetConstraintEnabled, SetConstraintMode,
                 SetConstraintVector, SetConstraintStiffness, StartCustomEffect, StopCustomEffect, ResetScene,
                 BeginBatch, CommitBatch>;

}  // namespace hapticd::scene
