// Welding: vertices at equal positions become one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// No vertex.
inline constexpr std::uint32_t kNoVertex = 0xFFFFFFFF;

/// For each vertex the lowest index at exactly the same position (0 and -0 are equal); kNoVertex where a
/// coordinate is not finite. Linear time.
std::vector<std::uint32_t> firstAtSamePosition(std::span<const Vec3f> vertices);

/// Makes triangles share vertices and removes unused vertices, and triangles with a corner that does not
/// exist; keeps the order of both.
void weld(TriangleMesh& mesh);

}  // namespace hapticd::geometry
