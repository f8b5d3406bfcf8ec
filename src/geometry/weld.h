// Vertices at equal positions are one vertex.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// No vertex.
inline constexpr std::uint32_t kNoVertex = 0xFFFFFFFF;

/// For each vertex the lowest one at exactly the same position (0 and -0 are the same); kNoVertex where a
/// coordinate is not finite. Linear time.
std::vector<std::uint32_t> firstAtSamePosition(std::span<const Vec3f> vertices);

/// Makes triangles share vertices and drops vertices that no triangle uses; order stays.
void weld(TriangleMesh& mesh);

}  // namespace hapticd::geometry
