// The convex problem inside the god-object method: the projection of a target onto the intersection of a few
// half-spaces.
#pragma once

#include <array>

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// A half-space { x : normal . (x - anchor) >= standoff }, device metres. The anchor lies near the contact,
/// so that heights keep their precision far from the origin.
struct HalfSpace {
  Vec3 normal = Vec3::Zero();
  Vec3 anchor = Vec3::Zero();
  double standoff = 0;

  double height(const Vec3& x) const noexcept { return normal.dot(x - anchor) - standoff; }
};

inline constexpr int kMaxActive = 3;      ///< half-spaces that can hold a point in space
inline constexpr int kMaxHalfSpaces = 4;  ///< those and the newest one

/// The solution and its active set: point = target + sum of multiplier[i] * normal of active[i].
struct Projection {
  bool found = false;  ///< false: the intersection is empty, or its faces are too nearly parallel
  Vec3 point = Vec3::Zero();
  int count = 0;
  std::array<int, kMaxActive> active{};  ///< ascending
  std::array<double, kMaxActive> multiplier{};
};

/// The point nearest to `target` in all `count` <= 4 half-spaces; each may be violated by up to `tolerance`
/// metres. `from` is a point near all of them, to which coordinates are taken relative; it is the result when
/// there is no solution. noexcept, no allocation.
Projection projectOntoActiveSet(const HalfSpace* halfSpaces, int count, const Vec3& target, const Vec3& from,
                                double tolerance) noexcept;

/// Depths of the target below an active set: lengths l_i >= 0 such that target + sum l_i normal_i is the
/// nearest point in all of the `count` <= 3 half-spaces. False when they leave no room: the largest height
/// alone.
bool depthsBelow(const HalfSpace* halfSpaces, int count, const Vec3& target, double* depths) noexcept;

}  // namespace hapticd::realtime
