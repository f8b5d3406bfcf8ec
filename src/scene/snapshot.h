// The scene at one moment, immutable, for the servo loop.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <vector>

#include "scene/effect.h"
#include "scene/force_field.h"
#include "scene/mesh_geometry.h"
#include "scene/motion.h"
#include "scene/plane.h"
#include "scene/surface.h"
#include "scene/workspace.h"

namespace hapticd::scene {

/// One object that exerts force. Immutable and shared between snapshots: a new one is made only when it
/// changes.
struct ObjectState {
  std::int32_t id = 0;
  std::shared_ptr<const MeshGeometry> mesh;
  Motion motion;
  Surface surface;
};

/// Everything the servo loop needs to know of the scene. Built and freed on the scene thread, read by servos.
struct SceneSnapshot {
  std::uint64_t revision = 0;
  Workspace workspace;
  TouchableFaces faces = TouchableFaces::both;
  /// Touchable objects with triangles and stiffness, by ascending id.
  std::vector<std::shared_ptr<const ObjectState>> objects;
  /// Over positions in `objects`: boxes in world units around all that an object sweeps during its motion.
  std::shared_ptr<const SpatialIndex> objectIndex;
  Nanos settledAt = 0;             ///< PublishedObjects::settledAt
  std::vector<Effect> effects;     ///< running ones, by ascending index
  std::vector<Plane> planes;       ///< at most kMaxPlanes, by ascending index
  std::vector<ForceField> fields;  ///< their forces add up; constraints are among them
  std::optional<Buzz> buzz;

  /// The object with this id; null when it does not exert force.
  const ObjectState* find(std::int32_t id) const noexcept {
    const auto it =
        std::lower_bound(objects.begin(), objects.end(), id,
                         [](const auto& object, std::int32_t wanted) { return object->id < wanted; });
    return it != objects.end() && (*it)->id == id ? it->get() : nullptr;
  }
};

}  // namespace hapticd::scene
