// On which side a point lies, decided exactly: no rounding, whatever floats come in.
#pragma once

#include <cstdint>

#include "geometry/types.h"

namespace hapticd::geometry {

/// How many answers needed exact arithmetic, which costs some hundred times as much as the usual way.
using ExactCount = std::uint64_t;

/// The sign of det(a - d, b - d, c - d): +1 or -1 for the two sides of the plane abc, 0 for points in one
/// plane. Finite coordinates. noexcept, allocation-free.
int orientation(const Vec3f& a, const Vec3f& b, const Vec3f& c, const Vec3f& d, ExactCount& exact) noexcept;

/// The sign of the area of abc seen along an axis (0, 1, 2 for x, y, z): +1 counter-clockwise, 0 on a line.
int orientationAlong(int axis, const Vec3f& a, const Vec3f& b, const Vec3f& c, ExactCount& exact) noexcept;

}  // namespace hapticd::geometry
