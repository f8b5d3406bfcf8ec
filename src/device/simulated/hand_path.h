// Where a hand means to be, as a function of time.
#pragma once

#include <cstdint>
#include <limits>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::device {

using base::Nanos;
using geometry::Quat;
using geometry::Vec3;

/// An intention at one moment. Device frame, metres.
struct HandPose {
  Vec3 position_m = Vec3::Zero();
  Vec3 velocity_m_per_s = Vec3::Zero();
  Quat orientation = Quat::Identity();
  std::uint32_t buttons = 0;  ///< bit i is button i
};

/// Immutable: read by the servo thread, freed elsewhere.
class HandPath {
 public:
  HandPath() = default;
  virtual ~HandPath() = default;
  HandPath(const HandPath&) = delete;
  HandPath& operator=(const HandPath&) = delete;

  /// The intention at a time after the start of the path; at rest at its ends outside of it. noexcept, no
  /// allocation.
  virtual HandPose at(Nanos sinceStart) const noexcept = 0;
  /// From start to end; 0 for a path that stands still.
  virtual Nanos duration() const noexcept = 0;
  /// The largest force of the hand towards the path. A hand that meets something in its way presses with no
  /// more than this.
  virtual double strength_N() const noexcept { return std::numeric_limits<double>::infinity(); }
};

}  // namespace hapticd::device
