// Ramp-out of forces whose owner left, and rotation of forces between frames.
#pragma once

#include <algorithm>
#include <cmath>

#include "base/time.h"
#include "geometry/types.h"
#include "scene/force_owner.h"

namespace hapticd::realtime {

inline constexpr double kReleaseTime_s = 0.250;

/// The share, 1 … 0, of a force that began to ramp out at `begin`.
inline double remainingShare(base::Nanos begin, base::Nanos now) noexcept {
  return std::max(0.0, 1 - base::toSeconds(now - begin) / kReleaseTime_s);
}

/// The share of a force whose release began at `begin`, negative when it has not begun, and whose owner may
/// be gone without the scene thread having noticed; `owner` may be null.
inline double remainingShare(base::Nanos begin, const scene::ForceOwner* owner, base::Nanos now) noexcept {
  const double released = begin < 0 ? 1 : remainingShare(begin, now);
  return owner == nullptr ? released : std::min(released, owner->share(begin, now));
}

/// A force in another frame: rotated, never scaled. `t` is a similarity.
inline geometry::Vec3 rotated(const geometry::Affine& t, const geometry::Vec3& force) noexcept {
  const double scale = geometry::scaleOf(t.linear());
  return scale > 0 ? geometry::Vec3(t.linear() * force / scale) : geometry::Vec3(geometry::Vec3::Zero());
}

}  // namespace hapticd::realtime
