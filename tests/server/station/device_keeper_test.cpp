// A device that is lost, refuses, and comes back, by a script: what its keeper does and says at which time.
#include "base/clock.h"
#include "server/station/device_keeper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;
using base::Nanos;
using geometry::Vec3;
using testing::AllOf;
using testing::HasSubstr;

constexpr Nanos kMs = 1'000'000;

bool eventually(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + 20s;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(1ms);
  }
  return true;
}

// Counts what is done to it, and by which rules it was not.
class ScriptedDevice final : public device::Device {
 public:
  explicit ScriptedDevice(bool selfPaced) : selfPaced_(selfPaced) {}
  ~ScriptedDevice() override { stop(); }

  void open() override {
    ++opens;
    while (openBlocks) std::this_thread::sleep_for(1ms);
    const std::lock_guard lock(mutex_);
    if (!refusal_.empty()) throw std::runtime_error(refusal_);
    isOpen = true;
    isLost = false;
  }
  void close() noexcept override {
    stop();
    ++closes;
    isOpen = false;
  }
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(Nanos now, device::DeviceState& state) noexcept override {
    if (!isOpen) ++readsWhileClosed;
    ++reads;
    state.time = now;
    return true;
  }
  bool write(const Vec3& /*force_N*/) noexcept override { return true; }
  void calibrate() override {
    ++calibrations;
    while (calibrationBlocks) std::this_thread::sleep_for(1ms);
    if (calibrationFails) throw std::runtime_error("a hand was in the way");
    isCalibrated = true;
  }
  std::string faultText() const override {
    return isLost ? "the cable is out" : isCalibrated ? "" : "not calibrated";
  }
  bool lost() const noexcept override { return isLost; }

  device::DeviceTraits traits() const noexcept override { return {.selfPaced = selfPaced_}; }
  void start(std::function<void(Nanos)> onTick) override {
    if (startFails) throw std::runtime_error("the scheduler is refused");
    leave_ = false;
    thread_ = std::thread([this, onTick = std::move(onTick)] {
      for (Nanos now = kMs; !leave_; now += kMs) {
        onTick(now);
        std::this_thread::sleep_for(1ms);
      }
    });
  }
  void stop() noexcept override {
    leave_ = true;
    if (thread_.joinable()) thread_.join();
  }

  void refuse(const std::string& words) {
    const std::lock_guard lock(mutex_);
    refusal_ = words;
  }

  std::atomic<int> opens{0}, closes{0}, reads{0}, readsWhileClosed{0};
  std::atomic<bool> isOpen{false}, isLost{false}, openBlocks{false}, startFails{false};
  std::atomic<int> calibrations{0};
  std::atomic<bool> isCalibrated{true}, calibrationBlocks{false}, calibrationFails{false};

 private:
  const bool selfPaced_;
  const device::DeviceProfile profile_;
  std::mutex mutex_;
  std::string refusal_;
  std::thread thread_;
  std::atomic<bool> leave_{false};
};

class KeeperTest : public testing::TestWithParam<bool> {
 protected:
  KeeperTest() {
    device_.open();
    device_.opens = 0;
  }
  ~KeeperTest() override { EXPECT_EQ(device_.readsWhileClosed, 0); }

  bool loopRuns() {
    const int before = device_.reads;
    return eventually([&] { return device_.reads > before; });
  }
  void expectNoLoop() {
    const int before = device_.reads;
    std::this_thread::sleep_for(20ms);
    EXPECT_EQ(device_.reads, before);
  }
  // Lost, and for long enough.
  void loseAt(Nanos now) {
    device_.isLost = true;
    EXPECT_EQ(keeper_.look(now), "the cable is out");
    keeper_.look(now + 501 * kMs);
  }
  // What is said at this time when no attempt is under way any more.
  std::string saidAt(Nanos now) {
    std::string words;
    EXPECT_TRUE(eventually([&] {
      words = keeper_.look(now);
      return words != "the device is being opened anew";
    }));
    return words;
  }

  ScriptedDevice device_{GetParam()};
  base::MonotonicClock clock_;
  realtime::Tick tick_{device_, clock_};
  DeviceKeeper keeper_{device_, tick_, clock_, {.name = "Phantom"}};
};

TEST_P(KeeperTest, TheLoopRunsUntilStopped) {
  expectNoLoop();
  keeper_.start();
  EXPECT_TRUE(loopRuns());
  EXPECT_EQ(keeper_.look(0), "");
  keeper_.stop();
  expectNoLoop();
  keeper_.stop();
  EXPECT_EQ(device_.opens + device_.closes, 0) << "it was opened by somebody else, who closes it";
}

TEST_P(KeeperTest, ACalibrationIsDoneBesideTheLoop) {
  keeper_.start();
  device_.isCalibrated = false;
  EXPECT_EQ(keeper_.look(1000 * kMs), "not calibrated");
  EXPECT_EQ(device_.calibrations, 0) << "nobody asked";
  device_.calibrationBlocks = true;
  keeper_.calibrate();
  keeper_.calibrate();
  EXPECT_EQ(keeper_.look(1050 * kMs), "the device is being calibrated: keep hands off");
  EXPECT_TRUE(loopRuns());
  device_.calibrationBlocks = false;
  EXPECT_TRUE(eventually([&] { return keeper_.look(1100 * kMs).empty(); }));
  EXPECT_EQ(device_.calibrations, 1);
  EXPECT_EQ(device_.opens + device_.closes, 0);
}

TEST_P(KeeperTest, ACalibrationThatFailsSaysWhyUntilOneSucceeds) {
  keeper_.start();
  device_.isCalibrated = false;
  device_.calibrationFails = true;
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] {
    return keeper_.look(1000 * kMs) == "not calibrated; the last calibration: a hand was in the way";
  }));
  device_.calibrationFails = false;
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] { return keeper_.look(1100 * kMs).empty(); }));
  device_.isCalibrated = false;
  EXPECT_EQ(keeper_.look(1200 * kMs), "not calibrated");
}

TEST_P(KeeperTest, AShortLossIsToldAndNothingElse) {
  keeper_.start();
  device_.isLost = true;
  EXPECT_EQ(keeper_.look(1000 * kMs), "the cable is out");
  EXPECT_EQ(keeper_.look(1500 * kMs), "the cable is out");
  device_.isLost = false;
  EXPECT_EQ(keeper_.look(1600 * kMs), "");
  device_.isLost = true;  // another one, which counts anew
  EXPECT_EQ(keeper_.look(1700 * kMs), "the cable is out");
  EXPECT_EQ(keeper_.look(2200 * kMs), "the cable is out");
  EXPECT_EQ(device_.opens + device_.closes, 0);
  EXPECT_TRUE(loopRuns());
}

TEST_P(KeeperTest, ALostDeviceIsOpenedAnewWhileNoLoopRuns) {
  keeper_.start();
  EXPECT_TRUE(loopRuns());
  device_.openBlocks = true;
  loseAt(1000 * kMs);
  EXPECT_TRUE(eventually([&] { return device_.opens == 1; }));
  EXPECT_EQ(device_.closes, 1);
  EXPECT_EQ(keeper_.look(1600 * kMs), "the device is being opened anew");
  EXPECT_EQ(keeper_.look(60'000 * kMs), "the device is being opened anew") << "however long it takes";
  expectNoLoop();
  device_.openBlocks = false;
  EXPECT_EQ(saidAt(60'001 * kMs), "");
  EXPECT_TRUE(loopRuns());
  EXPECT_EQ(device_.opens, 1);
}

TEST_P(KeeperTest, ARefusalIsToldInItsWordsAndTriedAgainEveryTwoSeconds) {
  keeper_.start();
  device_.refuse("no arm on this machine; plug it in");
  loseAt(1000 * kMs);
  const auto refused =
      AllOf(HasSubstr("does not open: no arm on this machine; plug it in"), HasSubstr("every 2 s"));
  Nanos now = 2000 * kMs;
  EXPECT_THAT(saidAt(now), refused);
  for (int attempts = 1; attempts < 4; ++attempts) {
    EXPECT_EQ(device_.opens, attempts);
    EXPECT_EQ(device_.closes, 2 * attempts) << "before it, and after it failed";
    EXPECT_THAT(keeper_.look(now + 1999 * kMs), refused);
    EXPECT_EQ(device_.opens, attempts);
    now += 2000 * kMs;
    EXPECT_THAT(keeper_.look(now), refused) << "what is known until the new attempt ends";
    EXPECT_THAT(saidAt(now), refused);
  }
  expectNoLoop();
  device_.refuse("");
  keeper_.look(now + 2000 * kMs);
  EXPECT_EQ(saidAt(now + 2001 * kMs), "");
  EXPECT_TRUE(loopRuns());
  EXPECT_EQ(device_.opens, 5);
}

TEST_P(KeeperTest, ANewRefusalReplacesTheWords) {
  keeper_.start();
  device_.refuse("no power");
  loseAt(1000 * kMs);
  EXPECT_THAT(saidAt(2000 * kMs), HasSubstr("no power"));
  device_.refuse("no permission");
  keeper_.look(4000 * kMs);
  EXPECT_THAT(saidAt(4001 * kMs), AllOf(HasSubstr("no permission"), testing::Not(HasSubstr("no power"))));
}

TEST_P(KeeperTest, ItCanBeLostAgain) {
  keeper_.start();
  for (int time = 1; time <= 3; ++time) {
    loseAt(time * 10'000 * kMs);
    EXPECT_EQ(saidAt(time * 10'000 * kMs + 600 * kMs), "");
    EXPECT_EQ(device_.opens, time);
    EXPECT_TRUE(loopRuns());
  }
}

TEST_P(KeeperTest, StoppingWaitsForAnAttemptAndEndsItsLoop) {
  keeper_.start();
  device_.openBlocks = true;
  loseAt(1000 * kMs);
  EXPECT_TRUE(eventually([&] { return device_.opens == 1; }));
  std::atomic<bool> stopped{false};
  std::thread other([&] {
    keeper_.stop();
    stopped = true;
  });
  std::this_thread::sleep_for(20ms);
  EXPECT_FALSE(stopped) << "a driver is in the middle of opening";
  device_.openBlocks = false;
  other.join();
  EXPECT_TRUE(device_.isOpen) << "for whoever closes it";
  expectNoLoop();
  EXPECT_EQ(device_.opens, 1);
}

TEST_P(KeeperTest, StoppingARefusedDeviceLeavesItClosed) {
  keeper_.start();
  device_.refuse("no power");
  loseAt(1000 * kMs);
  EXPECT_THAT(saidAt(2000 * kMs), HasSubstr("no power"));
  keeper_.stop();
  EXPECT_FALSE(device_.isOpen);
  EXPECT_EQ(device_.opens, 1);
  expectNoLoop();
}

INSTANTIATE_TEST_SUITE_P(Loop, KeeperTest, testing::Bool(), [](const auto& instance) {
  return std::string(instance.param ? "OfTheDevice" : "OfTheServer");
});

class SelfPacedKeeperTest : public KeeperTest {};

TEST_P(SelfPacedKeeperTest, ALoopThatDoesNotStartIsARefusal) {
  keeper_.start();
  device_.startFails = true;
  loseAt(1000 * kMs);
  EXPECT_THAT(saidAt(2000 * kMs), HasSubstr("does not open: the scheduler is refused"));
  EXPECT_FALSE(device_.isOpen) << "nothing is left half open";
  device_.startFails = false;
  keeper_.look(4000 * kMs);
  EXPECT_EQ(saidAt(4001 * kMs), "");
  EXPECT_TRUE(loopRuns());
}

INSTANTIATE_TEST_SUITE_P(Loop, SelfPacedKeeperTest, testing::Values(true),
                         [](const auto&) { return std::string("OfTheDevice"); });

}  // namespace
}  // namespace hapticd::server
