// omega and its relatives on a mock of libdrd that aborts where a caller would do harm.
#include "device/force_dimension/force_dimension_device.h"
#include "base/clock.h"

#include <dlfcn.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>

#include "device/plane_scene.h"
#include "mocks/dhd/mock_dhd_control.h"

namespace hapticd::device {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class DhdTest : public testing::Test {
 protected:
  void SetUp() override { use(MOCK_DRD); }
  void use(const char* file) {
    setenv("HAPTICD_DHD_LIB", file, 1);
    void* library = dlopen(file, RTLD_NOW);
    ASSERT_NE(library, nullptr) << dlerror();
    mock = reinterpret_cast<const MockDhd* (*)()>(dlsym(library, "mockDhd"))();
    mock->reset();
  }

  // Ours to the vendor's frame.
  void hand(const Vec3& position_m, const Vec3& velocity_m_per_s = Vec3::Zero()) const {
    const Vec3 p(position_m.z(), position_m.x(), position_m.y());
    const Vec3 v(velocity_m_per_s.z(), velocity_m_per_s.x(), velocity_m_per_s.y());
    mock->hand(p.data(), v.data());
  }
  Vec3 force() const {
    double f[3];
    mock->force(f);
    return {f[1], f[2], f[0]};
  }
  DeviceState tick(const Vec3& wanted_N) {
    now += 1'000'000;
    DeviceState state;
    gotState = device.read(now, state);
    took = device.write(wanted_N);
    return state;
  }

  const MockDhd* mock = nullptr;
  ForceDimensionDevice device;
  Nanos now = 0;
  bool gotState = false;
  bool took = false;
};

std::string refusal(Device& device) {
  try {
    device.open();
    return "opened";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

TEST_F(DhdTest, SaysWhatIsMissing) {
  mock->devices(0, "");
  EXPECT_THAT(refusal(device), AllOf(HasSubstr("0 found"), HasSubstr("1451")));
  setenv("HAPTICD_DHD_LIB", "/nowhere/libdrd.so", 1);
  EXPECT_THAT(refusal(device), HasSubstr("/nowhere/libdrd.so"));
}

TEST_F(DhdTest, OpensWithEverythingSaidExplicitlyAndTheAmplifiersOff) {
  device.open();
  EXPECT_THAT(device.description(), AllOf(HasSubstr("omega.3"), HasSubstr("4711")));
  EXPECT_EQ(mock->gravityCompensation(), 1);
  EXPECT_EQ(mock->timeGuard(), 100);
  EXPECT_EQ(mock->maxForce(), 12);
  EXPECT_EQ(mock->amplifiersOn(), 0);
  EXPECT_FALSE(device.profile().startsArmed);
  EXPECT_FALSE(device.traits().selfPaced);
  tick(Vec3::Zero());
  EXPECT_EQ(mock->amplifiersOn(), 0) << "nobody asked for a force";
  tick(Vec3(1, 0, 0));
  EXPECT_EQ(mock->amplifiersOn(), 1);
  EXPECT_EQ(mock->watchdog(), 160) << "20 ms in steps of 125 µs";
  device.close();
  device.close();
  EXPECT_EQ(mock->isOpen(), 0);
  EXPECT_EQ(mock->amplifiersOn(), 0);
}

TEST_F(DhdTest, FramesAreConverted) {
  device.open();
  const double position[3] = {0.03, 0.01, 0.02};  // 3 cm to the user, 1 cm right, 2 cm up
  const double velocity[3] = {0.3, 0.1, 0.2};
  mock->hand(position, velocity);
  // A quarter turn about the vendor's z, which is up: it takes "to the user" to "right".
  const double turn[9] = {0, -1, 0, 1, 0, 0, 0, 0, 1};
  mock->turn(turn);
  mock->buttons(1);
  const DeviceState state = tick(Vec3(1, 2, 3));
  ASSERT_TRUE(gotState);
  EXPECT_TRUE(state.position_m.isApprox(Vec3(0.01, 0.02, 0.03)));
  EXPECT_TRUE(state.velocity_m_per_s.isApprox(Vec3(0.1, 0.2, 0.3)));
  EXPECT_TRUE((state.orientation * Vec3::UnitZ()).isApprox(Vec3::UnitX()));
  EXPECT_TRUE((state.orientation * Vec3::UnitY()).isApprox(Vec3::UnitY()));
  EXPECT_EQ(state.buttons, 1U);
  double f[3];
  mock->force(f);
  EXPECT_EQ(Vec3(f[0], f[1], f[2]), Vec3(3, 1, 2));
}

TEST_F(DhdTest, TheGripperIsAButtonWithHysteresis) {
  mock->devices(1, "sigma.7");
  mock->gripper(1, 0.3);
  device.open();
  EXPECT_EQ(device.profile().nominalStiffness_N_per_m, 4000);
  const auto closedAt = [&](double angle) {
    mock->gripper(1, angle);
    return (tick(Vec3::Zero()).buttons & 2U) != 0;
  };
  EXPECT_FALSE(closedAt(0.08));
  EXPECT_TRUE(closedAt(0.04));
  EXPECT_TRUE(closedAt(0.08));
  EXPECT_FALSE(closedAt(0.12));
}

TEST_F(DhdTest, TheOpeningOfTheGripperIsInTheState) {
  device.open();
  EXPECT_FALSE(device.profile().hasGripper);
  EXPECT_FALSE(tick(Vec3::Zero()).gripper_rad) << "an omega.3 has none";
  device.close();

  mock->devices(1, "omega.7");
  mock->gripper(1, 0.25);
  device.open();
  EXPECT_TRUE(device.profile().hasGripper);
  EXPECT_EQ(device.profile().inputDof, 7);
  EXPECT_EQ(device.profile().outputDof, 4);
  EXPECT_EQ(tick(Vec3::Zero()).gripper_rad, 0.25);
  mock->gripper(1, -0.2);  // the other hand's
  EXPECT_EQ(tick(Vec3::Zero()).gripper_rad, 0.2);
  mock->gripperFails(1);
  EXPECT_EQ(tick(Vec3::Zero()).gripper_rad, 0.2) << "without an answer it stays";
  EXPECT_TRUE(gotState);
  mock->gripperFails(0);
  mock->gripper(1, std::nan(""));
  EXPECT_EQ(tick(Vec3::Zero()).gripper_rad, 0.2);
}

TEST_F(DhdTest, AxesAreCountedByTheDigitOfTheName) {
  const auto axesOf = [&](const char* name) {
    mock->devices(1, name);
    device.open();
    const auto axes = std::pair(device.profile().inputDof, device.profile().outputDof);
    device.close();
    return axes;
  };
  EXPECT_EQ(axesOf("omega.6"), std::pair(6, 3));
  EXPECT_EQ(axesOf("delta.3"), std::pair(3, 3));
  EXPECT_EQ(axesOf("sigma.7"), std::pair(7, 7));
  EXPECT_EQ(axesOf("lambda.6"), std::pair(6, 3));
  EXPECT_EQ(axesOf("lambda.7"), std::pair(7, 7));
  EXPECT_EQ(axesOf("a prototype"), std::pair(3, 3));
}

// Nothing renders a torque or a force of the gripper: what another program left there goes with the first
// write.
TEST_F(DhdTest, TorqueAndTheForceOfTheGripperAreZero) {
  mock->devices(1, "sigma.7");
  mock->gripper(1, 0.3);
  device.open();
  double torque_Nm[3];
  double grip_N = 0;
  mock->torque(torque_Nm, &grip_N);
  ASSERT_NE(torque_Nm[0], 0);
  tick(Vec3(0, 1, 0));
  mock->torque(torque_Nm, &grip_N);
  EXPECT_EQ(Vec3(torque_Nm[0], torque_Nm[1], torque_Nm[2]), Vec3(0, 0, 0));
  EXPECT_EQ(grip_N, 0);
  EXPECT_TRUE(force().isApprox(Vec3(0, 1, 0)));
}

TEST_F(DhdTest, ForceIsClampedAndNotANumberRefused) {
  device.open();
  tick(Vec3(0, 40, 0));
  EXPECT_TRUE(force().isApprox(Vec3(0, 12, 0)));
  tick(Vec3(0, std::nan(""), 0));
  EXPECT_FALSE(took);
}

TEST_F(DhdTest, TheArmIsNotMovedWithoutConsent) {
  mock->calibrated(0);
  device.open();
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldNotCalibrated);
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(mock->calibrations(), 0);
  EXPECT_THAT(device.faultText(), HasSubstr("moves the arm"));
  device.calibrate();
  EXPECT_EQ(mock->calibrations(), 1);
  EXPECT_EQ(mock->amplifiersOn(), 0) << "off until a force is asked for";
  EXPECT_EQ(tick(Vec3::Zero()).hold, kHoldNone);
  tick(Vec3(0, 1, 0));
  EXPECT_TRUE(force().isApprox(Vec3(0, 1, 0)));
  device.calibrate();
  EXPECT_EQ(mock->calibrations(), 1) << "an arm that is calibrated does not move";
}

TEST_F(DhdTest, TheLoopGoesOnDuringACalibrationAndKeepsOutOfIt) {
  mock->calibrated(0);
  mock->calibrationTime(0.05);
  device.open();
  std::atomic<bool> done{false};
  std::thread person([&] {
    device.calibrate();
    done = true;
  });
  int held = 0;
  while (!done) {
    held += (tick(Vec3::Zero()).hold & kHoldNotCalibrated) != 0 ? 1 : 0;
    std::this_thread::sleep_for(std::chrono::microseconds(100));  // a servo leaves room between its ticks
  }
  person.join();
  EXPECT_GT(held, 0);
  now += 10'000'000;
  EXPECT_EQ(tick(Vec3::Zero()).hold, kHoldNone);
}

std::string calibration(Device& device, const std::function<bool()>& stopped) {
  try {
    device.calibrate(stopped);
    return "calibrated";
  } catch (const std::runtime_error& error) {
    return error.what();
  }
}

TEST_F(DhdTest, AStopEndsACalibrationAndLeavesTheMotorsOff) {
  mock->calibrated(0);
  mock->calibrationTime(600);
  device.open();
  tick(Vec3::Zero());
  std::atomic<bool> stopped{false};
  std::string words;
  std::thread person([&] { words = calibration(device, [&] { return stopped.load(); }); });
  while (mock->calibrations() == 0) std::this_thread::yield();
  EXPECT_EQ(tick(Vec3::Zero()).hold, kHoldNotCalibrated);
  EXPECT_FALSE(device.zeroSent()) << "the calibration drives the motors";
  stopped = true;
  person.join();
  EXPECT_THAT(words, HasSubstr("stopped"));
  EXPECT_EQ(mock->regulating(), 0);
  EXPECT_EQ(mock->amplifiersOn(), 0);
  EXPECT_TRUE(device.zeroSent());
  now += 10'000'000;
  EXPECT_EQ(tick(Vec3::Zero()).hold, kHoldNotCalibrated);
  mock->calibrationTime(0);
  device.calibrate();
  now += 10'000'000;
  EXPECT_EQ(tick(Vec3::Zero()).hold, kHoldNone) << "when a person consents again";
}

TEST_F(DhdTest, AStopBeforeACalibrationPreventsIt) {
  mock->calibrated(0);
  device.open();
  EXPECT_THAT(calibration(device, [] { return true; }), HasSubstr("stopped"));
  EXPECT_EQ(mock->calibrations(), 0);
}

TEST_F(DhdTest, ACalibrationThatFailsLeavesTheMotorsOff) {
  mock->calibrated(0);
  mock->calibrationTime(-1);
  device.open();
  EXPECT_THAT(calibration(device, [] { return false; }), AllOf(HasSubstr("failed"), HasSubstr("mock error")));
  EXPECT_EQ(mock->regulating(), 0);
  EXPECT_EQ(mock->amplifiersOn(), 0);
  EXPECT_EQ(tick(Vec3::Zero()).hold, kHoldNotCalibrated);
}

TEST_F(DhdTest, WithoutDrdThereIsNoCalibration) {
  use(MOCK_DHD);
  mock->calibrated(0);
  device.open();
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldNotCalibrated);
  EXPECT_THROW(device.calibrate(), std::runtime_error);
  mock->calibrated(1);  // by the vendor's tool
  now += 10'000'000;
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldNone);
  EXPECT_TRUE(force().isApprox(Vec3(0, 1, 0)));
  device.close();
}

TEST_F(DhdTest, OneLostFrameIsAPauseAndThreeAreAFault) {
  device.open();
  tick(Vec3(0, 1, 0));
  mock->failReads(1);
  tick(Vec3(0, 1, 0));
  EXPECT_FALSE(gotState);
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldNone);
  EXPECT_TRUE(force().isApprox(Vec3(0, 1, 0)));

  mock->failReads(-1);
  tick(Vec3(0, 1, 0));
  EXPECT_TRUE(force().isZero()) << "within one tick";
  tick(Vec3(0, 1, 0));
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldFault);
  EXPECT_THAT(device.faultText(), HasSubstr("cable"));
  mock->failReads(0);
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldNone);
}

TEST_F(DhdTest, AnErrorOfTheDeviceIsSeenWithin10Ms) {
  device.open();
  tick(Vec3(0, 1, 0));
  mock->status(9, 1);
  int ticks = 0;
  while (tick(Vec3(0, 1, 0)).hold == kHoldNone && ticks < 100) ++ticks;
  EXPECT_LE(ticks, 10);
  EXPECT_TRUE(force().isZero());
}

TEST_F(DhdTest, TheDevicesWatchdogCutsTheForceOfALoopThatStopped) {
  device.open();
  tick(Vec3(0, 1, 0));
  mock->elapse(0.019);
  EXPECT_TRUE(force().isApprox(Vec3(0, 1, 0)));
  mock->elapse(0.002);
  EXPECT_TRUE(force().isZero());
  now += 10'000'000;
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldDeadMan);
  EXPECT_THAT(device.faultText(), HasSubstr("force button"));
  EXPECT_TRUE(force().isZero());
  device.calibrate();
  now += 10'000'000;
  EXPECT_EQ(tick(Vec3(0, 1, 0)).hold, kHoldNone);
  EXPECT_TRUE(force().isApprox(Vec3(0, 1, 0)));
}

TEST_F(DhdTest, APlaneFeelsAsOnTheSimulatedDevice) {
  const std::vector<Vec3> places = plane_scene::places();
  const std::vector<Vec3> expected = plane_scene::referenceForces(places);
  device.open();
  base::SimulatedClock clock;
  realtime::Tick servo(device, clock, plane_scene::raw());
  servo.snapshots().publish(plane_scene::snapshot());
  double most = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    hand(places[i]);
    servo(static_cast<Nanos>(i) * plane_scene::kTick);
    EXPECT_LE((force() - expected[i]).norm(), 0.01 * expected[i].norm() + 1e-9) << "tick " << i;
    most = std::max(most, force().norm());
  }
  EXPECT_NEAR(most, 1.5, 0.05);
  servo.finish();
  EXPECT_TRUE(force().isZero());
}

class TwoArmsTest : public DhdTest {
 protected:
  void SetUp() override {
    DhdTest::SetUp();
    mock->devices(2, "omega.3");
    left.open();
    right.open();
  }
  void push(ForceDimensionDevice& arm, double up_N) {
    now += 1'000'000;
    DeviceState state;
    arm.read(now, state);
    arm.write(Vec3(0, up_N, 0));
  }
  double force(int arm) const {
    double f[3];
    mock->forceOf(arm, f);
    return f[2];
  }

  ForceDimensionDevice left{{.index = 0}};
  ForceDimensionDevice right{{.index = 1}};
};

TEST_F(TwoArmsTest, EachHasItsOwn) {
  push(left, 1);
  push(right, 2);
  EXPECT_EQ(force(0), 1);
  EXPECT_EQ(force(1), 2);
  EXPECT_THAT(left.description(), HasSubstr("4711"));
  EXPECT_THAT(right.description(), HasSubstr("4712"));
}

// The other one gets the number of the arm that lost its power.
TEST_F(TwoArmsTest, OneThatIsLostIsNotReopenedAsTheOther) {
  push(right, 2);
  mock->power(0, 0);
  for (int i = 0; i < 5; ++i) push(left, 0);
  EXPECT_TRUE(left.lost());
  left.close();
  EXPECT_THAT(refusal(left), AllOf(HasSubstr("4711"), HasSubstr("open already")));
  push(right, 2);
  EXPECT_EQ(force(1), 2) << "nothing has happened to it";
  EXPECT_EQ(mock->isOpenArm(1), 1);
  mock->power(0, 1);
  left.open();
  push(left, 1);
  EXPECT_EQ(force(0), 1);
  EXPECT_EQ(force(1), 2);
}

TEST_F(TwoArmsTest, OneThatIsLostIsNotReopenedAsOneThatNobodyUses) {
  right.close();
  mock->power(0, 0);
  left.close();
  EXPECT_THAT(refusal(left), AllOf(HasSubstr("4711"), HasSubstr("4712")));
  EXPECT_EQ(mock->isOpenArm(1), 0);
}

TEST_F(TwoArmsTest, AnArmIsFoundAgainUnderAnotherNumber) {
  left.close();
  mock->power(0, 0);
  right.close();
  right.open();
  push(right, 2);
  EXPECT_EQ(force(1), 2);
}

TEST_F(TwoArmsTest, OneArmIsNotOpenedTwice) {
  ForceDimensionDevice again{{.index = 1}};
  EXPECT_THAT(refusal(again), HasSubstr("open already"));
  EXPECT_EQ(mock->isOpenArm(1), 1);
}

TEST_F(DhdTest, TheMockAbortsOnACallWithoutADevice) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto stop = reinterpret_cast<int (*)(char)>(dlsym(dlopen(MOCK_DRD, RTLD_NOW), "dhdStop"));
  EXPECT_DEATH(stop(0), "without a device");
}

}  // namespace
}  // namespace hapticd::device
