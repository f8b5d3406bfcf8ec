// Triangles that a mesh holds more than once.
#pragma once

#include <span>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// Marks every triangle whose corners lie, in the same cyclic order, exactly where those of an earlier one
/// lie: it has the same front and cannot be felt apart from it. Empty where there is none. Triangles with a
/// corner beyond the vertices are never marked. Linear time: about 0.1 s for a million triangles.
std::vector<bool> repeatedTriangles(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

}  // namespace hapticd::geometry
