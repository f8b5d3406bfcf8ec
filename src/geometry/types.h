// Vectors, transforms and boxes: aliases over Eigen.
//
// SI units: metres, newtons, radians, seconds. A transform T_a_b maps frame b to frame a.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <limits>

namespace hapticd::geometry {

using Vec3 = Eigen::Vector3d;
using Vec3f = Eigen::Vector3f;
using Mat3 = Eigen::Matrix3d;
using Mat4 = Eigen::Matrix4d;
using Quat = Eigen::Quaterniond;
/// Affine map: rotation, scale, shear and translation (a 3x4 matrix, 16 byte aligned).
using Affine = Eigen::Transform<double, 3, Eigen::AffineCompact>;

/// By how much a similarity scales; of another map, the mean.
inline double scaleOf(const Mat3& linear) noexcept {
  return std::cbrt(std::abs(linear.determinant()));
}

/// Axis-aligned box; empty until extended.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());

  bool empty() const noexcept { return !(min.array() <= max.array()).all(); }
  void extend(const Vec3& p) noexcept {
    min = min.cwiseMin(p);
    max = max.cwiseMax(p);
  }
  void extend(const Box& b) noexcept {
    min = min.cwiseMin(b.min);
    max = max.cwiseMax(b.max);
  }
  Vec3 centre() const noexcept { return 0.5 * (min + max); }
  Vec3 extents() const noexcept { return max - min; }
};

}  // namespace hapticd::geometry
