// Exact test whether two triangles intersect in their interiors.
#pragma once

#include <array>

#include "geometry/orientation.h"

namespace hapticd::geometry {

using Corners3f = std::array<Vec3f, 3>;

/// True when a point lies strictly inside both triangles: they pierce each other, or overlap in one plane.
/// Contact is no crossing: a common corner or edge, a corner or an edge of one on the face of the other.
/// Exact for all finite coordinates; a triangle without area crosses nothing. Symmetric in the triangles and
/// in the order of corners. noexcept, no allocation; adds the number of exact predicates to `exact`.
bool cross(const Corners3f& a, const Corners3f& b, ExactCount& exact) noexcept;

}  // namespace hapticd::geometry
