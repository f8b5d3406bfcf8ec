#include "server/session/heartbeat_watch.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

using Verdict = HeartbeatWatch::Verdict;
constexpr base::Nanos kMillisecond = 1'000'000;

TEST(HeartbeatWatchTest, AClientThatDidNotOptInIsNeverLost) {
  HeartbeatWatch watch;
  EXPECT_EQ(watch.check(1'000'000 * kMillisecond), Verdict::alive);
}

TEST(HeartbeatWatchTest, SilenceBeyondTheLimitIsLoss) {
  HeartbeatWatch watch;
  watch.beat(0);
  EXPECT_EQ(watch.check(500 * kMillisecond), Verdict::alive);
  EXPECT_EQ(watch.check(501 * kMillisecond), Verdict::lost);
  watch.beat(502 * kMillisecond);
  EXPECT_EQ(watch.check(1002 * kMillisecond), Verdict::alive);
}

TEST(HeartbeatWatchTest, OtherDataExcusesFiveSecondsInTotal) {
  HeartbeatWatch watch;
  watch.beat(0);
  base::Nanos now = 0;
  for (; now <= 5000 * kMillisecond; now += 100 * kMillisecond) {
    watch.receive(now);
    ASSERT_EQ(watch.check(now), Verdict::alive) << now;
  }
  watch.receive(now);
  EXPECT_EQ(watch.check(now), Verdict::excused);
  EXPECT_EQ(watch.check(now + 500 * kMillisecond), Verdict::alive) << "the connection stays";
  EXPECT_EQ(watch.check(now + 501 * kMillisecond), Verdict::lost) << "unless it is silent";
}

// A client that sends data and no heartbeat may begin new effects: they end, too.
TEST(HeartbeatWatchTest, WithoutAHeartbeatForcesEndAgainAndAgain) {
  HeartbeatWatch watch;
  watch.beat(0);
  int ended = 0;
  for (base::Nanos now = 0; now <= 10'000 * kMillisecond; now += 50 * kMillisecond) {
    watch.receive(now);
    const Verdict verdict = watch.check(now);
    ASSERT_NE(verdict, Verdict::lost) << now;
    ended += verdict == Verdict::excused ? 1 : 0;
  }
  EXPECT_EQ(ended, 10) << "every 550 ms from 5050 ms on";
  EXPECT_TRUE(watch.beat(10'000 * kMillisecond)) << "they may return";
  EXPECT_FALSE(watch.beat(10'000 * kMillisecond));
  EXPECT_EQ(watch.check(10'500 * kMillisecond), Verdict::alive);
}

TEST(HeartbeatWatchTest, AHeartbeatRenewsTheExcuseOfOtherData) {
  HeartbeatWatch watch;
  watch.beat(0);
  for (base::Nanos now = 0; now <= 12'000 * kMillisecond; now += 250 * kMillisecond) {
    watch.receive(now);
    if (now % (4000 * kMillisecond) == 0) watch.beat(now);
    ASSERT_EQ(watch.check(now), Verdict::alive) << now;
  }
}

TEST(HeartbeatWatchTest, AClientCanOptOut) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.disable();
  EXPECT_EQ(watch.check(10'000 * kMillisecond), Verdict::alive);
}

TEST(HeartbeatWatchTest, APauseOfTheServerIsNotSilenceAndTheLimitCountsFromItsEnd) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(400 * kMillisecond);
  EXPECT_EQ(watch.check(3000 * kMillisecond), Verdict::alive);
  watch.resume(3000 * kMillisecond);
  EXPECT_EQ(watch.check(3500 * kMillisecond), Verdict::alive);
  EXPECT_EQ(watch.check(3501 * kMillisecond), Verdict::lost);
}

TEST(HeartbeatWatchTest, PausesExcuseFiveSecondsInTotal) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(0);
  watch.resume(3000 * kMillisecond);
  watch.pause(3100 * kMillisecond);  // no heartbeat in between: the pauses add up
  EXPECT_EQ(watch.check(5100 * kMillisecond), Verdict::alive);
  EXPECT_EQ(watch.check(5101 * kMillisecond), Verdict::excused);
  EXPECT_EQ(watch.check(5200 * kMillisecond), Verdict::alive);
  watch.resume(5300 * kMillisecond);
  EXPECT_EQ(watch.check(5400 * kMillisecond), Verdict::alive) << "the connection stays";
}

TEST(HeartbeatWatchTest, AHeartbeatRenewsTheExcuse) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(0);
  watch.resume(4000 * kMillisecond);
  watch.beat(4001 * kMillisecond);
  watch.pause(4002 * kMillisecond);
  EXPECT_EQ(watch.check(9002 * kMillisecond), Verdict::alive);
  EXPECT_EQ(watch.check(9003 * kMillisecond), Verdict::excused);
}

TEST(HeartbeatWatchTest, PausingTwiceCountsOnce) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(0);
  watch.pause(4000 * kMillisecond);
  EXPECT_EQ(watch.check(5001 * kMillisecond), Verdict::excused);
}

TEST(HeartbeatWatchTest, AStallOfTheServerIsNoSilenceOfTheClient) {
  HeartbeatWatch watch;
  watch.excuseStall(0);
  EXPECT_EQ(watch.check(10 * HeartbeatWatch::kLimit), HeartbeatWatch::Verdict::alive) << "it never opted in";
  watch.beat(0);
  watch.excuseStall(2 * HeartbeatWatch::kLimit);
  EXPECT_EQ(watch.check(3 * HeartbeatWatch::kLimit), HeartbeatWatch::Verdict::alive);
  EXPECT_EQ(watch.check(3 * HeartbeatWatch::kLimit + 1), HeartbeatWatch::Verdict::lost);
}

}  // namespace
}  // namespace hapticd::server
