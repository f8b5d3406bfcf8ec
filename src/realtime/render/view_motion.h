// What rests in the world, as a change of the view moves it on the device.
#pragma once

#include "geometry/types.h"

namespace hapticd::realtime {

/// A command that moves a part near the proxy farther is a jump.
inline constexpr double kLongestMotion_m = 0.020;

/// From the view of the tick before to that of this one.
struct ViewMotion {
  const geometry::Affine& T_device_world;
  const geometry::Affine& T_world_before;

  geometry::Vec3 of(const geometry::Vec3& p) const noexcept { return T_device_world * (T_world_before * p); }
  bool jumpsAt(const geometry::Vec3& p) const noexcept { return !((of(p) - p).norm() <= kLongestMotion_m); }
};

}  // namespace hapticd::realtime
