#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

Box boundsOf(const TriangleMesh& mesh) {
  Box box;
  for (const Vec3f& v : mesh.vertices) {
    if (v.allFinite()) box.extend(Vec3(v.cast<double>()));
  }
  return box;
}

void scaleAndMove(TriangleMesh& mesh, double scale, const Vec3& offset) {
  for (Vec3f& v : mesh.vertices) v = (scale * v.cast<double>() + offset).cast<float>();
}

}  // namespace hapticd::geometry
