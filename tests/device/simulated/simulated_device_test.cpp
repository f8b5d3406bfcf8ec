// The hand of arithmetic against walls of arithmetic.
//
//      intended point  o~~300 N/m, 5 N·s/m~~[0.1 kg]     | wall: F = K depth for y < 0
#include "device/simulated/simulated_device.h"
#include "base/time.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "device/simulated/hand_file.h"
#include "device/simulated/waypoint_path.h"
#include "support/milliseconds.h"

namespace hapticd::device {
namespace {

constexpr double kHand_N_per_m = 300;

std::shared_ptr<const HandPath> resting(const Vec3& at) {
  return std::make_shared<WaypointPath>(std::vector<Waypoint>{{0, at, Quat::Identity(), 0}});
}

std::shared_ptr<const HandPath> pressing(double depth_m) {
  return std::make_shared<WaypointPath>(std::vector<Waypoint>{
      {0, Vec3(0, 0.01, 0), Quat::Identity(), 0}, {0.3, Vec3(0, -depth_m, 0), Quat::Identity(), 0}});
}

// A wall at y = 0 that is felt from above, rendered once in each period.
struct Wall {
  double stiffness_N_per_m;
  Vec3 force(const DeviceState& state) const {
    return {0, state.position_m.y() < 0 ? -stiffness_N_per_m * state.position_m.y() : 0, 0};
  }
};

TEST(SimulatedDevice, RestsAtTheCentreWithoutAPath) {
  SimulatedDevice device;
  DeviceState state;
  for (Nanos t = 0; t < 100 * kMs; t += kMs) ASSERT_TRUE(device.read(t, state));
  EXPECT_EQ(state.position_m, Vec3::Zero());
  EXPECT_EQ(state.velocity_m_per_s, Vec3::Zero());
  EXPECT_EQ(state.hold, static_cast<std::uint32_t>(kHoldNone));
  EXPECT_EQ(state.time, 99 * kMs);
  EXPECT_TRUE(device.profile().startsArmed);
}

TEST(SimulatedDevice, NoPoseAndNoForceLeavesItWithoutAPosition) {
  SimulatedDevice device;
  DeviceState state;
  Nanos t = 0;
  const auto run = [&] {
    for (int i = 0; i < 1000; ++i) device.read(t += kMs, state);
    return state.position_m.allFinite() && state.velocity_m_per_s.allFinite() &&
           state.orientation.coeffs().allFinite();
  };
  HandPose pose;
  pose.position_m = Vec3(0.01, NAN, 0);
  device.setTarget(pose);
  EXPECT_TRUE(run());
  EXPECT_EQ(state.position_m, Vec3::Zero()) << "as before";
  pose.position_m = Vec3(0.01, 0, 0);
  pose.orientation.coeffs().setConstant(NAN);
  device.setTarget(pose);
  EXPECT_TRUE(run());
  EXPECT_FALSE(device.write(Vec3(0, INFINITY, 0)));
  EXPECT_TRUE(run());
  pose.orientation.setIdentity();
  device.setTarget(pose);
  EXPECT_TRUE(run());
  EXPECT_NEAR(state.position_m.x(), 0.01, 1e-6);
}

TEST(SimulatedDevice, AForceCanBeEndedFromAnotherThread) {
  SimulatedDevice device;
  DeviceState state;
  Nanos t = 0;
  const auto restsAt = [&] {
    for (int i = 0; i < 3000; ++i) device.read(t += kMs, state);
    return state.position_m.y();
  };
  device.write(Vec3(0, 3, 0));
  EXPECT_NEAR(restsAt(), 3 / kHand_N_per_m, 1e-6);
  EXPECT_TRUE(device.zeroFromOtherThread());
  EXPECT_NEAR(restsAt(), 0, 1e-6);
  device.write(Vec3(0, 3, 0));
  EXPECT_NEAR(restsAt(), 3 / kHand_N_per_m, 1e-6);
}

TEST(SimulatedDevice, SettlesAtItsPath) {
  SimulatedDevice device;
  device.setPath(pressing(0.02));
  DeviceState state;
  double fastest = 0;
  for (Nanos t = 0; t < 2000 * kMs; t += kMs) {
    device.read(t, state);
    fastest = std::max(fastest, state.velocity_m_per_s.norm());
  }
  EXPECT_NEAR(state.position_m.y(), -0.02, 1e-9);
  EXPECT_LT(state.velocity_m_per_s.norm(), 1e-9);
  EXPECT_GT(fastest, 0.1);
}

TEST(SimulatedDevice, FollowsASteadyMotionWithoutLag) {
  SimulatedDevice device;
  device.setPath(HandFile::parse("0,0,0,0\n2,0.1,0,0\n", "ramp"));
  DeviceState state;
  for (Nanos t = 0; t <= 1000 * kMs; t += kMs) device.read(t, state);
  EXPECT_NEAR(state.position_m.x(), 0.05, 1e-9);
  EXPECT_NEAR(state.velocity_m_per_s.x(), 0.05, 1e-9);
}

TEST(SimulatedDevice, AWallAndTheHandShareTheWayLikeSpringsInSeries) {
  for (const double k : {100.0, 1000.0, 5000.0}) {
    SimulatedDevice device;
    device.setPath(pressing(0.01));
    const Wall wall{k};
    DeviceState state;
    Vec3 force = Vec3::Zero();
    for (Nanos t = 0; t < 3000 * kMs; t += kMs) {
      device.read(t, state);
      force = wall.force(state);
      device.write(force);
    }
    EXPECT_NEAR(-state.position_m.y(), 0.01 * kHand_N_per_m / (kHand_N_per_m + k), 1e-8) << k;
    EXPECT_NEAR(force.y(), 0.01 * kHand_N_per_m * k / (kHand_N_per_m + k), 1e-5) << k;
  }
}

// T16: contact settles and never gives energy, for stiffness up to K T/2 < b, at every rate of the loop.
// Close to the bound it takes longer, because b - K T/2 is all the damping that is left.
TEST(SimulatedDevice, SettlesAgainstEveryPassiveWall) {
  for (const double rate : {250.0, 500.0, 1000.0, 2000.0, 4000.0}) {
    for (const double share : {0.1, 0.5, 0.8, 0.98}) {
      const double period = 1 / rate;
      const Wall wall{share * 2 * 5 / period};
      SimulatedDevice device;
      device.setPath(pressing(0.01));
      DeviceState state;
      Vec3 force = Vec3::Zero();
      Vec3 before = Vec3(0, 0.01, 0);
      double work = 0;  // of wall and damper on the hand
      double most = -1;
      double low = 1;
      double high = -1;
      const Nanos step = base::toNanos(period);
      for (Nanos t = 0; t < 2300 * kMs; t += step) {
        device.read(t, state);
        work += force.dot(state.position_m - before);
        const double stored = 0.5 * wall.stiffness_N_per_m * std::pow(std::min(state.position_m.y(), 0.0), 2);
        work -= 5 * state.velocity_m_per_s.squaredNorm() * period;
        most = std::max(most, work + stored);
        before = state.position_m;
        force = wall.force(state);
        device.write(force);
        if (t > 1300 * kMs) {
          low = std::min(low, state.position_m.y());
          high = std::max(high, state.position_m.y());
        }
      }
      EXPECT_LT(high - low, share < 0.9 ? 10e-6 : 200e-6)
          << rate << " Hz, " << wall.stiffness_N_per_m << " N/m";
      EXPECT_LE(most, 1e-9) << rate << " Hz, " << wall.stiffness_N_per_m << " N/m";
    }
  }
}

// The proof that the test above can fail: far beyond the bound the wall shakes.
TEST(SimulatedDevice, ShakesAgainstAnActiveWall) {
  SimulatedDevice device;
  device.setPath(pressing(0.01));
  const Wall wall{8 * 2 * 5 / 0.001};
  DeviceState state;
  double low = 1;
  double high = -1;
  for (Nanos t = 0; t < 2300 * kMs; t += kMs) {
    device.read(t, state);
    device.write(wall.force(state));
    if (t > 1300 * kMs) {
      low = std::min(low, state.position_m.y());
      high = std::max(high, state.position_m.y());
    }
  }
  EXPECT_GT(high - low, 100e-6);
}

TEST(SimulatedDevice, IsTheSameToTheLastBit) {
  const auto run = [] {
    SimulatedDevice device;
    device.setPath(pressing(0.01));
    const Wall wall{900};
    std::vector<double> bytes;
    DeviceState state;
    for (Nanos t = 0; t < 1000 * kMs; t += kMs + (t / kMs % 7) * 31'000) {
      device.read(t, state);
      device.write(wall.force(state));
      bytes.insert(bytes.end(), {state.position_m.y(), state.velocity_m_per_s.y(), state.orientation.w()});
    }
    return bytes;
  };
  const auto first = run();
  const auto second = run();
  ASSERT_EQ(first.size(), second.size());
  EXPECT_EQ(std::memcmp(first.data(), second.data(), first.size() * sizeof(double)), 0);
}

TEST(SimulatedDevice, StartsAnewWhenOpenedAgain) {
  SimulatedDevice device;
  device.setPath(pressing(0.01));
  DeviceState state;
  for (Nanos t = 0; t < 300 * kMs; t += kMs) device.read(t, state);
  device.write(Vec3(0, 3, 0));
  device.open();
  device.read(7000 * kMs, state);
  EXPECT_EQ(state.position_m, Vec3(0, 0.01, 0));
}

TEST(SimulatedDevice, OpenLoopIsThePathItself) {
  SimulatedOptions options;
  options.openLoop = true;
  SimulatedDevice device(options);
  const auto hand = HandFile::parse("0,0,0,0,0,0,0,1,0\n0.1,0.5,0,0,0,0,1,0,1\n0.2,0,0,0,0,0,1,0,1\n", "h");
  device.setPath(hand);
  DeviceState state;
  for (Nanos t = 0; t <= 250 * kMs; t += kMs) {
    device.read(5'000 * kMs + t, state);
    device.write(Vec3(100, 100, 100));
    ASSERT_EQ(state.position_m, hand->at(t).position_m) << t;
    ASSERT_EQ(state.buttons, hand->at(t).buttons);
  }
}

TEST(SimulatedDevice, ReportsTheTurningOfTheStylus) {
  SimulatedDevice device;
  device.setPath(HandFile::parse("0,0,0,0,0,0,0,1\n1,0,0,0,0,0,0.479425538604,0.87758256189\n", "h"));
  DeviceState state;
  for (Nanos t = 0; t <= 500 * kMs; t += kMs) device.read(t, state);
  EXPECT_NEAR((state.angularVelocity_rad_per_s - Vec3(0, 0, 1)).norm(), 0, 1e-6);  // 1 rad in 1 s about z
}

TEST(SimulatedDevice, ReachesForATargetAtTheSpeedOfAHandAndGoesBack) {
  SimulatedDevice device;
  const Vec3 home(0, 0.02, 0);
  device.setPath(resting(home));
  DeviceState state;
  Nanos t = 0;
  double fastest = 0;
  const auto runFor = [&](Nanos duration) {
    for (const Nanos end = t + duration; t < end; t += kMs) {
      device.read(t, state);
      fastest = std::max(fastest, state.velocity_m_per_s.norm());
    }
  };
  runFor(10 * kMs);
  EXPECT_EQ(state.position_m, home);
  HandPose target;
  target.position_m = Vec3(0.08, -0.06, 0.03);
  target.buttons = 1;
  device.setTarget(target);
  runFor(1500 * kMs);
  EXPECT_NEAR((state.position_m - target.position_m).norm(), 0, 1e-6);
  EXPECT_EQ(state.buttons, 1U);
  device.releaseTarget();
  runFor(1500 * kMs);
  EXPECT_NEAR((state.position_m - home).norm(), 0, 1e-6);
  EXPECT_EQ(state.buttons, 0U);
  EXPECT_LT(fastest, 0.9);
}

TEST(SimulatedDevice, ANewPathIsMetAtItsStart) {
  SimulatedDevice device;
  device.setPath(resting(Vec3(0.05, 0, 0)));
  DeviceState state;
  Nanos t = 0;
  for (; t < 100 * kMs; t += kMs) device.read(t, state);
  device.setPath(HandFile::parse("0,-0.05,0,0\n1,-0.05,0.05,0\n", "h"));
  for (; t < 300 * kMs; t += kMs) device.read(t, state);  // 0.1 m takes 200 ms
  EXPECT_NEAR(state.position_m.y(), 0, 1e-9) << "the path began before the hand was there";
  for (; t < 2500 * kMs; t += kMs) device.read(t, state);
  EXPECT_NEAR((state.position_m - Vec3(-0.05, 0.05, 0)).norm(), 0, 1e-6);
}

TEST(SimulatedDevice, APauseDoesNotThrowTheHand) {
  SimulatedDevice device;
  device.setPath(resting(Vec3::Zero()));
  DeviceState state;
  device.read(0, state);
  device.write(Vec3(0, 3, 0));
  device.read(3'600'000 * kMs, state);
  EXPECT_LT(state.position_m.norm(), 0.02);
  device.read(3'600'000 * kMs - kMs, state);  // a clock that goes back
  EXPECT_TRUE(state.position_m.allFinite());
}

}  // namespace
}  // namespace hapticd::device
