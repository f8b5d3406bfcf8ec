// Indexed triangle mesh, as it arrives from a client or a file.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/types.h"

namespace hapticd::geometry {

using Triangle = std::array<std::uint32_t, 3>;

/// Vertices in the object's own unit and triangles as vertex indices, counter-clockwise seen from the front.
struct TriangleMesh {
  std::vector<Vec3f> vertices;
  std::vector<Triangle> triangles;
};

/// Bounds of all finite vertices; empty when there is none.
Box boundsOf(const TriangleMesh& mesh);

/// Makes every vertex = scale * vertex + offset.
void scaleAndMove(TriangleMesh& mesh, double scale, const Vec3& offset);

}  // namespace hapticd::geometry
