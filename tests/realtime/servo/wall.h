// A wall for hands and arms in closed loop.
#pragma once

#include <memory>

#include "geometry/types.h"
#include "scene/snapshot.h"
#include "scene/surface.h"

namespace hapticd::realtime {

using geometry::Vec3;

inline constexpr double kHandDamping = 5;    // N s/m
inline constexpr double kSettled_m = 10e-6;  // peak to peak

// Solid where y < 0.
inline std::shared_ptr<const scene::SceneSnapshot> wall(const scene::Surface& surface) {
  auto snapshot = std::make_shared<scene::SceneSnapshot>();
  snapshot->revision = 1;
  scene::Plane plane;
  plane.normal = Vec3::UnitY();
  plane.surface = surface;
  snapshot->planes.push_back(plane);
  return snapshot;
}

inline scene::Surface stiff(double stiffness_N_per_m) {
  scene::Surface surface;
  surface.stiffness_N_per_m = stiffness_N_per_m;
  return surface;
}

}  // namespace hapticd::realtime
