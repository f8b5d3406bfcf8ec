// What any mesh from outside must be.
#pragma once

#include "fuzz/targets.h"
#include "geometry/triangle_mesh.h"

namespace hapticd::fuzz {

inline void requireSound(const geometry::TriangleMesh& mesh) {
  for (const geometry::Triangle& t : mesh.triangles) {
    for (const std::uint32_t corner : t) require(corner < mesh.vertices.size(), "corners exist");
  }
  for (const geometry::Vec3f& v : mesh.vertices) require(v.allFinite(), "coordinates are finite");
}

}  // namespace hapticd::fuzz
