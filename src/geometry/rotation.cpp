#include "geometry/rotation.h"

#include <algorithm>
#include <cmath>

namespace hapticd::geometry {

Quat rotationBetween(const Vec3& from, const Vec3& to) {
  constexpr double kOpposite = -1 + 1e-12;  // where the cross product is too short to be an axis
  const Vec3 a = from.normalized();
  const Vec3 b = to.normalized();
  const double cosine = b.dot(a);
  Quat turn;
  if (cosine < kOpposite) {
    const double w2 = (1 + std::max(cosine, -1.0)) / 2;
    turn.w() = std::sqrt(w2);
    turn.vec() = std::sqrt(1 - w2) * a.unitOrthogonal();
  } else {
    const double s = std::sqrt((1 + cosine) * 2);
    turn.w() = s / 2;
    turn.vec() = a.cross(b) * (1 / s);
  }
  return turn;
}

}  // namespace hapticd::geometry
