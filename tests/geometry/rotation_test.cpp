#include "geometry/rotation.h"

#include <gtest/gtest.h>

namespace hapticd::geometry {
namespace {

TEST(Rotation, IsTheOneOfEigen) {
  const Vec3 from(1, -2, 0.5);
  for (const Vec3& to : {Vec3(3, 1, 2), Vec3(1, -2, 0.5), Vec3(-1, 2, -0.4), Vec3(0, 0, 7)}) {
    EXPECT_EQ(rotationBetween(from, to).coeffs(), Quat::FromTwoVectors(from, to).coeffs()) << to.transpose();
  }
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
