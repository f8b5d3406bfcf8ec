#include "base/clock.h"

#include <gtest/gtest.h>

#include "base/world.h"

namespace hapticd::base {
namespace {

constexpr Nanos kYear2020 = 1'577'836'800'000'000'000;

TEST(Time, ConvertsBothWays) {
  EXPECT_EQ(toNanos(1.5), 1'500'000'000);
  EXPECT_EQ(toNanos(1e-9), 1);
  EXPECT_EQ(toNanos(-0.25), -250'000'000);
  EXPECT_EQ(toNanos(2.6e-9), 3);
  EXPECT_EQ(toNanos(-2.6e-9), -3);
  EXPECT_DOUBLE_EQ(toSeconds(250'000'000), 0.25);
}

TEST(MonotonicClock, NeverGoesBack) {
  MonotonicClock clock;
  Nanos last = clock.now();
  for (int i = 0; i < 1000; ++i) {
    const Nanos next = clock.now();
    ASSERT_GE(next, last);
    last = next;
  }
  EXPECT_GT(clock.wallNow(), kYear2020);
}

TEST(MonotonicClock, SleepsUntilTheDeadlineOrLater) {
  MonotonicClock clock;
  const Nanos deadline = clock.now() + 2'000'000;
  clock.sleepUntil(deadline);
  EXPECT_GE(clock.now(), deadline);
  clock.sleepUntil(deadline - 1'000'000);  // has passed
  clock.sleepUntil(0);
}

TEST(SimulatedClock, MovesOnlyBySleeping) {
  SimulatedClock clock;
  EXPECT_EQ(clock.now(), 0);
  EXPECT_EQ(clock.now(), 0);
  clock.sleepUntil(7);
  EXPECT_EQ(clock.now(), 7);
  clock.sleepUntil(3);
  EXPECT_EQ(clock.now(), 7);
}

TEST(SimulatedClock, KeepsAWallClockThatCanBeSet) {
  SimulatedClock clock(1000);
  EXPECT_EQ(clock.wallNow(), 1000);
  clock.sleepUntil(50);
  EXPECT_EQ(clock.wallNow(), 1050);
  clock.setWall(500);
  EXPECT_EQ(clock.wallNow(), 500);
  EXPECT_EQ(clock.now(), 50) << "the servo clock does not jump with the wall clock";
  clock.sleepUntil(60);
  EXPECT_EQ(clock.wallNow(), 510);
}

TEST(ScopedWorld, IsTheWorldWhileItLives) {
  SimulatedClock clock(1000);
  SystemThreads threads;
  SystemFiles files;
  SystemRandom random;
  clock.sleepUntil(42);
  {
    const ScopedWorld scope(World{clock, threads, files, random});
    EXPECT_EQ(now(), 42);
    EXPECT_EQ(wallNow(), 1042);
    sleepFor(8);
    EXPECT_EQ(clock.now(), 50);
    EXPECT_EQ(&world().files, &files);
  }
  EXPECT_NE(&world().clock, &clock);
  EXPECT_GT(wallNow(), kYear2020);
}

TEST(SystemRandom, GivesDifferentNumbers) {
  SystemRandom random;
  EXPECT_NE(random.next(), random.next());
}

}  // namespace
}  // namespace hapticd::base
