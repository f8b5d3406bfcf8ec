// Exact orientation predicates for floats.
#pragma once

#include <cstdint>

#include "geometry/types.h"

namespace hapticd::geometry {

/// Number of answers that needed exact arithmetic, which costs about a hundred times as much as the filter.
using ExactCount = std::uint64_t;

/// The sign of det(a - d, b - d, c - d): +1 or -1 for the two sides of the plane abc, 0 for coplanar points.
/// Coordinates must be finite. noexcept, no allocation.
int orientation(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, ExactCount& exact) noexcept;

/// The sign of the area of abc seen along an axis (0, 1, 2 for x, y, z): +1 counter-clockwise, 0 when
/// collinear.
int orientationAlong(int axis, const Vec3f& a, const Vec3f& b, const Vec3f& c, ExactCount& exact) noexcept;

}  // namespace hapticd::geometry
