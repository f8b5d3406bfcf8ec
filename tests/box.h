// A box for scenes.
#pragma once

#include <utility>
#include <vector>

#include "geometry/types.h"

namespace hapticd::test {

using geometry::Vec3f;

/// Vertices of a box, three for each of its twelve triangles, counter-clockwise from outside.
inline std::vector<Vec3f> boxTriples(const Vec3f& half, const Vec3f& centre = Vec3f::Zero()) {
  std::vector<Vec3f> corners;
  for (int axis = 0; axis < 3; ++axis) {
    for (const int side : {-1, 1}) {
      for (const auto& [u, v] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, -1}, {1, 1}, {-1, 1}}) {
        Vec3f corner;
        corner[axis] = static_cast<float>(side);
        corner[(axis + 1) % 3] = static_cast<float>(side * u);
        corner[(axis + 2) % 3] = static_cast<float>(v);
        corners.emplace_back(centre + half.cwiseProduct(corner));
      }
    }
  }
  return corners;
}

}  // namespace hapticd::test
