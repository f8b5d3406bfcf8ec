// Threads of the operating system. No test depends on how fast they run.
#include "base/thread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/resource.h>

#include <array>
#include <atomic>
#include <optional>
#include <semaphore>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "base/world.h"

namespace hapticd::base {
namespace {

constexpr Nanos kMs = 1'000'000;

// A step that counts itself and lets a test wait for it.
struct Counted {
  std::atomic<int> steps{0};

  std::optional<Nanos> operator()() {
    ++steps;
    steps.notify_all();
    return std::nullopt;
  }
  void waitFor(int count) const {
    for (int seen = steps; seen < count; seen = steps) steps.wait(seen);
  }
  Step step() {
    return [this] { return (*this)(); };
  }
};

TEST(Thread, RunsAStepAtTheStart) {
  Counted counted;
  Thread thread({"start"}, counted.step());
  EXPECT_TRUE(thread.running());
  counted.waitFor(1);
}

TEST(Thread, RunsAStepAfterAWake) {
  Counted counted;
  Thread thread({"wake"}, counted.step());
  counted.waitFor(1);
  thread.wake();
  counted.waitFor(2);
  thread.wake();
  counted.waitFor(3);
}

TEST(Thread, AWakeBetweenTwoStepsIsNotLost) {
  std::binary_semaphore inStep{0};
  std::binary_semaphore go{0};
  std::atomic<int> steps{0};
  Thread thread({"not lost"}, [&]() -> std::optional<Nanos> {
    if (++steps == 1) {
      inStep.release();
      go.acquire();
    }
    steps.notify_all();
    return std::nullopt;
  });
  inStep.acquire();
  thread.wake();  // while the step runs
  go.release();
  for (int seen = steps; seen < 2; seen = steps) steps.wait(seen);
}

TEST(Thread, ManyWakesMakeOneStep) {
  std::binary_semaphore inStep{0};
  std::binary_semaphore go{0};
  std::binary_semaphore done{0};
  int steps = 0;
  Nanos deadline = 0;
  Nanos third = 0;
  Thread thread({"coalesce"}, [&]() -> std::optional<Nanos> {
    switch (++steps) {
      case 1:
        inStep.release();
        go.acquire();
        return std::nullopt;
      case 2:
        deadline = now() + 20 * kMs;
        return deadline;
      case 3:
        third = now();
        done.release();
        return std::nullopt;
      default:
        return std::nullopt;
    }
  });
  inStep.acquire();
  for (int i = 0; i < 10; ++i) thread.wake();
  go.release();
  done.acquire();
  EXPECT_GE(third, deadline) << "the third step came from a wake, not from the deadline of the second";
  thread.stop();
}

TEST(Thread, RunsAStepAtTheDeadlineOrLater) {
  std::vector<Nanos> started;
  std::vector<Nanos> deadlines;
  std::binary_semaphore done{0};
  Thread thread({"deadline"}, [&]() -> std::optional<Nanos> {
    started.push_back(now());
    if (started.size() == 4) done.release();
    if (started.size() >= 4) return std::nullopt;
    deadlines.push_back(now() + kMs);
    return deadlines.back();
  });
  done.acquire();
  thread.stop();
  for (std::size_t i = 0; i < deadlines.size(); ++i) EXPECT_GE(started[i + 1], deadlines[i]);
}

TEST(Thread, ADeadlineThatHasPassedIsDueAtOnce) {
  Counted counted;
  Thread thread({"past"}, [&]() -> std::optional<Nanos> {
    counted();
    return counted.steps < 3 ? std::optional<Nanos>(0) : std::nullopt;
  });
  counted.waitFor(3);
}

TEST(Thread, StopRunsOneLastStepAndIsIdempotent) {
  Counted counted;
  Thread thread({"stop"}, counted.step());
  counted.waitFor(1);
  thread.stop();
  EXPECT_EQ(counted.steps, 2);
  EXPECT_FALSE(thread.running());
  thread.stop();
  thread.wake();
  EXPECT_EQ(counted.steps, 2);
}

TEST(Thread, TheLastStepSeesWhatWasDoneBeforeStop) {
  int value = 0;  // no atomic: stop() orders both threads
  int seen = 0;
  Counted counted;
  Thread thread({"last"}, [&] {
    if (counted.steps > 0) seen = value;
    return counted();
  });
  counted.waitFor(1);
  value = 42;
  thread.stop();
  EXPECT_EQ(seen, 42);
}

TEST(Thread, StopBeforeTheFirstStepRunsTheFirstAndTheLast) {
  for (int i = 0; i < 50; ++i) {
    Counted counted;
    Thread({"short"}, counted.step()).stop();
    EXPECT_EQ(counted.steps, 2);
  }
}

TEST(Thread, DestructionStops) {
  Counted counted;
  {
    const Thread thread({"scope"}, counted.step());
    counted.waitFor(1);
  }
  EXPECT_EQ(counted.steps, 2);
}

TEST(Thread, MoveAssignmentStopsTheOldOneFirst) {
  std::atomic<bool> oldHasEnded{false};
  Counted old;
  Counted fresh;
  Thread thread({"old"}, [&] {
    if (old.steps == 1) oldHasEnded = true;
    return old();
  });
  old.waitFor(1);
  Thread other({"new"}, fresh.step());
  thread = std::move(other);
  EXPECT_TRUE(oldHasEnded);
  EXPECT_EQ(old.steps, 2);
  EXPECT_TRUE(thread.running());
  EXPECT_FALSE(other.running());  // NOLINT(bugprone-use-after-move): states what a move leaves
  fresh.waitFor(1);
  thread.wake();
  fresh.waitFor(2);
  thread.stop();
  EXPECT_EQ(old.steps, 2);
}

TEST(Thread, AnEmptyOneCanBeWokenAndStopped) {
  Thread thread;
  EXPECT_FALSE(thread.running());
  thread.wake();
  thread.stop();
}

std::string nameOfThisThread() {
  std::array<char, 16> name{};
  pthread_getname_np(pthread_self(), name.data(), name.size());
  return name.data();
}

TEST(Thread, HasItsNameAndNiceness) {
  std::string name;
  int niceness = -1;
  Thread thread({"a name of more than 15 bytes", 3}, [&] {
    name = nameOfThisThread();
    niceness = getpriority(PRIO_PROCESS, 0);
    return std::nullopt;
  });
  thread.stop();
  EXPECT_EQ(name, "a name of more ");
  EXPECT_EQ(niceness, 3);
  EXPECT_NE(getpriority(PRIO_PROCESS, 0), 3) << "the niceness of other threads stays";
}

TEST(Thread, WakesFromManyThreadsAllCount) {
  // Each waker publishes a value before its wake; a step after the last wake sees all of them.
  std::array<std::atomic<int>, 4> published{};
  std::atomic<int> sum{0};
  Thread thread({"many"}, [&] {
    int now = 0;
    for (const auto& value : published) now += value;
    sum = now;
    sum.notify_all();
    return std::nullopt;
  });
  std::vector<std::thread> wakers;
  for (auto& value : published) {
    wakers.emplace_back([&value, &thread] {
      for (int i = 1; i <= 500; ++i) {
        value = i;
        thread.wake();
      }
    });
  }
  for (std::thread& waker : wakers) waker.join();
  for (int seen = sum; seen < 2000; seen = sum) sum.wait(seen);
  EXPECT_EQ(sum, 2000);
}

TEST(PacedThread, StepsUntilAStepReturnsNoDeadlineAndSleepsInBetween) {
  MonotonicClock clock;
  std::vector<Nanos> deadlines;
  std::vector<Nanos> begins;
  std::string name;
  PacedThread thread({"servo"}, clock, [&]() -> std::optional<Nanos> {
    name = nameOfThisThread();
    begins.push_back(clock.now());
    if (begins.size() == 4) return std::nullopt;
    deadlines.push_back(begins.back() + kMs);
    return deadlines.back();
  });
  EXPECT_TRUE(thread.running());
  thread.join();
  EXPECT_FALSE(thread.running());
  ASSERT_EQ(begins.size(), 4U);
  for (std::size_t i = 0; i < deadlines.size(); ++i) EXPECT_GE(begins[i + 1], deadlines[i]);
  EXPECT_EQ(name, "servo");
  EXPECT_FALSE(world().threads.simulated());
}

TEST(BlockingThread, RunsItsBodyAndJoins) {
  std::binary_semaphore end{0};
  std::atomic<bool> ended{false};
  std::string name;
  BlockingThread thread({"vendor"}, [&] {
    name = nameOfThisThread();
    end.acquire();
    ended = true;
  });
  EXPECT_TRUE(thread.running());
  EXPECT_FALSE(ended);
  end.release();
  thread.join();
  EXPECT_TRUE(ended);
  EXPECT_EQ(name, "vendor");
  EXPECT_FALSE(thread.running());
  thread.join();
}

TEST(BlockingThread, DestructionAndMoveWaitForTheBody) {
  std::atomic<int> ended{0};
  const auto body = [&] {
    sleepFor(kMs);
    ++ended;
  };
  { const BlockingThread thread({"scope"}, body); }
  EXPECT_EQ(ended, 1);
  BlockingThread thread({"old"}, body);
  thread = BlockingThread({"new"}, body);
  EXPECT_GE(ended, 2) << "the old one has ended";
  thread.join();
  EXPECT_EQ(ended, 3);
}

TEST(BlockingThread, ADetachedOneIsNotWaitedFor) {
  struct Shared {
    std::binary_semaphore end{0};
    std::binary_semaphore ended{0};
  };
  const auto shared = std::make_shared<Shared>();
  {
    BlockingThread thread({"long"}, [shared] {
      shared->end.acquire();
      shared->ended.release();
    });
    thread.detach();
    EXPECT_FALSE(thread.running());
    thread.detach();
  }
  shared->end.release();
  shared->ended.acquire();
}

// A stack that no machine has: the kernel answers as to a lack of memory or processes.
TEST(SystemThreads, ARefusalNamesTheThreadAndTheRemedy) {
  pthread_attr_t usual;
  ASSERT_EQ(pthread_getattr_default_np(&usual), 0);
  pthread_attr_t huge;
  pthread_attr_init(&huge);
  ASSERT_EQ(pthread_attr_setstacksize(&huge, std::size_t{1} << 50U), 0);
  ASSERT_EQ(pthread_setattr_default_np(&huge), 0);
  std::vector<std::string> errors;
  const auto refused = [&](const auto& start) {
    try {
      start();
    } catch (const std::system_error& error) {
      errors.emplace_back(error.what());
    }
  };
  Counted counted;
  SimulatedClock clock;
  refused([&] { const Thread thread({.name = "first"}, counted.step()); });
  refused([&] { const PacedThread thread({.name = "second"}, clock, counted.step()); });
  refused([] { const BlockingThread thread({.name = "third"}, [] {}); });
  EXPECT_EQ(pthread_setattr_default_np(&usual), 0);
  pthread_attr_destroy(&huge);
  pthread_attr_destroy(&usual);
  const std::string rest =
      "'; raise the limits 'ulimit -u' and 'ulimit -v': Resource temporarily unavailable";
  EXPECT_EQ(errors, (std::vector<std::string>{"cannot start the thread 'first" + rest,
                                              "cannot start the thread 'second" + rest,
                                              "cannot start the thread 'third" + rest}));
}

}  // namespace
}  // namespace hapticd::base
