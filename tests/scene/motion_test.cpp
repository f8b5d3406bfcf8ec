#include "scene/motion.h"

#include <gtest/gtest.h>

#include <random>

namespace hapticd::scene {
namespace {

using geometry::Mat3;
using geometry::Quat;
using geometry::Vec3;

Affine placement(const Mat3& linear, const Vec3& translation) {
  Affine t = Affine::Identity();
  t.linear() = linear;
  t.translation() = translation;
  return t;
}

Mat3 turn(double angle, const Vec3& axis) {
  return Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
}

TEST(Motion, FixedGivesExactlyTheMatrixAtAnyTime) {
  Mat3 m;
  m << 1.1, 0.2, -3, 0.4, 5, 0.6, 7e-3, 8, -9;
  const Affine t = placement(m, Vec3(1e6, -2, 1e-9));
  const Motion motion = Motion::fixed(t, 7);
  for (const Nanos now : {Nanos{-5}, Nanos{0}, Nanos{1}, Nanos{1} << 60}) {
    EXPECT_EQ(motion.at(now).matrix(), t.matrix());
    EXPECT_FALSE(motion.movingAfter(now));
  }
  EXPECT_EQ(motion.jumps(), 7U);
}

TEST(Motion, DefaultIsTheIdentity) {
  EXPECT_EQ(Motion().at(123).matrix(), Affine::Identity().matrix());
}

TEST(Motion, EndsAreExactAndRestOutside) {
  const Affine from = placement(turn(0.3, Vec3(1, 2, 3)), Vec3(1, 2, 3));
  const Affine to = placement(2 * turn(1.3, Vec3(-1, 2, 0)), Vec3(4, 5, 6));
  const Motion motion = Motion::between(from, to, 100, 200);
  EXPECT_EQ(motion.at(100).matrix(), from.matrix());
  EXPECT_EQ(motion.at(-1).matrix(), from.matrix());
  EXPECT_EQ(motion.at(200).matrix(), to.matrix());
  EXPECT_EQ(motion.at(1000).matrix(), to.matrix());
  EXPECT_TRUE(motion.movingAfter(199));
  EXPECT_FALSE(motion.movingAfter(200));
  EXPECT_EQ(motion.destination().matrix(), to.matrix());
  EXPECT_EQ(motion.origin().matrix(), from.matrix());
}

TEST(Motion, HalfwayIsHalfTheAngleHalfTheScaleHalfTheWay) {
  const Affine from = placement(Mat3::Identity(), Vec3::Zero());
  const Affine to = placement(3 * turn(1.0, Vec3::UnitZ()), Vec3(2, 0, 0));
  const Affine mid = Motion::between(from, to, 0, 1000).at(500);
  EXPECT_TRUE(mid.linear().isApprox(2 * turn(0.5, Vec3::UnitZ()), 1e-12));
  EXPECT_TRUE(mid.translation().isApprox(Vec3(1, 0, 0), 1e-12));
}

TEST(Motion, WhatIsOnlyCarriedKeepsItsLinearPartAndSweepsNoMoreThanTheWay) {
  const Mat3 linear = 1.7 * turn(0.3, Vec3(1, 2, 3));
  const Affine from = placement(linear, Vec3(1, 2, 3));
  const Affine to = placement(linear, Vec3(4, -5, 6));
  const Motion motion = Motion::between(from, to, 0, 1000);
  EXPECT_EQ(motion.at(300).linear(), linear);
  EXPECT_TRUE(motion.at(300).translation().isApprox(Vec3(1.9, -0.1, 3.9), 1e-15));
  const geometry::Box box{Vec3(-1, -1, -1), Vec3(1, 2, 3)};
  geometry::Box ends = Motion::fixed(from).sweep(box);
  ends.extend(Motion::fixed(to).sweep(box));
  EXPECT_EQ(motion.sweep(box).min, ends.min);
  EXPECT_EQ(motion.sweep(box).max, ends.max);
}

TEST(Motion, RotatesTheShortWay) {
  const Affine from = placement(turn(3.0, Vec3::UnitX()), Vec3::Zero());
  const Affine to = placement(turn(-3.0, Vec3::UnitX()), Vec3::Zero());
  const Affine mid = Motion::between(from, to, 0, 1000).at(500);
  EXPECT_TRUE(mid.linear().isApprox(turn(EIGEN_PI, Vec3::UnitX()), 1e-9));
}

// Any two placements of the same handedness: no step at the ends, and never singular on the way.
TEST(Motion, ScaleShearAndReflectionJoinWithoutAStepAndStayRegular) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  int reflected = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const auto any = [&] { return Mat3(Mat3::NullaryExpr([&] { return normal(random); })); };
    Mat3 a = any();
    Mat3 b = any();
    if (a.determinant() * b.determinant() < 0) b.col(0) *= -1;
    reflected += a.determinant() < 0 ? 1 : 0;
    if (std::abs(a.determinant()) < 0.05 || std::abs(b.determinant()) < 0.05) continue;
    const Motion motion =
        Motion::between(placement(a, Vec3::Zero()), placement(b, Vec3::Ones()), 0, 1'000'000'000);
    EXPECT_LT((motion.at(1).linear() - a).norm(), 1e-7 * (1 + b.norm() + a.norm()));
    EXPECT_LT((motion.at(999'999'999).linear() - b).norm(), 1e-7 * (1 + a.norm() + b.norm()));
    for (Nanos t = 0; t <= 10; ++t) {
      EXPECT_GT(motion.at(t * 100'000'000).linear().determinant() * a.determinant(), 0);
    }
  }
  EXPECT_GT(reflected, 100);
}

// Two parts of one body, turned, scaled and carried by one map.
TEST(Motion, WhatFollowsALeaderKeepsItsPlaceBesideIt) {
  const Affine map = placement(1.2 * turn(0.4, Vec3(1, 0.3, -2)), Vec3(5, -3, 7));
  const Affine a = placement(0.7 * turn(1, Vec3(1, 2, 3)), Vec3(10, 20, 30));
  const Affine b = placement(turn(2, Vec3(3, 1, 0)) * Vec3(2, 3, -4).asDiagonal(), Vec3(-40, 20, 5));
  const Motion leader = Motion::between(a, map * a, 100, 300);
  const Motion led = Motion::between(b, map * b, 100, 300).with(leader);
  const geometry::Box box{Vec3(-1, -2, -3), Vec3(4, 3, 2)};
  const geometry::Box swept = led.sweep(box);
  for (Nanos t = 100; t <= 300; t += 10) {
    EXPECT_TRUE((leader.at(t).inverse() * led.at(t)).isApprox(a.inverse() * b, 1e-12)) << t;
    for (const Vec3& p : {box.min, box.max, Vec3(-1, 3, 2), Vec3(4, -2, -3)}) {
      EXPECT_TRUE(((led.at(t) * p - swept.min).array() > -1e-9).all() &&
                  ((swept.max - led.at(t) * p).array() > -1e-9).all());
    }
  }
  EXPECT_EQ(led.at(300).matrix(), (map * b).matrix());
  const Motion alone = Motion::between(b, map * b, 100, 300);
  EXPECT_GT((alone.at(200).translation() - led.at(200).translation()).norm(), 0.1) << "it takes another way";
}

// A turn about a pivot far from the origin of the object, alone and behind a leader.
TEST(Motion, PointsLeaveTheStraightLineByAtMostTheDetour) {
  const Vec3 pivot(30, -20, 10);
  const Affine map =
      placement(1.1 * turn(0.7, Vec3(1, 0.3, -2)), pivot - turn(0.7, Vec3(1, 0.3, -2)) * pivot);
  const Affine a = placement(0.7 * turn(1, Vec3(1, 2, 3)), Vec3(10, 20, 30));
  const Affine b = placement(turn(2, Vec3(3, 1, 0)) * Vec3(2, 3, -4).asDiagonal(), Vec3(-40, 20, 5));
  const Motion leader = Motion::between(a, map * a, 0, 1000);
  const Motion alone = Motion::between(b, map * b, 0, 1000);
  const Motion led = Motion::between(b, map * b, 0, 1000).with(leader);
  const Vec3 centre(4, -3, 2);
  for (const Motion& motion : {leader, alone, led}) {
    double farthest = 0;
    for (const Vec3& side : {Vec3(1, 0, 0), Vec3(0, -1, 0), Vec3(0.6, 0, 0.8), Vec3(0, 0, 0)}) {
      const Vec3 p = centre + 2 * side;
      for (Nanos t = 0; t <= 1000; t += 50) {
        const double share = static_cast<double>(t) / 1000;
        const Vec3 straight = (1 - share) * (motion.origin() * p) + share * (motion.destination() * p);
        farthest = std::max(farthest, (motion.at(t) * p - straight).norm());
      }
    }
    EXPECT_GT(farthest, 0.1);
    EXPECT_LE(farthest, motion.detour(centre, 2));
  }
  EXPECT_EQ(Motion::between(a, placement(a.linear(), Vec3::Zero()), 0, 1000).detour(centre, 2), 0);
}

TEST(Motion, VeryUnevenScaleIsFactorisedAccurately) {
  const Mat3 m = turn(1, Vec3(1, 1, 0)) * Vec3(1e-4, 1, 1e4).asDiagonal() * turn(0.5, Vec3(0, 1, 2));
  const Motion motion = Motion::between(placement(m, Vec3::Zero()), placement(m, Vec3(1, 0, 0)), 0, 1000);
  EXPECT_LT((motion.at(500).linear() - m).norm(), 1e-10 * m.norm());
}

}  // namespace
}  // namespace hapticd::scene
