// The small convex problem inside the god-object method: the point nearest to a target on the free side of a
// few planes.
#pragma once

#include <array>

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// A half-space { x : normal . (x - anchor) >= standoff }, device metres. The anchor stays near the contact,
/// so that heights are exact however far the scene is from the origin.
struct HalfSpace {
  Vec3 normal = Vec3::Zero();
  Vec3 anchor = Vec3::Zero();
  double standoff = 0;

  double height(const Vec3& x) const noexcept { return normal.dot(x - anchor) - standoff; }
};

inline constexpr int kMaxActive = 3;  ///< planes that can hold a point in space
inline constexpr int kMaxHalfSpaces = 4;  ///< those and the newcomer

/// The solution and the planes that hold it: point = target + sum of multiplier[i] * normal of active[i].
struct Projection {
  bool found = false;  ///< false: the planes leave no room, or are too nearly parallel to tell
  Vec3 point = Vec3::Zero();
  int count = 0;
  std::array<int, kMaxActive> active{};
  std::array<double, kMaxActive> multiplier{};
};

/// The point nearest to `target` that is above all `count` <= 4 planes (a plane may be violated by up to
/// `tolerance`). `from` is where the caller stands, near the planes; it is the result's point when none is
/// found.
Projection projectOntoActiveSet(const HalfSpace* halfSpaces, int count, const Vec3& target, const Vec3& from,
                          double tolerance) noexcept;

/// How deep the target lies below planes that all hold: lengths l_i >= 0 with target + sum l_i normal_i on
/// all of them. At most three, from projectOntoActiveSet.
void depthsBelow(const HalfSpace* halfSpaces, int count, const Vec3& target, double* depths) noexcept;

}  // namespace hapticd::realtime
