// A scene for people to look at, including objects without force and effects that do not run.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "geometry/triangle_mesh.h"
#include "scene/config.h"
#include "scene/effect.h"
#include "scene/force_field.h"
#include "scene/plane.h"
#include "scene/surface.h"
#include "scene/workspace.h"

namespace hapticd::scene {

struct ObjectDescription {
  std::int32_t id = 0;
  std::int32_t parent = -1;  ///< another object, -1 the scene, -2 nothing
  bool touchable = true;
  std::string name;       ///< for people; may be empty
  double worldUnits = 1;  ///< of one unit of the object, in which clients place it: 1000 for stock geometry
  Affine T_world_object = Affine::Identity();   ///< world units; where it is, or is on its way to
  Affine T_parent_object = Affine::Identity();  ///< as setTransformMatrix takes it
  Affine T_object_mesh = Affine::Identity();
  Surface surface;  ///< as rendered
  /// The mesh that is rendered, null when there is none; equal pointers mean an equal shape. While it
  /// deforms, where it is on its way to.
  std::shared_ptr<const std::vector<geometry::Vec3f>> vertices;
  std::shared_ptr<const std::vector<geometry::Triangle>> triangles;
};

struct EffectDescription {
  Effect effect;
  bool active = false;
};

/// Of the constraint, which is there when a mode is chosen and it is enabled.
struct ConstraintDescription {
  std::string_view mode;                              ///< point, line, plane
  geometry::Vec3 point = geometry::Vec3::Zero();      ///< world units, of any of the three
  geometry::Vec3 direction = geometry::Vec3::Zero();  ///< of the line, or the normal of the plane
  double stiffness_N_per_m = 0;
};

struct SceneDescription {
  std::uint64_t revision = 0;
  Workspace workspace;
  TouchableFaces faces = TouchableFaces::both;
  Surface surfaceAtOne;  ///< at 1 of the properties of setHapticProperty
  VibrationUnit contactVibrationUnit = VibrationUnit::radPerSecond;  ///< in which clients send it
  Affine T_world_scene = Affine::Identity();                         ///< of the objects below the scene
  std::vector<ObjectDescription> objects;                            ///< by ascending id
  std::vector<EffectDescription> effects;  ///< by ascending index, also those that do not run
  std::vector<Plane> planes;
  std::optional<ConstraintDescription> constraint;
  std::vector<ForceField> fields;  ///< without the constraint; stiff ones as the client sent them
};

/// The name of an effect's type, as clients send it.
std::string_view nameOf(EffectType type);

}  // namespace hapticd::scene
