// The law of how fast a force may change.
//
// From F0 the next force F1 keeps its distance to the segment from zero to F0 within the step. The force may
// fall towards zero at once; it grows, turns and reverses by at most the step.
#pragma once

#include <algorithm>

#include "geometry/types.h"

namespace hapticd::realtime {

/// The point of the segment from zero to `last` that is nearest to `force`.
inline geometry::Vec3 nearestReached(const geometry::Vec3& last, const geometry::Vec3& force) noexcept {
  const double length2 = last.squaredNorm();
  return length2 > 0 ? geometry::Vec3(std::clamp(force.dot(last) / length2, 0.0, 1.0) * last)
                     : geometry::Vec3(geometry::Vec3::Zero());
}

/// The force nearest to `wanted` that the law allows after `last`; `wanted` itself when it is allowed.
inline geometry::Vec3 withinForceRate(const geometry::Vec3& last, const geometry::Vec3& wanted,
                                      double step_N) noexcept {
  constexpr double kRounding = 1e-12;  // relative: a force on the limit does not exceed it
  const geometry::Vec3 reached = nearestReached(last, wanted);
  const geometry::Vec3 beyond = wanted - reached;
  const double change = beyond.norm();
  return change <= step_N * (1 + kRounding) ? wanted : geometry::Vec3(reached + step_N / change * beyond);
}

}  // namespace hapticd::realtime
