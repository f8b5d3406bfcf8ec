// Paths and targets change while the hand is being read.
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "device/simulated/simulated_device.h"
#include "device/simulated/waypoint_path.h"

namespace hapticd::device {
namespace {

TEST(SimulatedDeviceThreads, PathsAndTargetsMayChangeAtAnyTime) {
#ifdef HAPTICD_SANITIZED
  constexpr int kChanges = 300;
#else
  constexpr int kChanges = 3000;
#endif
  SimulatedDevice device;
  std::atomic<int> running{2};
  std::thread paths([&] {
    for (int i = 0; i < kChanges; ++i) {
      const Vec3 to(0.001 * (i % 30), 0, 0);
      device.setPath(std::make_shared<WaypointPath>(
          std::vector<Waypoint>{{0, Vec3::Zero(), Quat::Identity(), 0}, {0.1, to, Quat::Identity(), 0}}));
      std::this_thread::yield();
    }
    device.setPath(nullptr);
    --running;
  });
  std::thread targets([&] {
    for (int i = 0; i < kChanges; ++i) {
      HandPose pose;
      pose.position_m = Vec3(0.001 * (i % 30), 0.01, 0);
      device.setTarget(pose);
      if (i % 5 == 0) device.releaseTarget();
      std::this_thread::yield();
    }
    device.releaseTarget();
    --running;
  });
  DeviceState state;
  Nanos now = 0;
  while (running > 0) {
    device.read(now += 1'000'000, state);
    ASSERT_TRUE(state.position_m.allFinite());
    ASSERT_LT(state.position_m.norm(), 0.1);
  }
  paths.join();
  targets.join();
  for (int i = 0; i < 3000; ++i) device.read(now += 1'000'000, state);
  EXPECT_NEAR(state.position_m.norm(), 0, 1e-6) << "without path and target the hand rests at the centre";
}

}  // namespace
}  // namespace hapticd::device
