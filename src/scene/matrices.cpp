#include "scene/matrices.h"

#include <cmath>
#include <limits>

#include "scene/notice.h"

namespace hapticd::scene {

double lengthOf(const Vec3& v) {
  if (v.hasNaN()) return std::numeric_limits<double>::quiet_NaN();  // maxCoeff() may pass over it
  const double largest = v.cwiseAbs().maxCoeff();
  return largest > 0 ? largest * (v / largest).norm() : largest;
}

Mat4 fromColumns(const std::array<double, 16>& m) {
  return Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::ColMajor>>(m.data());
}

Mat4 fromRows(const std::array<float, 16>& m) {
  return Eigen::Map<const Eigen::Matrix<float, 4, 4, Eigen::RowMajor>>(m.data()).cast<double>();
}

bool isInvertible(const Affine& t) {
  if (!(t.matrix().array().abs() <= kLargest).all()) return false;
  const double size = t.linear().cwiseAbs().maxCoeff();
  if (!(size >= 1 / kLargest)) return false;
  return std::abs((t.linear() / size).determinant()) > 1e-15;
}

std::string unusableNumberOf(const Mat4& m) {
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      if (!isUsable(m(row, column)))
        return textOf("row ", row + 1, ", column ", column + 1, " is ", m(row, column));
    }
  }
  return {};
}

std::optional<Affine> affineFrom(const Mat4& m, std::string& flaw) {
  flaw = unusableNumberOf(m);
  if (!m.allFinite()) return std::nullopt;
  const double w = m(3, 3);
  if (w == 0 || m.row(3).head<3>().cwiseAbs().maxCoeff() > 1e-9 * std::abs(w)) {
    if (flaw.empty()) flaw = textOf("last row ", m.row(3));
    return std::nullopt;
  }
  Affine t;
  t.matrix() = m.topRows<3>() / w;
  if (!isInvertible(t)) {
    if (flaw.empty()) flaw = textOf("determinant ", m.topLeftCorner<3, 3>().determinant());
    return std::nullopt;
  }
  return t;
}

std::optional<geometry::Quat> rotationFrom(const Vec3& axis, double angle_rad) {
  if (!isUsable(axis) || !isUsable(angle_rad)) return std::nullopt;
  if (angle_rad == 0) return geometry::Quat::Identity();
  const double length = lengthOf(axis);
  if (!(length > 0)) return std::nullopt;
  return geometry::Quat(Eigen::AngleAxisd(angle_rad, axis / length));
}

}  // namespace hapticd::scene
