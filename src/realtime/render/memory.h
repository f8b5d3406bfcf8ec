// What a renderer knows of earlier ticks while its proxy is free of contact, besides the place of the proxy:
// the clocks of what runs.
#pragma once

#include <array>
#include <cstdint>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/effect.h"
#include "scene/plane.h"

namespace hapticd::realtime {

using base::Nanos;
using geometry::Vec3;

using scene::kMaxEffects;

/// A running effect.
struct EffectMemory {
  std::int32_t index = 0;
  Nanos begin = 0;
  Vec3 anchor = Vec3::Zero();  ///< of a friction effect, device metres
  // The angle of a vibration: `angle_rad` at `since`, which is -1 before it starts.
  double frequency_rad_per_s = 0;
  double angle_rad = 0;
  Nanos since = -1;
};

/// A plane of the scene that nothing touches.
struct PlaneMemory {
  std::int32_t index = 0;
  Nanos placed = 0;
  double depth_m = 0;   ///< of the HIP at the placement
  double raised_m = 0;  ///< of the surface above the plane, in the last tick
};

/// A plain value without pointers. What the scene holds besides starts anew.
struct RenderMemory {
  std::uint32_t effectCount = 0;
  std::array<EffectMemory, kMaxEffects> effects;
  std::uint32_t planeCount = 0;
  std::array<PlaneMemory, scene::kMaxPlanes> planes;
  Nanos buzzBegin = 0;
};

}  // namespace hapticd::realtime
