// The paced thread: exact behaviour with a scripted clock, robustness with the real one.
#include "realtime/servo/servo_thread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

#include "realtime/servo/fakes.h"
#include "realtime/servo/tick.h"

namespace hapticd::realtime {
namespace {

constexpr Nanos kMs = 1'000'000;

ServoThreadOptions modest() {
  ServoThreadOptions options;
  options.request.realtime = false;
  options.request.lockMemory = false;
  return options;
}

// Runs `count` ticks and gives their pacing. The tick itself takes `work`.
std::vector<Pacing> runTicks(FakeClock& clock, std::size_t count, double rate_Hz = 1000, Nanos work = 0) {
  std::vector<Pacing> seen;
  std::atomic<bool> done{false};
  ServoThread* self = nullptr;
  ServoThreadOptions options = modest();
  options.rate_Hz = rate_Hz;
  ServoThread thread(
      [&](const Pacing& pacing) {
        seen.push_back(pacing);
        clock.advance(work);
        if (seen.size() < count) return;
        self->requestStop();
        done = true;
        done.notify_one();
      },
      clock, options);
  self = &thread;
  thread.start();
  done.wait(false);
  thread.stop();
  return seen;
}

TEST(ServoThread, TicksOnTheGridAtEveryRate) {
  for (const double rate : {250.0, 1000.0, 4000.0}) {
    FakeClock clock;
    const Nanos start = clock.now();
    const auto seen = runTicks(clock, 50, rate);
    ASSERT_EQ(seen.size(), 50U);
    for (std::size_t i = 0; i < seen.size(); ++i) {
      EXPECT_EQ(seen[i].now - start, static_cast<Nanos>(i + 1) * servoPeriod(rate));
      EXPECT_EQ(seen[i].overruns, 0U);
    }
  }
}

TEST(ServoThread, ALateWakeUpSkipsLostPeriods) {
  FakeClock clock;
  clock.oversleeps = {0, 0, 5'300'000, 100'000};
  const Nanos start = clock.now();
  const auto seen = runTicks(clock, 6);
  const std::vector<Nanos> expected = {1'000'000, 2'000'000, 8'300'000, 9'100'000, 10'000'000, 11'000'000};
  for (std::size_t i = 0; i < seen.size(); ++i) EXPECT_EQ(seen[i].now - start, expected[i]);
  EXPECT_EQ(seen[2].wakeupError, 5'300'000);
  EXPECT_EQ(seen.back().overruns, 1U);
  EXPECT_EQ(seen.back().skippedPeriods, 5U);
}

TEST(ServoThread, TicksThatTakeTooLongLosePeriodsAndNeverPileUp) {
  FakeClock clock;
  const auto seen = runTicks(clock, 20, 1000, 1'700'000);
  for (std::size_t i = 1; i < seen.size();
       ++i) {  // every second period is lost, and leaves time to other threads
    EXPECT_EQ(seen[i].now - seen[i - 1].now, 2 * kMs);
    EXPECT_EQ(seen[i].wakeupError, 0);
    EXPECT_EQ(seen[i].overruns, i);
    EXPECT_EQ(seen[i].skippedPeriods, i);
  }
}

TEST(ServoThread, ReportsWhatTheSystemGranted) {
  FakeClock clock;
  ServoThreadOptions options;
  options.request.cpu = 0;
  ServoThread thread([](const Pacing&) {}, clock, options);
  const ThreadSetup& setup = thread.start();
  thread.stop();
  for (const SetupAnswer* answer : setup.all()) {
    EXPECT_TRUE(answer->asked) << answer->name;
    EXPECT_FALSE(answer->text.empty()) << answer->name;
    EXPECT_EQ(answer->granted, answer->remedy.empty()) << answer->name;
  }
  EXPECT_EQ(setup.granted(), setup.complaints().empty());
}

TEST(ServoThread, ReportsWhatWasNotRequested) {
  FakeClock clock;
  ServoThread thread([](const Pacing&) {}, clock, modest());
  const ThreadSetup& setup = thread.start();
  EXPECT_FALSE(setup.scheduling.asked);
  EXPECT_FALSE(setup.affinity.asked);
  EXPECT_FALSE(setup.memory.asked);
  EXPECT_TRUE(setup.granted());
}

TEST(ServoThread, DoesNotStartWithoutRequiredRealtime) {
  FakeClock clock;
  ServoThreadOptions options = modest();
  options.requireRealtime = true;
  options.request.realtime = true;
  options.request.priority = 1000;  // always refused
  options.request.cpu = 100'000;
  std::atomic<int> ticks{0};
  ServoThread thread([&](const Pacing&) { ++ticks; }, clock, options);
  try {
    thread.start();
    FAIL() << "started";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("priority 1000"));
    EXPECT_THAT(error.what(), testing::HasSubstr("choose a priority from 1 to 99"));
    EXPECT_THAT(error.what(), testing::HasSubstr("CPU 100000 was refused"));
  }
  EXPECT_EQ(ticks, 0);
}

TEST(ServoThread, RefusesRatesOutOfRange) {
  FakeClock clock;
  ServoThreadOptions options = modest();
  options.rate_Hz = 100;
  EXPECT_THROW(ServoThread([](const Pacing&) {}, clock, options), std::invalid_argument);
}

TEST(ServoThread, StopsWithoutHavingStarted) {
  FakeClock clock;
  ServoThread thread([](const Pacing&) {}, clock, modest());
  thread.stop();
  thread.stop();
}

// All threads of a server at once on the real clock: the scene publishes, an operator stops and re-arms, the
// edge sleeps on the wake and reads reports.
TEST(ServoThread, ALoopAmongItsNeighbours) {
  base::MonotonicClock clock;
  FakeDevice device;
  TickOptions tickOptions;
  tickOptions.guard.armed = true;
  tickOptions.reports = 64;
  Tick tick(device, clock, tickOptions);
  ServoThread thread([&](const Pacing& pacing) { tick(pacing); }, clock, modest());
  thread.start();

  constexpr std::uint64_t kTicks = 300;
  std::uint64_t received = 0;
  std::uint64_t newest = 0;
  std::uint64_t revision = 0;
  std::uint64_t dropped = 0;
  bool inOrder = true;
  std::atomic<bool> done{false};
  std::thread operators([&] {
    while (!done) {
      tick.control().stop();
      std::this_thread::yield();
      tick.control().rearm();
      tick.histograms().period.copy();
      tick.blackBox().take();
    }
    tick.control().stop();
  });
  std::uint64_t published = 0;
  while (newest < kTicks || revision == 0) {
    tick.snapshots().publish(constantForce(++published, Vec3(0, 1, 0)));
    tick.wake().drain();
    received += tick.reports().consume([&](const TickReport& report) {
      inOrder &= report.tick > newest && report.revision >= revision && report.revision <= published;
      newest = report.tick;
      revision = report.revision;
      dropped = report.dropped;
    });
    std::this_thread::yield();
  }
  done = true;
  operators.join();
  thread.stop();
  EXPECT_TRUE(inOrder);
  EXPECT_EQ(received + dropped, newest);
  tick.finish();
  EXPECT_EQ(device.written_N, Vec3::Zero());
}

TEST(ThreadSetup, AThreadOfAVendorLibraryKeepsItsScheduling) {
  std::thread([] {
    const int before = sched_getscheduler(0);
    const ThreadSetup setup = setUpThread({.keepScheduling = true, .lockMemory = false});
    EXPECT_EQ(sched_getscheduler(0), before);
    EXPECT_TRUE(setup.scheduling.asked);
    EXPECT_EQ(setup.scheduling.granted, before == SCHED_FIFO || before == SCHED_RR);
    EXPECT_EQ(setup.scheduling.remedy.empty(), setup.scheduling.granted);
    EXPECT_FALSE(setup.stack.asked);
  }).join();
}

// struct sched_attr: size and policy, flags, niceness and priority, slice, deadline, period.
using SchedulingAttributes = std::array<std::uint64_t, 6>;

SchedulingAttributes attributesOfThisThread() {
  SchedulingAttributes attributes{};
  EXPECT_EQ(syscall(SYS_sched_getattr, 0, attributes.data(), sizeof attributes, 0U), 0);
  return attributes;
}

// Linux before 6.12 and some containers refuse the request.
bool sliceCanBeChosen() {
  constexpr std::uint64_t kSlice_ns = 200'000;
  SchedulingAttributes wanted = attributesOfThisThread();
  wanted[3] = kSlice_ns;
  return syscall(SYS_sched_setattr, 0, wanted.data(), 0U) == 0 && attributesOfThisThread()[3] == kSlice_ns;
}

TEST(ThreadSetup, AStackThatIsTooSmallIsAComplaintAndNoCrash) {
  pthread_attr_t small;
  pthread_attr_init(&small);
  ASSERT_EQ(pthread_attr_setstacksize(&small, 256 * 1024), 0);
  ThreadSetup setup;
  const auto body = [](void* result) -> void* {
    *static_cast<ThreadSetup*>(result) = setUpThread({.realtime = false, .lockMemory = false});
    return nullptr;
  };
  pthread_t thread{};
  ASSERT_EQ(pthread_create(&thread, &small, body, &setup), 0);
  pthread_join(thread, nullptr);
  pthread_attr_destroy(&small);
  EXPECT_TRUE(setup.stack.asked);
  EXPECT_FALSE(setup.stack.granted);
  EXPECT_NE(setup.complaints().find("stack: only 256 kB of stack"), std::string::npos) << setup.complaints();
  EXPECT_NE(setup.complaints().find("ulimit -s 8192"), std::string::npos);
}

TEST(ThreadSetup, AShortSliceChangesNeitherPolicyNorNiceness) {
  std::thread([] {
    setpriority(PRIO_PROCESS, 0, 3);
    const bool canBeChosen = sliceCanBeChosen();
    requestShortTimeSlice();
    EXPECT_EQ(sched_getscheduler(0) & ~SCHED_RESET_ON_FORK, SCHED_OTHER);
    EXPECT_EQ(getpriority(PRIO_PROCESS, 0), 3);
    if (canBeChosen) {
      EXPECT_EQ(attributesOfThisThread()[3], 100'000U);
    }
    std::thread([] { EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER); }).join();
  }).join();
}

}  // namespace
}  // namespace hapticd::realtime
