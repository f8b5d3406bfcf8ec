#include "fit_mesh.h"

#include <algorithm>
#include <stdexcept>

namespace hapticd::apps {

void fitIntoWorkspace(geometry::TriangleMesh& mesh, double size_mm) {
  const geometry::Vec3 kTouch_mm(160, 120, 70);
  constexpr double kFill = 0.8;
  constexpr double kLargestDefault_mm = 100;
  const geometry::Box bounds = geometry::boundsOf(mesh);
  const geometry::Vec3 extents = bounds.extents().cwiseMax(1e-12);
  if (bounds.empty() || bounds.extents().maxCoeff() <= 0) {
    throw std::runtime_error("the mesh has no extent, so there is nothing to touch");
  }
  const double fitting = std::min((kFill * kTouch_mm.array() / extents.array()).minCoeff(),
                                  kLargestDefault_mm / extents.maxCoeff());
  const double scale = size_mm > 0 ? size_mm / extents.maxCoeff() : fitting;
  geometry::scaleAndMove(mesh, scale, -scale * bounds.centre());
}

}  // namespace hapticd::apps
