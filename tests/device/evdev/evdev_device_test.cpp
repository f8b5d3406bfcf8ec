// A force-feedback joystick on a fake of its file.
#include "device/evdev/evdev_device.h"
#include "base/clock.h"
#include "base/world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <pthread.h>
#include <sched.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <thread>

#include "device/evdev/fake_event_device.h"
#include "device/plane_scene.h"

namespace hapticd::device {
namespace {

using testing::HasSubstr;

constexpr Nanos kMs = 1'000'000;

class EvdevTest : public testing::Test {
 protected:
  std::unique_ptr<EvdevDevice> make(bool thread = false) {
    return std::make_unique<EvdevDevice>(std::make_unique<FakeEventDevice>(joystick), wheel, thread);
  }
  // One period of the servo, and the exchange in between.
  DeviceState tick(EvdevDevice& device, const Vec3& force_N) {
    now += kMs;
    device.exchange(now);
    DeviceState state;
    EXPECT_TRUE(device.read(now, state));
    EXPECT_TRUE(device.write(force_N));
    return state;
  }
  void expectForce(double x_N, double z_N) {
    const auto [x, z] = joystick.force();
    EXPECT_NEAR(x * wheel.force_N, x_N, 1e-3);
    EXPECT_NEAR(z * wheel.force_N, z_N, 1e-3);
  }

  FakeJoystick joystick;
  WheelProfile wheel;
  Nanos now = 1000 * kMs;
};

TEST_F(EvdevTest, TakesOnlyADeviceWithAForce) {
  joystick.hasForce = false;
  const auto device = make();
  try {
    device->open();
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no constant force"));
  }
}

TEST_F(EvdevTest, AnAxisWithoutARangeIsToldWithItsDevice) {
  joystick.maximum = joystick.minimum;
  const auto device = make();
  try {
    device->open();
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "Fake Stick: axis 0 has no range");
  }
}

TEST_F(EvdevTest, PositionAndButtonsInTheDeviceFrame) {
  const auto device = make();
  device->open();
  EXPECT_EQ(device->profile().model, "Fake Stick");
  EXPECT_EQ(device->profile().buttons, 2);
  EXPECT_FALSE(device->profile().startsArmed);
  EXPECT_EQ(joystick.settings.at(FF_AUTOCENTER), 0) << "its own spring is off";
  joystick.move(0.5, -1);  // right, and away from the user
  joystick.send(EV_KEY, BTN_THUMB, 1);
  DeviceState state = tick(*device, Vec3::Zero());
  EXPECT_NEAR(state.position_m.x(), 0.025, 1e-5);
  EXPECT_NEAR(state.position_m.z(), -0.05, 1e-5);
  EXPECT_EQ(state.buttons, 2U);
  joystick.send(EV_KEY, BTN_THUMB, 0);
  EXPECT_EQ(tick(*device, Vec3::Zero()).buttons, 0U);
}

TEST_F(EvdevTest, TellsWhenAZeroHasLeft) {
  const auto device = make();
  device->open();
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 0));
  EXPECT_FALSE(device->zeroSent());
  tick(*device, Vec3::Zero());
  EXPECT_FALSE(device->zeroSent()) << "it waits for the exchange";
  device->write(Vec3::Zero());
  for (int i = 0; i < 2; ++i) device->exchange(now += kMs);
  expectForce(0, 0);
  EXPECT_TRUE(device->zeroSent());
  device->write(Vec3::Zero());
  EXPECT_TRUE(device->zeroSent()) << "a further zero changes nothing";
  device->write(Vec3(1, 0, 0));
  EXPECT_FALSE(device->zeroSent());
  device->write(Vec3::Zero());
  EXPECT_FALSE(device->zeroSent()) << "the force between may be on its way";
  for (int i = 0; i < 2; ++i) device->exchange(now += kMs);
  EXPECT_TRUE(device->zeroSent());
}

TEST_F(EvdevTest, AZeroThatTheKernelRefusesHasNotLeft) {
  const auto device = make();
  device->open();
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 0));
  device->write(Vec3::Zero());
  joystick.error = EIO;
  for (int i = 0; i < 4; ++i) device->exchange(now += kMs);
  EXPECT_FALSE(device->zeroSent());
}

// Threads of others that compute must not keep a stop from the joystick.
TEST_F(EvdevTest, ItsThreadHasRealtimePriorityWhereTheSystemGrantsIt) {
  bool granted = false;
  std::thread([&] {
    sched_param parameters{};
    parameters.sched_priority = kDriverPriority;
    granted = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0;
  }).join();
  const auto device = make(true);
  device->open();
  int policy = -1;
  while (policy < 0) {  // until the thread has its name
    for (const auto& task : std::filesystem::directory_iterator("/proc/self/task")) {
      std::string name;
      std::getline(std::ifstream(task.path() / "comm"), name);
      DeviceState state;
      if (name == "evdev" && device->read(base::now(), state))
        policy = sched_getscheduler(std::stoi(task.path().filename().string()));
    }
  }
  EXPECT_EQ(policy & ~SCHED_RESET_ON_FORK, granted ? SCHED_FIFO : SCHED_OTHER);
}

TEST_F(EvdevTest, VelocityFollowsASteadyHand) {
  const auto device = make();
  device->open();
  DeviceState state;
  for (int i = 0; i < 60; ++i) {
    joystick.move(0.002 * i, 0);  // 0.1 m/s
    state = tick(*device, Vec3::Zero());
  }
  EXPECT_NEAR(state.velocity_m_per_s.x(), 0.1, 0.003);
}

TEST_F(EvdevTest, ForceGoesWhereItShould) {
  const auto device = make();
  device->open();
  const Vec3 wanted[] = {{1, 0, 0}, {-1, 0, 0}, {0, 0, 1}, {0, 0, -1}, {0.6, 0, -0.8}, {-0.3, 0, 0.1}};
  for (const Vec3& force : wanted) {
    for (int i = 0; i < 4; ++i) tick(*device, force);
    expectForce(force.x(), force.z());
    EXPECT_TRUE(joystick.damping()) << "the device's own damper helps while it pushes";
  }
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(6, 0, 8));
  expectForce(1.2, 1.6);
  for (int i = 0; i < 4; ++i) tick(*device, Vec3::Zero());
  expectForce(0, 0);
  EXPECT_FALSE(joystick.damping());
  EXPECT_EQ(joystick.effects.size(), 2U) << "changed in place";
  EXPECT_FALSE(device->write(Vec3(std::nan(""), 0, 0)));
}

TEST_F(EvdevTest, AWheelHasOneAxis) {
  joystick.wheel = true;
  wheel.invertForce = true;
  const auto device = make();
  device->open();
  EXPECT_EQ(device->profile().inputDof, 1);
  EXPECT_EQ(device->profile().outputDof, 1);
  joystick.move(0, 1);
  EXPECT_EQ(tick(*device, Vec3::Zero()).position_m.z(), 0) << "its y axis is a pedal";
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 1));
  expectForce(-1, 0);
}

TEST_F(EvdevTest, AtMost500UploadsASecondAndNoneWithoutChange) {
  const auto device = make();
  device->open();
  const int before = joystick.uploads;
  for (int i = 0; i < 1000; ++i) tick(*device, Vec3(0.001 * i, 0, 0));
  EXPECT_LE(joystick.uploads - before, 500);
  EXPECT_GE(joystick.uploads - before, 450);
  const int steady = joystick.uploads;
  for (int i = 0; i < 100; ++i) tick(*device, Vec3(0.999, 0, 0));
  EXPECT_LE(joystick.uploads - steady, 1);
}

TEST_F(EvdevTest, AForceThatIsNotRenewedIsTakenBackWithin25Ms) {
  const auto device = make();
  device->open();
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 0));
  expectForce(1, 0);
  for (int i = 0; i < 25; ++i) device->exchange(now += kMs);
  expectForce(0, 0);
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 0));
  expectForce(1, 0);
}

TEST_F(EvdevTest, UnpluggedIsAFaultAndOneFailureIsNot) {
  const auto device = make();
  device->open();
  joystick.error = EBUSY;
  EXPECT_EQ(tick(*device, Vec3(1, 0, 0)).hold, kHoldNone);
  joystick.error = 0;
  EXPECT_EQ(tick(*device, Vec3(1, 0, 0)).hold, kHoldNone);
  joystick.error = ENODEV;
  EXPECT_EQ(tick(*device, Vec3(1, 0, 0)).hold, kHoldFault);
  EXPECT_THAT(device->faultText(), HasSubstr("anew"));
  joystick.error = 0;
  EXPECT_EQ(tick(*device, Vec3(1, 0, 0)).hold, kHoldNone);
  EXPECT_EQ(device->faultText(), "");
}

TEST_F(EvdevTest, AnExchangeThatHangsIsAFault) {
  const auto device = make();
  device->open();
  tick(*device, Vec3::Zero());
  DeviceState state;
  EXPECT_TRUE(device->read(now + 101 * kMs, state));
  EXPECT_EQ(state.hold, kHoldFault);
}

TEST_F(EvdevTest, NothingIsLeftAfterClose) {
  const auto device = make();
  device->open();
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 0));
  device->close();
  device->close();
  EXPECT_TRUE(joystick.playing.empty());
  EXPECT_TRUE(joystick.effects.empty());
  device->open();
  for (int i = 0; i < 4; ++i) tick(*device, Vec3(1, 0, 0));
  expectForce(1, 0);
}

TEST_F(EvdevTest, WhatHappenedWhileItWasUnpluggedIsSeen) {
  const auto device = make();
  device->open();
  joystick.send(EV_KEY, BTN_THUMB, 1);
  EXPECT_EQ(tick(*device, Vec3::Zero()).buttons, 2U);
  joystick.error = ENODEV;
  tick(*device, Vec3::Zero());
  device->close();
  joystick.send(EV_KEY, BTN_THUMB, 0);
  joystick.send(EV_KEY, BTN_TRIGGER, 1);
  joystick.events.clear();
  joystick.error = 0;
  device->open();
  EXPECT_EQ(tick(*device, Vec3::Zero()).buttons, 1U);
}

TEST_F(EvdevTest, EventsThatTheKernelDroppedAreNotMissed) {
  const auto device = make();
  device->open();
  joystick.send(EV_KEY, BTN_THUMB, 1);
  joystick.move(0.5, 0.5);
  EXPECT_EQ(tick(*device, Vec3::Zero()).buttons, 2U);
  joystick.send(EV_KEY, BTN_THUMB, 0);
  joystick.move(-0.5, 0.5);
  joystick.move(-0.5, -1);
  joystick.overflow();
  const DeviceState state = tick(*device, Vec3::Zero());
  EXPECT_EQ(state.buttons, 0U);
  EXPECT_NEAR(state.position_m.x(), -0.025, 1e-5);
  EXPECT_NEAR(state.position_m.z(), -0.05, 1e-5);
}

TEST_F(EvdevTest, ItsOwnThreadDoesTheExchange) {
  const auto device = make(true);
  device->open();
  const auto eventually = [&](const std::function<bool(const DeviceState&)>& condition) {
    DeviceState state;
    for (int i = 0; i < 5000; ++i) {
      device->write(Vec3(0, 0, 1));
      device->read(0, state);
      if (condition(state)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return false;
  };
  joystick.move(1, 0);
  EXPECT_TRUE(eventually([](const DeviceState& state) { return state.position_m.x() > 0.049; }));
  EXPECT_TRUE(eventually([&](const DeviceState&) { return joystick.force().second > 0.49; }));
  device->close();
  EXPECT_TRUE(joystick.playing.empty());
}

TEST_F(EvdevTest, APlaneFeelsAsOnTheSimulatedDevice) {
  // Long, with a rest of 4 ms at each place: the link is slower than the servo.
  const std::vector<Vec3> places = plane_scene::places(40);
  const std::vector<Vec3> expected = plane_scene::referenceForces(places);
  const auto device = make();
  device->open();
  base::SimulatedClock clock;
  realtime::Tick servo(*device, clock, plane_scene::raw());
  servo.snapshots().publish(plane_scene::snapshot());
  double most = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    joystick.move(places[i].x() / 0.05, places[i].z() / 0.05);
    for (int j = 0; j < 4; ++j) {
      device->exchange(now += kMs);
      servo(now);
    }
    const auto [x, z] = joystick.force();
    const Vec3 force = wheel.force_N * Vec3(x, 0, z);
    // An axis of 16 bits on 10 cm is 1.5 µm fine: 0.8 mN.
    EXPECT_LE((force - expected[i]).norm(), 0.01 * expected[i].norm() + 2e-3) << "place " << i;
    most = std::max(most, force.norm());
  }
  EXPECT_GT(most, 1.3);
}

}  // namespace
}  // namespace hapticd::device
