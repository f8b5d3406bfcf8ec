// DeviceKeeper with a scripted device that is lost, refuses to open, and recovers: its actions and texts over
// time.
#include "server/station/device_keeper.h"
#include "base/clock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/capability.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
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

// Counts the calls, and those while it is closed.
class ScriptedDevice final : public device::Device {
 public:
  explicit ScriptedDevice(bool selfPaced) : selfPaced_(selfPaced) {}
  ~ScriptedDevice() override { stop(); }

  void open() override {
    ++opens;
    while (openBlocks && !isInterrupted) std::this_thread::sleep_for(1ms);
    if (isInterrupted) throw std::runtime_error("interrupted");
    const std::lock_guard lock(mutex_);
    if (!openError_.empty()) throw std::runtime_error(openError_);
    isOpen = true;
    isLost = false;
  }
  void close() noexcept override {
    stop();
    ++closes;
    while (closeBlocks) std::this_thread::sleep_for(1ms);
    isOpen = false;
  }
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(Nanos now, device::DeviceState& state) noexcept override {
    if (!isOpen) ++callsWhileClosed;
    while (readBlocks) std::this_thread::sleep_for(1ms);
    ++reads;
    state.time = now;
    return true;
  }
  bool write(const Vec3& /*force_N*/) noexcept override { return true; }
  bool zeroFromOtherThread() noexcept override {
    if (!isOpen) ++callsWhileClosed;
    ++zeroes;
    return true;
  }
  void calibrate(const std::function<bool()>& stopped) override {
    ++calibrations;
    while (calibrationBlocks && !stopped()) std::this_thread::sleep_for(1ms);
    if (stopped()) throw std::runtime_error("a person stopped it");
    if (calibrationFails) throw std::runtime_error("a hand was in the way");
    isCalibrated = true;
  }
  std::string faultText() const override {
    if (isLost) return "the cable is out";
    return isCalibrated ? "" : "not calibrated";
  }
  bool lost() const noexcept override { return isLost; }

  device::DeviceTraits traits() const noexcept override { return {.selfPaced = selfPaced_}; }
  void start(std::function<void(Nanos)> onTick) override {
    if (startFails) throw std::runtime_error("the scheduler is refused");
    leave_ = false;
    thread_ = std::thread([this, onTick = std::move(onTick)] {
      for (Nanos now = kMs; !leave_; now += kMs) {
        if (!ticksNever) onTick(now);
        std::this_thread::sleep_for(1ms);
      }
    });
  }
  void stop() noexcept override {
    leave_ = true;
    if (thread_.joinable()) thread_.join();
  }

  void interrupt() noexcept override { isInterrupted = canBeInterrupted.load(); }

  void refuse(const std::string& reason) {
    const std::lock_guard lock(mutex_);
    openError_ = reason;
  }

  std::atomic<int> opens{0}, closes{0}, reads{0}, callsWhileClosed{0};
  std::atomic<bool> isOpen{false}, isLost{false}, openBlocks{false}, startFails{false};
  std::atomic<bool> canBeInterrupted{true}, isInterrupted{false}, closeBlocks{false};
  std::atomic<int> zeroes{0};
  std::atomic<bool> readBlocks{false}, ticksNever{false};
  std::atomic<int> calibrations{0};
  std::atomic<bool> isCalibrated{true}, calibrationBlocks{false}, calibrationFails{false};

 private:
  const bool selfPaced_;
  const device::DeviceProfile profile_;
  std::mutex mutex_;
  std::string openError_;
  std::thread thread_;
  std::atomic<bool> leave_{false};
};

class KeeperTest : public testing::TestWithParam<bool> {
 protected:
  KeeperTest() {
    device_.open();
    device_.opens = 0;
  }
  ~KeeperTest() override { EXPECT_EQ(device_.callsWhileClosed, 0); }

  bool loopRuns() {
    const int before = device_.reads;
    return eventually([&] { return device_.reads > before; });
  }
  void expectNoLoop() {
    const int before = device_.reads;
    std::this_thread::sleep_for(20ms);
    EXPECT_EQ(device_.reads, before);
  }
  // Loses the device for long enough to be reopened.
  void loseAt(Nanos now) {
    device_.isLost = true;
    EXPECT_EQ(keeper_.poll(now), "the cable is out");
    keeper_.poll(now + 501 * kMs);
  }
  // The fault text at this time, after a running attempt ended.
  std::string faultAt(Nanos now) {
    std::string fault;
    EXPECT_TRUE(eventually([&] {
      fault = keeper_.poll(now);
      return fault != "the device is being reopened";
    }));
    return fault;
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
  EXPECT_EQ(keeper_.poll(0), "");
  keeper_.stop();
  expectNoLoop();
  keeper_.stop();
  EXPECT_EQ(device_.opens + device_.closes, 0) << "the owner of the device opens and closes it";
}

TEST_P(KeeperTest, CalibratesWhileTheLoopRuns) {
  keeper_.start();
  device_.isCalibrated = false;
  EXPECT_EQ(keeper_.poll(1000 * kMs), "not calibrated");
  EXPECT_EQ(device_.calibrations, 0) << "no calibration was requested";
  device_.calibrationBlocks = true;
  keeper_.calibrate();
  keeper_.calibrate();
  EXPECT_EQ(keeper_.poll(1050 * kMs), "the device is being calibrated: keep hands off");
  EXPECT_TRUE(loopRuns());
  device_.calibrationBlocks = false;
  EXPECT_TRUE(eventually([&] { return keeper_.poll(1100 * kMs).empty(); }));
  EXPECT_EQ(device_.calibrations, 1);
  EXPECT_EQ(device_.opens + device_.closes, 0);
}

TEST_P(KeeperTest, ReportsAFailedCalibrationUntilOneSucceeds) {
  keeper_.start();
  device_.isCalibrated = false;
  device_.calibrationFails = true;
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] {
    return keeper_.poll(1000 * kMs) == "not calibrated; the last calibration failed: a hand was in the way";
  }));
  device_.calibrationFails = false;
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] { return keeper_.poll(1100 * kMs).empty(); }));
  device_.isCalibrated = false;
  EXPECT_EQ(keeper_.poll(1200 * kMs), "not calibrated");
}

TEST_P(KeeperTest, AStopEndsACalibration) {
  keeper_.start();
  device_.isCalibrated = false;
  device_.calibrationBlocks = true;
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] { return device_.calibrations == 1; }));
  tick_.control().stop();
  tick_.control().rearm();  // another person, at once
  EXPECT_TRUE(eventually([&] {
    return keeper_.poll(1000 * kMs) == "not calibrated; the last calibration failed: a person stopped it";
  }));
}

TEST_P(KeeperTest, AStopThatStandsPreventsACalibration) {
  keeper_.start();
  device_.isCalibrated = false;
  tick_.control().stop();
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] {
    return keeper_.poll(1000 * kMs) ==
           "not calibrated; the last calibration failed: the forces were stopped before it began";
  }));
  EXPECT_EQ(device_.calibrations, 0);
}

// In a process without rights, whichever this one has.
class WithoutRights : public KeeperTest {
 protected:
  static void giveUpRights() {
    const rlimit none{0, 0};
    setrlimit(RLIMIT_RTPRIO, &none);
    setrlimit(RLIMIT_MEMLOCK, &none);
    __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
    const __user_cap_data_struct data[_LINUX_CAPABILITY_U32S_3]{};
    syscall(SYS_capset, &header, data);
  }
  // Ends the process: 0 when the loop starts, 1 when it is refused with the remedy.
  void start(const DeviceKeeperOptions& options) {
    giveUpRights();
    DeviceKeeper keeper(device_, tick_, clock_, options);
    int result = 0;
    try {
      keeper.start();
      keeper.stop();
    } catch (const std::runtime_error& error) {
      result =
          std::string(error.what()).find("--allow-no-rt") != std::string::npos && device_.reads == 0 ? 1 : 2;
    }
    keeper.stop();
    std::_Exit(result);
  }
};

TEST_P(WithoutRights, ALoopThatRequiresThemDoesNotStartWhoeverPacesIt) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(start({.name = "Phantom", .requireRealtime = true}), testing::ExitedWithCode(1), "");
  EXPECT_EXIT(start({.name = "Phantom"}), testing::ExitedWithCode(0), "");
}

TEST_P(KeeperTest, AHangingLoopGivesNoForceAndIsReported) {
  keeper_.start();
  EXPECT_TRUE(loopRuns());
  device_.readBlocks = true;
  EXPECT_TRUE(eventually([&] { return device_.zeroes > 3; }));
  EXPECT_TRUE(eventually([&] {
    return keeper_.poll(clock_.now()) ==
           "the servo loop hangs: no tick has ended for more than 1 s; the watchdog has ended its force; "
           "restart the server if this lasts";
  }));
  device_.readBlocks = false;
  EXPECT_TRUE(eventually([&] { return keeper_.poll(clock_.now()).empty(); }));
  EXPECT_TRUE(loopRuns());
}

TEST_P(KeeperTest, ALoopThatHangsWhileItIsEndedGivesNoForce) {
  keeper_.start();
  EXPECT_TRUE(loopRuns());
  device_.readBlocks = true;
  EXPECT_TRUE(eventually([&] { return device_.zeroes > 0; }));
  std::thread other([&] { keeper_.stop(); });
  int zeroes = device_.zeroes;
  EXPECT_TRUE(eventually([&] { return device_.zeroes > zeroes + 20; }));
  device_.readBlocks = false;
  other.join();
  zeroes = device_.zeroes;
  std::this_thread::sleep_for(40ms);
  EXPECT_EQ(device_.zeroes, zeroes) << "the watchdog has stopped";
}

TEST_P(KeeperTest, AShortLossIsReportedWithoutReopening) {
  keeper_.start();
  device_.isLost = true;
  EXPECT_EQ(keeper_.poll(1000 * kMs), "the cable is out");
  EXPECT_EQ(keeper_.poll(1500 * kMs), "the cable is out");
  device_.isLost = false;
  EXPECT_EQ(keeper_.poll(1600 * kMs), "");
  device_.isLost = true;  // a new loss starts a new interval
  EXPECT_EQ(keeper_.poll(1700 * kMs), "the cable is out");
  EXPECT_EQ(keeper_.poll(2200 * kMs), "the cable is out");
  EXPECT_EQ(device_.opens + device_.closes, 0);
  EXPECT_TRUE(loopRuns());
}

TEST_P(KeeperTest, ReopensALostDeviceWhileNoLoopRuns) {
  keeper_.start();
  EXPECT_TRUE(loopRuns());
  device_.openBlocks = true;
  loseAt(1000 * kMs);
  EXPECT_TRUE(eventually([&] { return device_.opens == 1; }));
  EXPECT_EQ(device_.closes, 1);
  EXPECT_EQ(keeper_.poll(1600 * kMs), "the device is being reopened");
  EXPECT_EQ(keeper_.poll(60'000 * kMs), "the device is being reopened") << "while the attempt runs";
  expectNoLoop();
  device_.openBlocks = false;
  EXPECT_EQ(faultAt(60'001 * kMs), "");
  EXPECT_TRUE(loopRuns());
  EXPECT_EQ(device_.opens, 1);
}

TEST_P(KeeperTest, ReportsAFailureToOpenAndRetriesEveryTwoSeconds) {
  keeper_.start();
  device_.refuse("no arm on this machine; plug it in");
  loseAt(1000 * kMs);
  const auto refused =
      AllOf(HasSubstr("does not open: no arm on this machine; plug it in"), HasSubstr("every 2 s"));
  Nanos now = 2000 * kMs;
  EXPECT_THAT(faultAt(now), refused);
  for (int attempts = 1; attempts < 4; ++attempts) {
    EXPECT_EQ(device_.opens, attempts);
    EXPECT_EQ(device_.closes, 2 * attempts) << "before each attempt and after its failure";
    EXPECT_THAT(keeper_.poll(now + 1999 * kMs), refused);
    EXPECT_EQ(device_.opens, attempts);
    now += 2000 * kMs;
    EXPECT_THAT(keeper_.poll(now), refused) << "the old error stays until the new attempt ends";
    EXPECT_THAT(faultAt(now), refused);
    EXPECT_TRUE(keeper_.isClosed());
  }
  expectNoLoop();
  device_.refuse("");
  keeper_.poll(now + 2000 * kMs);
  EXPECT_EQ(faultAt(now + 2001 * kMs), "");
  EXPECT_TRUE(loopRuns());
  EXPECT_FALSE(keeper_.isClosed());
  EXPECT_EQ(device_.opens, 5);
}

TEST_P(KeeperTest, ANewFailureReplacesTheText) {
  keeper_.start();
  device_.refuse("no power");
  loseAt(1000 * kMs);
  EXPECT_THAT(faultAt(2000 * kMs), HasSubstr("no power"));
  device_.refuse("no permission");
  keeper_.poll(4000 * kMs);
  EXPECT_THAT(faultAt(4001 * kMs), AllOf(HasSubstr("no permission"), testing::Not(HasSubstr("no power"))));
}

TEST_P(KeeperTest, ReopensRepeatedly) {
  keeper_.start();
  for (int time = 1; time <= 3; ++time) {
    loseAt(time * 10'000 * kMs);
    EXPECT_EQ(faultAt(time * 10'000 * kMs + 600 * kMs), "");
    EXPECT_EQ(device_.opens, time);
    EXPECT_TRUE(loopRuns());
  }
}

TEST_P(KeeperTest, StopWaitsForADriverThatCannotBeInterruptedAndEndsItsLoop) {
  keeper_.start();
  device_.canBeInterrupted = false;
  device_.openBlocks = true;
  loseAt(1000 * kMs);
  EXPECT_TRUE(eventually([&] { return device_.opens == 1; }));
  std::atomic<bool> stopped{false};
  std::thread other([&] {
    keeper_.stop();
    stopped = true;
  });
  std::this_thread::sleep_for(20ms);
  EXPECT_FALSE(stopped) << "the driver is still opening the device";
  device_.openBlocks = false;
  other.join();
  EXPECT_TRUE(device_.isOpen) << "its owner closes it";
  expectNoLoop();
  EXPECT_EQ(device_.opens, 1);
}

TEST_P(KeeperTest, StopLeavesADeviceThatFailedToOpenClosed) {
  keeper_.start();
  device_.refuse("no power");
  loseAt(1000 * kMs);
  EXPECT_THAT(faultAt(2000 * kMs), HasSubstr("no power"));
  keeper_.stop();
  EXPECT_FALSE(device_.isOpen);
  EXPECT_EQ(device_.opens, 1);
  expectNoLoop();
}

TEST_P(KeeperTest, EndingInterruptsAnOpening) {
  keeper_.start();
  device_.openBlocks = true;
  loseAt(1000 * kMs);
  EXPECT_TRUE(eventually([&] { return device_.opens == 1; }));
  keeper_.stop();
  EXPECT_FALSE(device_.isOpen);
  expectNoLoop();
}

TEST_P(KeeperTest, EndingInterruptsACalibration) {
  keeper_.start();
  device_.calibrationBlocks = true;
  keeper_.calibrate();
  EXPECT_TRUE(eventually([&] { return device_.calibrations == 1; }));
  keeper_.stop();
  expectNoLoop();
}

TEST_P(KeeperTest, NoDeviceIsOpenedAfterTheEndHasBegun) {
  keeper_.start();
  device_.closeBlocks = true;
  loseAt(1000 * kMs);
  EXPECT_TRUE(eventually([&] { return device_.closes == 1; }));
  std::thread ending([&] { keeper_.stop(); });
  EXPECT_TRUE(eventually([&] { return device_.isInterrupted.load(); }));
  device_.closeBlocks = false;
  ending.join();
  EXPECT_EQ(device_.opens, 0);
  EXPECT_FALSE(device_.isOpen);
}

INSTANTIATE_TEST_SUITE_P(Loop, WithoutRights, testing::Bool(),
                         [](const auto& instance) { return instance.param ? "SelfPaced" : "Paced"; });
INSTANTIATE_TEST_SUITE_P(Loop, KeeperTest, testing::Bool(), [](const auto& instance) {
  return std::string(instance.param ? "OfTheDevice" : "OfTheServer");
});

class SelfPacedKeeperTest : public KeeperTest {};

TEST_P(SelfPacedKeeperTest, ALoopThatNeverTicksIsReported) {
  device_.ticksNever = true;
  keeper_.start();
  EXPECT_TRUE(eventually(
      [&] { return keeper_.poll(0).find("no tick has come since it began") != std::string::npos; }));
  device_.ticksNever = false;
  EXPECT_TRUE(eventually([&] { return keeper_.poll(0).empty(); }));
}

TEST_P(SelfPacedKeeperTest, ALoopThatDoesNotStartIsAFailureToOpen) {
  keeper_.start();
  device_.startFails = true;
  loseAt(1000 * kMs);
  EXPECT_THAT(faultAt(2000 * kMs), HasSubstr("does not open: the scheduler is refused"));
  EXPECT_FALSE(device_.isOpen) << "a failed attempt closes the device";
  device_.startFails = false;
  keeper_.poll(4000 * kMs);
  EXPECT_EQ(faultAt(4001 * kMs), "");
  EXPECT_TRUE(loopRuns());
}

INSTANTIATE_TEST_SUITE_P(Loop, SelfPacedKeeperTest, testing::Values(true),
                         [](const auto&) { return std::string("OfTheDevice"); });

}  // namespace
}  // namespace hapticd::server
