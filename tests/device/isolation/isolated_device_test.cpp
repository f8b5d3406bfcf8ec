// A driver in a process of its own.
#include "device/isolation/isolated_device.h"
#include "base/clock.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>
#include <unistd.h>
#include <array>
#include <cstring>
#include <memory>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <mutex>
#include <new>
#include <stdexcept>
#include <vector>

#include "device/isolation/observed_hand.h"
#include "device/plane_scene.h"

namespace hapticd::device {
namespace {

using namespace std::chrono_literals;
using testing::AllOf;
using testing::HasSubstr;

bool eventually(const std::function<bool()>& condition) {
  for (int i = 0; i < 10000; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(1ms);
  }
  return false;
}

std::string refusal(Device& device) {
  try {
    device.open();
    return "opened";
  } catch (const std::exception& error) {
    return error.what();
  }
}

class IsolationTest : public testing::TestWithParam<const char*> {
 protected:
  IsolationTest() {
    const int file = ::open(path_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    EXPECT_EQ(ftruncate(file, sizeof(ObservedHand)), 0);
    void* memory = mmap(nullptr, sizeof(ObservedHand), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    ::close(file);
    hand = new (memory) ObservedHand;
  }
  ~IsolationTest() override {
    munmap(hand, sizeof(ObservedHand));
    unlink(path_.c_str());
  }
  // "watched": as "selfpaced", and the loop watches for each post.
  IsolatedOptions host(const std::string& mode) const {
    const bool watches = mode == "watched";
    return {.command = {TEST_HOST, watches ? "selfpaced" : mode, path_}, .watches = watches};
  }
  Vec3 force() const { return {hand->fx, hand->fy, hand->fz}; }
  // Pushes with one force in every tick and keeps the state.
  void push(IsolatedDevice& device, const Vec3& force_N) {
    device.start([this, &device, force_N](Nanos now) {
      DeviceState read;
      const bool got = device.read(now, read);
      device.write(force_N);
      const std::lock_guard lock(mutex_);
      got_ = got;
      state_ = read;
      ++ticks_;
    });
  }
  DeviceState state() const {
    const std::lock_guard lock(mutex_);
    return state_;
  }

  ObservedHand* hand = nullptr;
  std::atomic<int> ticks_{0};

 private:
  const std::string path_ = testing::TempDir() + "hapticd_hand_" + std::to_string(getpid());
  mutable std::mutex mutex_;
  DeviceState state_;
  bool got_ = false;
};

TEST_P(IsolationTest, StateAndForceCrossTheBoundary) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  EXPECT_EQ(device.profile().model, "observed");
  EXPECT_EQ(device.profile().peakForce_N, 5);
  EXPECT_DOUBLE_EQ(device.profile().transportDelay_s, 0.001);
  EXPECT_TRUE(device.traits().selfPaced);
  EXPECT_FALSE(device.traits().ticksInVendorThread);
  EXPECT_TRUE(device.traits().calibratesInLoop) << "as the driver says";
  EXPECT_FALSE(device.traits().needsRearm) << "as the driver says";
  EXPECT_EQ(device.traits().forceLife, 3'000'000) << "the process of the driver ends what nobody renews";
  hand->x = 0.01;
  push(device, Vec3(1, 2, 3));
  EXPECT_TRUE(eventually([&] { return state().position_m.x() == 0.01 && force() == Vec3(1, 2, 3); }));
  EXPECT_EQ(state().hold, kHoldNone);
  EXPECT_FALSE(device.write(Vec3(std::nan(""), 0, 0)));
  EXPECT_TRUE(eventually([&] { return device.faultText() == "words of the driver"; }));
  device.calibrate();
  EXPECT_EQ(hand->calibrations, 1);
  EXPECT_THROW(device.calibrate(), std::runtime_error);
  device.stop();
  EXPECT_TRUE(force().isZero());
  push(device, Vec3(0, 1, 0));
  EXPECT_TRUE(eventually([&] { return force() == Vec3(0, 1, 0); })) << "start after stop";
  device.close();
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(hand->closed, 1) << "closed in order";
  EXPECT_EQ(device.process(), -1);
  device.close();
}

TEST_P(IsolationTest, TellsWhenAZeroHasReachedTheDriver) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  std::atomic<bool> pushes{true};
  std::atomic<bool> sent{false};
  std::atomic<int> tooEarly{0};
  device.start([&](Nanos) {
    device.write(pushes ? Vec3(0, 1, 0) : Vec3(0, 0, 0));
    sent = device.zeroSent();
    if (sent && !force().isZero()) ++tooEarly;
  });
  for (int round = 0; round < 20; ++round) {
    pushes = true;
    ASSERT_TRUE(eventually([&] { return force().y() == 1; }));
    EXPECT_TRUE(eventually([&] { return !sent; })) << "the tick may still be in its write";
    pushes = false;
    EXPECT_TRUE(eventually([&] { return sent.load(); }));
  }
  device.stop();
  EXPECT_EQ(tooEarly, 0);
}

TEST_P(IsolationTest, ACrashIsAFaultAndTheServerGoesOn) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  push(device, Vec3(0, 1, 0));
  ASSERT_TRUE(eventually([&] { return force().y() == 1; }));
  hand->fault = 1;
  EXPECT_TRUE(eventually([&] { return state().hold == kHoldFault; }));
  const int ticks = ticks_;
  EXPECT_TRUE(eventually([&] { return ticks_ > ticks + 3; })) << "so that the fault is reported";
  EXPECT_TRUE(eventually([&] { return device.faultText().find("anew") != std::string::npos; }));
  device.close();
  hand->fault = 0;
  device.open();
  push(device, Vec3(0, 1, 0));
  EXPECT_TRUE(eventually([&] { return state().hold == kHoldNone && force().y() == 1; }));
}

TEST_P(IsolationTest, WhatTheDriverSaysTooLateIsNotLost) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->fault = 3;
  EXPECT_THAT(device.faultText(), HasSubstr("has not answered yet"));
  std::this_thread::sleep_for(400ms);  // until the answer is there; the test passes also when it is not
  EXPECT_TRUE(eventually([&] { return device.faultText() == "told once"; }));
  EXPECT_TRUE(eventually([&] { return device.faultText().empty(); }));
}

// The server's network thread asks, and a stop must not wait for the answer.
TEST_P(IsolationTest, AProcessThatDoesNotAnswerDelaysNobody) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  EXPECT_TRUE(eventually([&] { return device.faultText() == "words of the driver"; }));
  hand->fault = 6;
  auto fastest = std::chrono::steady_clock::duration::max();  // a stall may delay some
  for (int i = 0; i < 10; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    EXPECT_EQ(device.faultText(), "words of the driver") << "what it said last";
    fastest = std::min(fastest, std::chrono::steady_clock::now() - begin);
  }
  EXPECT_LT(fastest, 100ms);
  EXPECT_TRUE(eventually([&] { return device.faultText() == "the driver's process does not answer"; }));
  hand->fault = 4;
  EXPECT_TRUE(eventually([&] { return device.faultText().empty(); }));
}

// Of a busy machine: nothing was told since the device was opened. A new process would not know why it was
// lost.
TEST_P(IsolationTest, AProcessTellsWhyItsDeviceIsLostBeforeItIs) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->fault = 6;
  push(device, Vec3::Zero());
  ASSERT_TRUE(eventually([&] { return ticks_ > 20; })) << "the loss is known";
  EXPECT_THAT(device.faultText(), HasSubstr("has not answered yet"));
  EXPECT_FALSE(device.lost());
  hand->fault = 7;
  EXPECT_TRUE(eventually([&] { return device.faultText() == "words of the driver"; }));
  EXPECT_TRUE(device.lost());
}

TEST_P(IsolationTest, WhatAProcessSaidBeforeALossDoesNotExplainIt) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->fault = 4;
  push(device, Vec3::Zero());
  EXPECT_TRUE(eventually([&] { return device.faultText().empty(); }));
  hand->fault = 6;
  const int ticks = ticks_;
  ASSERT_TRUE(eventually([&] { return ticks_ > ticks + 20; })) << "the loss is known";
  EXPECT_FALSE(device.lost());
  hand->fault = 7;
  EXPECT_TRUE(eventually([&] { return device.faultText() == "words of the driver" && device.lost(); }));
}

// 5 s, and the same for all.
class SilentFault : public IsolationTest {};
INSTANTIATE_TEST_SUITE_P(Paced, SilentFault, testing::Values("polled"));
TEST_P(SilentFault, IsNotWaitedForLonger) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->fault = 6;
  push(device, Vec3::Zero());
  EXPECT_TRUE(eventually([&] { return device.faultText() == "the driver's process does not answer"; }));
  EXPECT_TRUE(device.lost());
}

TEST_P(IsolationTest, ALateAnswerIsNotTakenForThatOfTheNextRequest) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->calibrations = 1;  // the next one is refused
  hand->fault = 3;
  EXPECT_THAT(device.faultText(), HasSubstr("has not answered yet"));
  EXPECT_THROW(device.calibrate(), std::runtime_error);
  EXPECT_EQ(hand->calibrations, 2);
}

TEST_P(IsolationTest, AnOpeningThatHangsIsInterrupted) {
  IsolatedDevice device(host(GetParam()));
  hand->fault = 5;
  std::thread other([&] {
    EXPECT_TRUE(eventually([&] { return device.process() >= 0; }));
    device.interrupt();
  });
  EXPECT_EQ(refusal(device), "the device is being closed for good");
  EXPECT_EQ(device.process(), -1);
  other.join();
  EXPECT_EQ(refusal(device), "the device is being closed for good");
}

TEST_P(IsolationTest, AStopReachesACalibration) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->fault = 5;
  try {
    device.calibrate([&] { return hand->calibrations == 1; });
    ADD_FAILURE() << "it was stopped";
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(error.what(), "a person stopped it") << "the driver itself says so";
  }
  hand->fault = 0;
  hand->calibrations = 0;
  device.calibrate();
}

TEST_P(IsolationTest, ACalibrationThatHangsIsInterrupted) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  push(device, Vec3(0, 1, 0));
  ASSERT_TRUE(eventually([&] { return force().y() == 1; }));
  hand->fault = 5;
  std::thread other([&] {
    EXPECT_TRUE(eventually([&] { return hand->calibrations == 1; }));
    device.interrupt();
  });
  EXPECT_THROW(device.calibrate(), std::runtime_error);
  other.join();
  hand->fault = 0;
  device.close();
  EXPECT_TRUE(force().isZero());
  EXPECT_EQ(hand->closed, 1) << "the device is closed in order all the same";
}

TEST_P(IsolationTest, AHangIsAFault) {
  IsolatedDevice device(host(GetParam()));
  device.open();
  push(device, Vec3(0, 1, 0));
  ASSERT_TRUE(eventually([&] { return force().y() == 1; }));
  hand->fault = 2;
  EXPECT_TRUE(eventually([&] { return state().hold == kHoldFault; }));
  hand->fault = 0;
  EXPECT_TRUE(eventually([&] { return state().hold == kHoldNone; }));
}

TEST_P(IsolationTest, AServerThatStopsTickingLosesItsForce) {
  std::atomic<bool> stuck{false};  // outlives the device, whose thread reads it
  IsolatedDevice device(host(GetParam()));
  device.open();
  device.start([&](Nanos now) {
    DeviceState read;
    device.read(now, read);
    device.write(Vec3(0, 1, 0));
    while (stuck) std::this_thread::sleep_for(1ms);
  });
  ASSERT_TRUE(eventually([&] { return force().y() == 1; }));
  stuck = true;
  EXPECT_TRUE(eventually([&] { return force().isZero(); }));
  stuck = false;
  EXPECT_TRUE(eventually([&] { return force().y() == 1; }));
}

TEST_P(IsolationTest, APlaneFeelsAsOnTheSimulatedDevice) {
  const std::vector<Vec3> places = plane_scene::places(40);
  const std::vector<Vec3> expected = plane_scene::referenceForces(places);
  std::atomic<double> seenZ{1};
  base::MonotonicClock clock;
  IsolatedDevice device(host(GetParam()));
  device.open();
  realtime::Tick servo(device, clock, plane_scene::raw());
  servo.snapshots().publish(plane_scene::snapshot());
  const auto moveTo = [&](const Vec3& place) {
    hand->x = place.x();
    hand->z = place.z();
  };
  moveTo(places.front());
  device.start([&](Nanos now) {
    servo(now);
    seenZ = servo.last().device.position_m.z();
  });
  for (std::size_t i = 0; i < places.size() && !HasFailure(); ++i) {
    moveTo(places[i]);
    EXPECT_TRUE(eventually([&] {
      return seenZ == places[i].z() && (force() - expected[i]).norm() <= 0.01 * expected[i].norm() + 1e-9;
    })) << "place "
        << i << ": " << force().transpose() << " instead of " << expected[i].transpose();
  }
  device.stop();
}

// Told, not tested: it is the machine's.
TEST_P(IsolationTest, TellsTheTimeFromPostToTick) {
  std::vector<Nanos> times(200);  // what the device's thread uses outlives the device
  std::atomic<std::size_t> count{0};
  IsolatedDevice device(host(GetParam()));
  device.open();
  device.start([&](Nanos now) {
    DeviceState read;
    device.read(now, read);
    device.write(Vec3::Zero());
    if (count < times.size()) times[count] = device.postToTick();
    ++count;
  });
  ASSERT_TRUE(eventually([&] { return count >= times.size(); }));
  device.stop();
  std::sort(times.begin(), times.end());
  std::printf("post to tick: median %.1f us, p99 %.1f us\n", 1e-3 * static_cast<double>(times[100]),
              1e-3 * static_cast<double>(times[198]));
  EXPECT_GT(times[100], 0);
}

// A tick that waits for the processor can find a state that was posted since it began.
TEST_P(IsolationTest, AStateThatCameAfterTheTickBeganIsNotNegativelyOld) {
  std::atomic<Nanos> time{-1};
  IsolatedDevice device(host(GetParam()));
  device.open();
  device.start([&](Nanos now) {
    DeviceState state;
    if (device.read(now - 1'000'000'000, state)) time = device.postToTick();
  });
  ASSERT_TRUE(eventually([&] { return time != -1; }));
  device.stop();
  EXPECT_EQ(time, 0);
}

TEST_P(IsolationTest, AStateThatNeverCameHasNoAgeAndNoPlace) {
  std::atomic<bool> fault{false};
  std::atomic<Nanos> age{0};
  std::atomic<double> place_m{0};
  IsolatedDevice device(host(GetParam()));
  device.open();
  hand->fault = 2;
  device.start([&](Nanos now) {
    DeviceState state;
    state.position_m.x() = 7;
    if (fault || !device.read(now, state) || state.hold != kHoldFault) return;
    age = device.postToTick();
    place_m = state.position_m.x();
    fault = true;
  });
  EXPECT_TRUE(eventually([&] { return fault.load(); }));
  hand->fault = 0;
  device.stop();
  EXPECT_EQ(age, 0) << "and not the time since the machine started";
  EXPECT_EQ(place_m, 7) << "and not the origin";
}

INSTANTIATE_TEST_SUITE_P(Paced, IsolationTest, testing::Values("selfpaced", "polled", "watched"),
                         [](const auto& test) { return std::string(test.param); });

TEST(Isolation, SaysWhyADriverDoesNotOpen) {
  IsolatedDevice failing({.command = {TEST_HOST, "failing"}});
  EXPECT_EQ(refusal(failing), "no such arm");
  EXPECT_EQ(failing.process(), -1);
  IsolatedDevice missing({{"/nowhere/host"}});
  EXPECT_THAT(refusal(missing), HasSubstr("/nowhere/host"));
  IsolatedDevice none{IsolatedOptions()};
  EXPECT_THAT(refusal(none), HasSubstr("no program"));
  IsolatedDevice stranger({{"/bin/true"}});
  EXPECT_THAT(refusal(stranger), HasSubstr("status 0"));
#ifndef HAPTICD_SANITIZED  // which turn the signal into an exit
  IsolatedDevice crashing({.command = {TEST_HOST, "crash"}});
  EXPECT_THAT(refusal(crashing), HasSubstr("signal 11"));
#endif
}

TEST(Isolation, CarriesAVendorsLibrary) {
  setenv("HAPTICD_HDAPI_LIB", MOCK_HD, 1);
  IsolatedDevice device({.command = {TEST_HOST, "openhaptics"}});
  device.open();
  EXPECT_EQ(device.profile().model, "Touch");
  EXPECT_DOUBLE_EQ(device.profile().continuousForce_N, 0.88);
  std::atomic<int> good{0};
  device.start([&](Nanos now) {
    DeviceState state;
    if (device.read(now, state) && state.hold == kHoldNone) ++good;
    device.write(Vec3(0, 1, 0));
  });
  EXPECT_TRUE(eventually([&] { return good > 100; }));
  device.close();
}

// A library that writes where it should not has the shared memory within its reach.

using isolation::Posted;
using isolation::SharedBlock;
using isolation::SharedProfile;

std::string impossible(const SharedProfile& shared) {
  try {
    shared.toProfile();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "taken";
}

TEST(SharedBlock, ProfileAndStateSurvive) {
  DeviceProfile profile;
  profile.model = "a model";
  profile.peakForce_N = 7;
  profile.hasGripper = profile.startsArmed = true;
  const SharedProfile shared = SharedProfile::of(profile, {.calibratesInLoop = true, .needsRearm = false});
  const DeviceProfile again = shared.toProfile();
  EXPECT_EQ(again.model, "a model");
  EXPECT_EQ(again.workspace_m.min, profile.workspace_m.min);
  EXPECT_EQ(again.workspace_m.max, profile.workspace_m.max);
  EXPECT_EQ(again.peakForce_N, 7);
  EXPECT_TRUE(again.hasGripper && again.startsArmed);
  EXPECT_TRUE(shared.toTraits().selfPaced && shared.toTraits().calibratesInLoop);
  EXPECT_FALSE(shared.toTraits().needsRearm || shared.toTraits().ticksInVendorThread);

  DeviceState state{.time = 5,
                    .position_m = {1, 2, 3},
                    .orientation = Quat(0.5, 0.5, 0.5, 0.5),
                    .velocity_m_per_s = {4, 5, 6},
                    .angularVelocity_rad_per_s = {7, 8, 9},
                    .buttons = 3,
                    .hold = kHoldFault,
                    .motorTemperature = 0.5,
                    .gripper_rad = 0.25};
  const DeviceState copy = Posted::of(state).toState();
  EXPECT_EQ(copy.time, 5);
  EXPECT_EQ(copy.position_m, state.position_m);
  EXPECT_EQ(copy.orientation.coeffs(), state.orientation.coeffs());
  EXPECT_EQ(copy.velocity_m_per_s, state.velocity_m_per_s);
  EXPECT_EQ(copy.angularVelocity_rad_per_s, state.angularVelocity_rad_per_s);
  EXPECT_EQ(copy.buttons, 3U);
  EXPECT_EQ(copy.hold, kHoldFault);
  EXPECT_EQ(copy.motorTemperature, 0.5);
  EXPECT_EQ(copy.gripper_rad, 0.25);
  state.gripper_rad.reset();
  EXPECT_FALSE(Posted::of(state).toState().gripper_rad);
}

TEST(SharedBlock, AnImpossibleProfileIsRefused) {
  const SharedProfile good = SharedProfile::of({}, {});
  EXPECT_EQ(impossible(good), "taken");
  SharedProfile bad = good;
  bad.model.fill('x');  // without an end
  EXPECT_EQ(bad.toProfile().model, std::string(128, 'x'));
  bad.peakForce_N = std::nan("");
  EXPECT_EQ(impossible(bad), "the driver's process reports the impossible peak force nan");
  bad = good;
  bad.buttons = -1;
  EXPECT_EQ(impossible(bad), "the driver's process reports the impossible number of buttons -1");
  bad = good;
  bad.workspace_m[3] = bad.workspace_m[0] - 1;
  EXPECT_NE(impossible(bad), "taken");
}

// A write of the other process to the index of a cell must not make this one read or write elsewhere.
TEST(SharedBlock, ScribbledBytesStayWithinTheBlock) {
  struct Guarded {
    std::array<std::byte, 4096> before;
    alignas(64) std::array<std::byte, sizeof(SharedBlock)> block;
    std::array<std::byte, 1U << 20U> after;
  };
  const auto memory = std::make_unique<Guarded>();
  for (const int scribble : {0x03, 0x07, 0x7F, 0xFF}) {
    std::memset(static_cast<void*>(memory.get()), scribble, sizeof(Guarded));
    auto& block = *reinterpret_cast<SharedBlock*>(memory->block.data());
    for (int i = 0; i < 3; ++i) {
      const auto* read = reinterpret_cast<const std::byte*>(&block.state.read());
      EXPECT_GE(read, memory->block.data());
      EXPECT_LE(read + sizeof(Posted), memory->block.data() + memory->block.size());
      block.command.write({Vec3(1, 2, 3), 4});
    }
    const auto scribbled = [&](std::byte b) { return b == static_cast<std::byte>(scribble); };
    EXPECT_TRUE(std::all_of(memory->before.begin(), memory->before.end(), scribbled));
    EXPECT_TRUE(std::all_of(memory->after.begin(), memory->after.end(), scribbled));
  }
}

}  // namespace
}  // namespace hapticd::device
