#include "geometry/rotation.h"

#include <gtest/gtest.h>

#include <cmath>

namespace hapticd::geometry {
namespace {

TEST(Rotation, TurnsByTheAngleBetweenAboutTheirNormal) {
  const Vec3 from(1, -2, 0.5);
  for (const Vec3& to : {Vec3(3, 1, 2), Vec3(1, -2, 0.6), Vec3(-1, 2, -0.4), Vec3(0, 0, 7)}) {
    const Vec3 normal = from.cross(to);
    const Eigen::AngleAxisd turn(std::atan2(normal.norm(), from.dot(to)), normal.normalized());
    EXPECT_TRUE(rotationBetween(from, to).isApprox(Quat(turn), 1e-12)) << to.transpose();
  }
  EXPECT_TRUE(rotationBetween(from, 3 * from).isApprox(Quat::Identity(), 1e-15));
}

TEST(Rotation, OfOppositeDirectionsIsHalfATurn) {
  for (const Vec3& from : {Vec3(1, 0, 0), Vec3(0, -3, 0), Vec3(0.1, 0.2, 0.3)}) {
    const Quat turn = rotationBetween(from, -2 * from);
    EXPECT_NEAR(turn.norm(), 1, 1e-12);
    // The angle comes from a cosine, which is accurate to the square root of the rounding error.
    EXPECT_LT((turn * from + from).norm(), 1e-7) << from.transpose();
  }
}

}  // namespace
}  // namespace hapticd::geometry
