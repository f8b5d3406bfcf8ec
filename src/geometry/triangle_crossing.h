// Whether two triangles run through each other, decided exactly.
#pragma once

#include <array>

#include "geometry/orientation.h"

namespace hapticd::geometry {

using Corners3f = std::array<Vec3f, 3>;

/// True when some point lies strictly inside both triangles: they pierce each other, or overlap in one plane.
/// Touching is no crossing: a common corner or edge, a corner or an edge of one on the face of the other.
/// Exact for all finite coordinates; a triangle without area crosses nothing. Symmetric, whatever the order
/// of corners. noexcept, allocation-free; `exact` counts the slow answers it took.
bool cross(const Corners3f& a, const Corners3f& b, ExactCount& exact) noexcept;

}  // namespace hapticd::geometry
