#pragma once

#include "geometry/types.h"

namespace hapticd::realtime {

/// A vector in the direction of `v`, no longer than `limit`.
inline geometry::Vec3 atMost(const geometry::Vec3& v, double limit) noexcept {
  const double size = v.norm();
  return size > limit ? geometry::Vec3(limit / size * v) : v;
}

}  // namespace hapticd::realtime
