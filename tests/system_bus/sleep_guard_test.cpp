#include "system_bus/sleep_guard.h"

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <optional>
#include <set>
#include <string>
#include <thread>

#include "base/world.h"
#include "system_bus/bus.h"
#include "system_bus/scripted_logind.h"

namespace hapticd::system_bus {
namespace {

using test::ScriptedLogind;
using Modes = std::set<std::string>;

// A server's forces: a stop takes a moment, and must be over before the lock is given back.
class SleepGuardTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!bus_.runs()) GTEST_SKIP() << "dbus-daemon is missing (packages.txt, section test)";
  }
  void TearDown() override { guard_.reset(); }
  void guard() {
    guard_.emplace([this] { return armed_.load(); },
                   [this] {
                     std::this_thread::sleep_for(std::chrono::milliseconds(20));
                     armed_ = false;
                     ++stops_;
                   });
  }

  test::PrivateBus bus_;
  std::atomic<bool> armed_{true};
  std::atomic<int> stops_{0};
  std::optional<SleepGuard> guard_;
};

TEST_F(SleepGuardTest, KeepsTheMachineAwakeWhileForcesAreArmed) {
  ScriptedLogind logind;
  guard();
  ASSERT_TRUE(logind.waitHeld({"block", "delay"}));
  EXPECT_EQ(logind.lastRequest(), "sleep hapticd");
  armed_ = false;
  ASSERT_TRUE(logind.waitHeld({}));
  armed_ = true;
  ASSERT_TRUE(logind.waitHeld({"block", "delay"}));
  EXPECT_EQ(stops_, 0);
  guard_.reset();
  EXPECT_TRUE(logind.waitHeld({}));
}

// As for a service, unless polkit says otherwise; or when the lid is closed.
TEST_F(SleepGuardTest, ForcesEndBeforeASleepThatItMustLetHappen) {
  ScriptedLogind logind({"block"});
  guard();
  for (int night = 1; night <= 3; ++night) {
    armed_ = true;
    ASSERT_TRUE(logind.waitHeld({"delay"}));
    logind.announceSleep(true);
    ASSERT_TRUE(logind.waitHeld({}));
    EXPECT_EQ(stops_, night) << "before the lock was given back";
    logind.announceSleep(false);
  }
}

// Moves when the test moves it.
class MovedClock final : public base::Clock {
 public:
  base::Nanos now() noexcept override { return now_; }
  void sleepUntil(base::Nanos deadline) noexcept override { base::MonotonicClock().sleepUntil(deadline); }
  base::Nanos wallNow() noexcept override { return now_; }
  void advance(base::Nanos by) noexcept { now_ += by; }

 private:
  std::atomic<base::Nanos> now_{1};
};

// A person allows it while forces are armed.
TEST_F(SleepGuardTest, AsksAgainForALockThatWasRefused) {
  MovedClock clock;
  const base::World& world = base::world();
  const base::ScopedWorld scoped({clock, world.threads, world.files, world.random});
  ScriptedLogind logind({"block"});
  guard();
  ASSERT_TRUE(logind.waitHeld({"delay"}));
  ASSERT_TRUE(logind.waitRefusals(1));
  clock.advance(10'000'000'001);
  ASSERT_TRUE(logind.waitRefusals(2));
  logind.refuseNothing();
  clock.advance(10'000'000'001);
  EXPECT_TRUE(logind.waitHeld({"block", "delay"}));
  guard_.reset();
}

TEST_F(SleepGuardTest, NothingIsHeldWhileTheMachineSleeps) {
  ScriptedLogind logind;
  guard();
  ASSERT_TRUE(logind.waitHeld({"block", "delay"}));
  logind.announceSleep(true);
  ASSERT_TRUE(logind.waitHeld({}));
  armed_ = true;  // a client re-arms in the last moment
  std::this_thread::sleep_for(std::chrono::milliseconds(600));
  EXPECT_TRUE(logind.waitHeld({}));
  logind.announceSleep(false);
  EXPECT_TRUE(logind.waitHeld({"block", "delay"}));
}

TEST_F(SleepGuardTest, AsksAgainWhenLogindOrTheBusRestarts) {
  guard();  // before any logind
  for (int start = 0; start < 2; ++start) {
    ScriptedLogind logind;
    ASSERT_TRUE(logind.waitHeld({"block", "delay"})) << start;
  }
  bus_.restart();
  ScriptedLogind logind;
  EXPECT_TRUE(logind.waitHeld({"block", "delay"}));
}

TEST(SleepGuardWithoutABus, EndsAtOnce) {
  ::setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere/bus", 1);
  {
    SleepGuard guard([] { return true; }, [] {});
  }
  ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
}

// It accepts and says nothing.
class SilentBus : public ::testing::Test {
 protected:
  SilentBus()
      : path_(std::filesystem::temp_directory_path() / ("silent_bus_" + std::to_string(::getpid()))),
        listener_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path_.c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listener_, 8), 0);
    ::setenv("DBUS_SYSTEM_BUS_ADDRESS", ("unix:path=" + path_.string()).c_str(), 1);
  }
  ~SilentBus() override {
    ::unsetenv("DBUS_SYSTEM_BUS_ADDRESS");
    ::close(listener_);
    std::filesystem::remove(path_);
  }

 private:
  std::filesystem::path path_;
  int listener_;
};

TEST_F(SilentBus, IsGivenUp) {
  EXPECT_THROW(Bus{kNoFd}, Unavailable);
}

TEST_F(SilentBus, HoldsNobodyUpWhoIsWokenMeanwhile) {
  const int wake = ::eventfd(1, EFD_CLOEXEC);
  {
    Bus bus(wake);  // throws if it waits until the end
    EXPECT_THROW(bus.onOwnerChange(
                     "org.example", [](auto*, auto*, auto*) { return 0; }, nullptr),
                 Unavailable);
  }
  ::close(wake);
}

}  // namespace
}  // namespace hapticd::system_bus
