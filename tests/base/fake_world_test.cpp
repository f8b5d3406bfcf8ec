// The fakes themselves: order and time of steps, seeds. That FakeFiles behaves as SystemFiles is in
// files_test.
#include "base/fake_world.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace hapticd::base {
namespace {

using testing::ElementsAre;

TEST(FakeThreads, RunStepsOnlyWhenTold) {
  FakeWorld world;
  int steps = 0;
  Thread thread({"a"}, [&] { return ++steps, std::nullopt; });
  thread.wake();
  EXPECT_EQ(steps, 0);
  EXPECT_EQ(world.threads.runDue(), 1U) << "the start and the wake make one step";
  EXPECT_FALSE(world.threads.runNext());
  thread.wake();
  thread.wake();
  EXPECT_EQ(world.threads.runDue(), 1U);
  EXPECT_EQ(steps, 2);
}

TEST(FakeThreads, RunInTheOrderInWhichTheyBecameDue) {
  FakeWorld world;
  std::string order;
  const auto named = [&](char name) { return [&order, name] { return order += name, std::nullopt; }; };
  Thread a({"a"}, named('a'));
  Thread b({"b"}, named('b'));
  Thread c({"c"}, named('c'));
  world.threads.runDue();
  EXPECT_EQ(order, "abc");
  EXPECT_THAT(world.threads.names(), ElementsAre("a", "b", "c"));
  c.wake();
  a.wake();
  world.threads.runDue();
  EXPECT_EQ(order, "abcca");
}

TEST(FakeThreads, RunAtTheirDeadlines) {
  FakeWorld world;
  std::vector<Nanos> every3;
  std::vector<Nanos> every5;
  Thread a({"a"}, [&] { return every3.push_back(now()), now() + 3; });
  Thread b({"b"}, [&] { return every5.push_back(now()), now() + 5; });
  EXPECT_EQ(world.threads.nextDeadline(), 0);
  EXPECT_EQ(world.threads.runUntil(10), 7U);
  EXPECT_THAT(every3, ElementsAre(0, 3, 6, 9));
  EXPECT_THAT(every5, ElementsAre(0, 5, 10));
  EXPECT_EQ(now(), 10);
  EXPECT_EQ(world.threads.nextDeadline(), 12);
}

TEST(FakeThreads, AWakeInTheOwnStepMakesOneMoreStep) {
  FakeWorld world;
  int steps = 0;
  Thread thread;
  thread = Thread({"a"}, [&]() -> std::optional<Nanos> {
    if (++steps == 1) thread.wake();
    return 100;
  });
  EXPECT_EQ(world.threads.runDue(), 2U);
  EXPECT_EQ(world.threads.nextDeadline(), 100);
}

TEST(FakeThreads, StopRunsTheStepsOfARealThread) {
  FakeWorld world;
  int steps = 0;
  const auto count = [&] { return ++steps, std::nullopt; };
  Thread fresh({"fresh"}, count);
  fresh.stop();
  EXPECT_EQ(steps, 2) << "the first and the last";
  Thread waiting({"waiting"}, count);
  world.threads.runDue();
  waiting.wake();
  waiting.stop();
  waiting.stop();
  EXPECT_EQ(steps, 4) << "what it was woken for is done in the last step";
  EXPECT_TRUE(world.threads.names().empty());
  EXPECT_EQ(world.threads.nextDeadline(), std::nullopt);
}

TEST(FakeThreads, AStepMayStopAnotherThreadButNotItself) {
  FakeWorld world;
  std::string order;
  Thread victim({"victim"}, [&] { return order += 'v', std::nullopt; });
  Thread killer({"killer"}, [&] { return victim.stop(), order += 'k', std::nullopt; });
  world.threads.runDue();
  EXPECT_EQ(order, "vvk");
  bool first = true;
  Thread own;
  own = Thread({"own"}, [&] {
    if (std::exchange(first, false)) own.stop();
    return std::nullopt;
  });
  EXPECT_THROW(world.threads.runDue(), std::logic_error);
}

TEST(FakeThreads, FindStepsThatNeverEnd) {
  FakeWorld world;
  Thread busy({"busy"}, [] { return now(); });
  EXPECT_THROW(world.threads.runDue(100), std::logic_error);
}

TEST(FakeThreads, AStepRunsNoOtherSteps) {
  FakeWorld world;
  bool first = true;
  Thread nested({"nested"}, [&] {
    if (std::exchange(first, false)) world.threads.runNext();
    return std::nullopt;
  });
  EXPECT_THROW(world.threads.runNext(), std::logic_error);
}

TEST(FakeThreads, ASeedChoosesTheOrder) {
  const auto orderOf = [](std::uint64_t seed) {
    SimulatedClock clock;
    SeededRandom random(seed);
    FakeThreads threads(clock, &random);
    std::string order;
    std::vector<std::unique_ptr<Thread::Impl>> all;
    for (const char name : {'a', 'b', 'c', 'd', 'e', 'f'}) {
      all.push_back(
          threads.start({std::string(1, name)}, [&order, name] { return order += name, std::nullopt; }));
    }
    threads.runDue();
    return std::string(order);  // before the last steps
  };
  EXPECT_EQ(orderOf(7), orderOf(7));
  EXPECT_NE(orderOf(7), orderOf(8));
  std::string sorted = orderOf(7);
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(sorted, "abcdef") << "each step runs once";
}

TEST(FakeThreads, HaveNoBlockingThreads) {
  FakeWorld world;
  EXPECT_THROW(BlockingThread({"vendor"}, [] {}), std::logic_error);
}

TEST(FakeThreads, APacedThreadStepsAtItsDeadlinesUntilAStepReturnsNone) {
  FakeWorld world;
  EXPECT_TRUE(world.threads.simulated());
  std::vector<Nanos> steps;
  bool stopping = false;
  PacedThread thread({"servo"}, world.clock, [&]() -> std::optional<Nanos> {
    steps.push_back(world.clock.now());
    return stopping ? std::nullopt : std::optional(world.clock.now() + 1000);
  });
  EXPECT_THAT(steps, ElementsAre(0)) << "the first step runs at once";
  world.threads.runUntil(2500);
  EXPECT_THAT(steps, ElementsAre(0, 1000, 2000));
  stopping = true;
  world.threads.runUntil(3000);
  world.threads.runUntil(9000);
  EXPECT_THAT(steps, ElementsAre(0, 1000, 2000, 3000));
  thread.join();
  EXPECT_EQ(steps.size(), 4U) << "it has ended";
}

TEST(SimulatedClock, ASuspensionMovesTheWallClockOnly) {
  FakeWorld world;
  const Nanos wall = wallNow();
  world.clock.suspendFor(5000);
  EXPECT_EQ(now(), 0);
  EXPECT_EQ(wallNow(), wall + 5000);
  EXPECT_EQ(suspendedTime(), 5000);
}

TEST(SeededRandom, GivesTheSameNumbersForTheSameSeed) {
  SeededRandom a(1);
  SeededRandom b(1);
  SeededRandom c(2);
  const std::uint64_t first = a.next();
  EXPECT_EQ(b.next(), first);
  EXPECT_NE(c.next(), first);
  EXPECT_NE(a.next(), first);
}

TEST(FakeWorld, TakesThePlaceOfTheMachinesWorldWhileItLives) {
  const Clock* const machine = &base::world().clock;
  {
    FakeWorld world;
    EXPECT_EQ(&base::world().clock, &world.clock);
    EXPECT_EQ(&base::world().files, &world.files);
    EXPECT_EQ(&base::world().threads, &world.threads);
    EXPECT_EQ(&base::world().random, &world.random);
    EXPECT_EQ(now(), 0);
    sleepFor(5);
    EXPECT_EQ(now(), 5);
    EXPECT_EQ(wallNow(), FakeWorld::kWallAtZero + 5);
  }
  EXPECT_EQ(&base::world().clock, machine);
}

}  // namespace
}  // namespace hapticd::base
