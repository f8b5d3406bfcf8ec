// Coordinates of the topics, and those of the server.
#pragma once

#include <Eigen/Geometry>
#include <array>

#include "hapticd/scene.h"

namespace hapticd::apps::ros2 {

/// A frame that is turned against the server's, which has x to the right of the user, y up, and z towards the
/// user.
class Frame {
 public:
  /// The server's own axes.
  static Frame device() { return Frame(Eigen::Quaterniond::Identity()); }
  /// REP 103, as the user looks: x forward, y left, z up.
  static Frame ros() { return Frame(Eigen::Quaterniond(0.5, 0.5, -0.5, -0.5)); }

  Eigen::Vector3d fromServer(const std::array<double, 3>& v) const {
    return fromServer_ * Eigen::Vector3d(v[0], v[1], v[2]);
  }
  /// From the axes of a body to this frame.
  Eigen::Quaterniond fromServer(const std::array<double, 4>& xyzw) const {
    return fromServer_ * Eigen::Quaterniond(xyzw[3], xyzw[0], xyzw[1], xyzw[2]);
  }
  std::array<double, 3> toServer(const Eigen::Vector3d& v) const {
    const Eigen::Vector3d turned = fromServer_.conjugate() * v;
    return {turned.x(), turned.y(), turned.z()};
  }
  /// The transform of an object in the server's world of millimetres. `q` is of length 1, `p` in metres.
  Matrix4 toServer(const Eigen::Quaterniond& q, const Eigen::Vector3d& p) const {
    Eigen::Isometry3d T(fromServer_.conjugate() * q);
    T.translation() = fromServer_.conjugate() * (1000 * p);
    Matrix4 columns;
    Eigen::Map<Eigen::Matrix4d>(columns.data()) = T.matrix();
    return columns;
  }

 private:
  explicit Frame(const Eigen::Quaterniond& q) : fromServer_(q) {}

  Eigen::Quaterniond fromServer_;
};

}  // namespace hapticd::apps::ros2
