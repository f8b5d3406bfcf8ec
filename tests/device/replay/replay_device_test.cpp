// A recorded hand as a device.
#include "device/replay/replay_device.h"
#include "base/clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "device/plane_scene.h"

namespace hapticd::device {
namespace {

constexpr Nanos kMs = 1'000'000;

class ReplayTest : public testing::Test {
 protected:
  void record(const std::string& rows) { std::ofstream(options.file) << rows; }

  ReplayOptions options{
      std::filesystem::path(testing::TempDir()) /
      (std::string(testing::UnitTest::GetInstance()->current_test_info()->name()) + ".csv")};
};

TEST_F(ReplayTest, IsWhereTheRecordingSaysWhateverTheForce) {
  record("t_s,x_m,y_m,z_m,qx,qy,qz,qw,buttons\n0,0,0,0,0,0,0,1,0\n0.1,0.01,0.02,0.03,0,0,1,0,1\n");
  ReplayDevice device(options);
  DeviceState state;
  EXPECT_FALSE(device.read(0, state));
  device.open();
  EXPECT_TRUE(device.profile().startsArmed);
  const Nanos start = 5000 * kMs;
  ASSERT_TRUE(device.read(start, state));
  EXPECT_TRUE(state.position_m.isZero());
  EXPECT_TRUE(device.write(Vec3(0, 0, 3)));
  EXPECT_FALSE(device.write(Vec3(0, 0, std::nan(""))));
  ASSERT_TRUE(device.read(start + 50 * kMs, state));
  EXPECT_TRUE(state.position_m.isApprox(Vec3(0.005, 0.01, 0.015)));
  EXPECT_TRUE(state.velocity_m_per_s.isApprox(Vec3(0.1, 0.2, 0.3)));
  EXPECT_TRUE(state.angularVelocity_rad_per_s.isApprox(Vec3(0, 0, M_PI / 0.1), 1e-6));
  EXPECT_EQ(state.buttons, 0U);
  ASSERT_TRUE(device.read(start + 900 * kMs, state));
  EXPECT_TRUE(state.position_m.isApprox(Vec3(0.01, 0.02, 0.03))) << "rests at the end";
  EXPECT_EQ(state.buttons, 1U);
  EXPECT_TRUE(state.velocity_m_per_s.isZero());

  device.open();
  ASSERT_TRUE(device.read(start + 1000 * kMs, state));
  EXPECT_TRUE(state.position_m.isZero()) << "open() is a new start";
}

TEST_F(ReplayTest, SaysWhatItDoesNotUseOfTheFile) {
  record("time_ns,hip_x_m,hip_y_m,hip_z_m\n20,0,0,0\n10,0,0,0\n30,0,0,0\n");
  ReplayDevice device(options);
  testing::internal::CaptureStderr();
  device.open();
  EXPECT_EQ(testing::internal::GetCapturedStderr(),
            options.file.string() + ": skips 1 row(s) whose time is not after that of a row before\n");
}

TEST_F(ReplayTest, Repeats) {
  record("t_s,x_m,y_m,z_m\n0,0,0,0\n0.1,0.1,0,0\n");
  options.repeat = true;
  ReplayDevice device(options);
  device.open();
  DeviceState state;
  device.read(0, state);
  device.read(100 * kMs, state);
  EXPECT_DOUBLE_EQ(state.position_m.x(), 0.1);
  device.read(130 * kMs, state);
  EXPECT_NEAR(state.position_m.x(), 0.03, 1e-6);
}

TEST_F(ReplayTest, AMissingFileIsNamed) {
  options.file = "/nowhere/hand.csv";
  ReplayDevice device(options);
  try {
    device.open();
    FAIL();
  } catch (const HandFileError& error) {
    EXPECT_NE(std::string(error.what()).find("/nowhere/hand.csv"), std::string::npos);
  }
}

TEST_F(ReplayTest, APlaneFeelsAsOnTheSimulatedDevice) {
  const std::vector<Vec3> places = plane_scene::places();
  const std::vector<Vec3> expected = plane_scene::referenceForces(places);
  std::string rows = "t_s,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < places.size(); ++i) {
    rows += std::to_string(1e-3 * static_cast<double>(i));
    for (const double x : places[i]) rows += "," + std::to_string(x);
    rows += "\n";
  }
  record(rows);
  ReplayDevice device(options);
  device.open();
  base::SimulatedClock clock;
  realtime::Tick servo(device, clock, plane_scene::raw());
  servo.snapshots().publish(plane_scene::snapshot());
  for (std::size_t i = 0; i < places.size(); ++i) {
    servo(static_cast<Nanos>(i) * kMs);
    EXPECT_LE((servo.last().force_N - expected[i]).norm(), 0.01 * expected[i].norm() + 1e-9) << "tick " << i;
  }
}

}  // namespace
}  // namespace hapticd::device
