// Indexed triangle mesh, as a client or a file delivers it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/types.h"

namespace hapticd::geometry {

using Triangle = std::array<std::uint32_t, 3>;

/// Vertices in the unit of the object; triangles as vertex indices, counter-clockwise seen from the front.
struct TriangleMesh {
  std::vector<Vec3f> vertices;
  std::vector<Triangle> triangles;
};

/// Bounds of all finite vertices; empty without any.
Box boundsOf(const TriangleMesh& mesh);

/// Replaces every vertex by scale * vertex + offset.
void scaleAndMove(TriangleMesh& mesh, double scale, const Vec3& offset);

}  // namespace hapticd::geometry
