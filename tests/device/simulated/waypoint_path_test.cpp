// Smooth paths through points.
#include "device/simulated/waypoint_path.h"
#include "base/time.h"
#include "support/milliseconds.h"

#include <gtest/gtest.h>

#include <cmath>

namespace hapticd::device {
namespace {

std::vector<Waypoint> someStroke() {
  return {{0.0, Vec3(0, 0.02, 0), Quat::Identity(), 0},
          {0.3, Vec3(0, -0.004, 0), Quat(Eigen::AngleAxisd(0.4, Vec3::UnitX())), 1},
          {0.5, Vec3(0.01, -0.004, 0), Quat::Identity(), 0},
          {0.9, Vec3(0.03, -0.002, 0.01), Quat::Identity(), 0},
          {1.2, Vec3(0, 0.02, 0), Quat::Identity(), 0}};
}

TEST(WaypointPath, PassesEveryPointAtItsTime) {
  const auto points = someStroke();
  const WaypointPath path(points);
  EXPECT_EQ(path.duration(), 1200 * kMs);
  for (const Waypoint& point : points) {
    const HandPose pose = path.at(base::toNanos(point.time_s));
    EXPECT_NEAR((pose.position_m - point.position_m).norm(), 0, 1e-15);
    EXPECT_NEAR(pose.orientation.angularDistance(point.orientation), 0, 1e-7);
    EXPECT_EQ(pose.buttons, point.buttons);
  }
}

TEST(WaypointPath, StaysBetweenThePointsAndMovesSmoothly) {
  const WaypointPath path(someStroke());
  const double h = 1e-3;
  for (Nanos t = kMs; t < path.duration() - kMs; t += kMs) {
    const HandPose before = path.at(t - kMs);
    const HandPose pose = path.at(t);
    const HandPose after = path.at(t + kMs);
    EXPECT_LE(pose.position_m.y(), 0.02);
    EXPECT_GE(pose.position_m.y(), -0.004 - 1e-15);
    const Vec3 slope = (after.position_m - before.position_m) / (2 * h);
    EXPECT_LT((slope - pose.velocity_m_per_s).norm(), 2e-3) << t;
    EXPECT_LT((after.velocity_m_per_s - pose.velocity_m_per_s).norm(), 5e-3) << t;
  }
}

TEST(WaypointPath, RestsAtBothEnds) {
  const WaypointPath path(someStroke());
  EXPECT_EQ(path.at(0).velocity_m_per_s, Vec3::Zero());
  EXPECT_EQ(path.at(-5 * kMs).position_m, Vec3(0, 0.02, 0));
  EXPECT_EQ(path.at(5000 * kMs).position_m, Vec3(0, 0.02, 0));
  EXPECT_EQ(path.at(5000 * kMs).velocity_m_per_s, Vec3::Zero());
}

TEST(WaypointPath, RepeatsWhenAskedTo) {
  const WaypointPath path(someStroke(), WaypointPath::Repeat::yes);
  EXPECT_EQ(path.at(1200 * kMs + 377 * kMs).position_m, path.at(377 * kMs).position_m);
}

TEST(WaypointPath, RefusesNonsense) {
  EXPECT_THROW(WaypointPath({}), std::invalid_argument);
  EXPECT_THROW(WaypointPath({{0, {}, Quat::Identity(), 0}, {0, {}, Quat::Identity(), 0}}),
               std::invalid_argument);
  EXPECT_THROW(WaypointPath({{0, Vec3(NAN, 0, 0), Quat::Identity(), 0}}), std::invalid_argument);
  EXPECT_THROW(WaypointPath({{0, Vec3::Zero(), Quat(0, 0, 0, 0), 0}}), std::invalid_argument);
}

}  // namespace
}  // namespace hapticd::device
