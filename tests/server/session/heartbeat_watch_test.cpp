#include "server/session/heartbeat_watch.h"

#include <gtest/gtest.h>

namespace hapticd::server {
namespace {

using Verdict = HeartbeatWatch::Verdict;
constexpr base::Nanos kMs = 1'000'000;

TEST(HeartbeatWatchTest, AClientThatPromisedNothingIsNeverLost) {
  HeartbeatWatch watch;
  EXPECT_EQ(watch.check(1'000'000 * kMs), Verdict::alive);
}

TEST(HeartbeatWatchTest, SilenceBeyondTheLimitIsLoss) {
  HeartbeatWatch watch;
  watch.beat(0);
  EXPECT_EQ(watch.check(500 * kMs), Verdict::alive);
  EXPECT_EQ(watch.check(501 * kMs), Verdict::lost);
  watch.beat(502 * kMs);
  EXPECT_EQ(watch.check(1002 * kMs), Verdict::alive);
}

TEST(HeartbeatWatchTest, APromiseCanBeTakenBack) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.forget();
  EXPECT_EQ(watch.check(10'000 * kMs), Verdict::alive);
}

TEST(HeartbeatWatchTest, TheServersOwnPauseIsNotSilenceAndTheLimitCountsFromItsEnd) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(400 * kMs);
  EXPECT_EQ(watch.check(3000 * kMs), Verdict::alive);
  watch.resume(3000 * kMs);
  EXPECT_EQ(watch.check(3500 * kMs), Verdict::alive);
  EXPECT_EQ(watch.check(3501 * kMs), Verdict::lost);
}

TEST(HeartbeatWatchTest, PausesExcuseFiveSecondsInARowAndThatIsReportedOnce) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(0);
  watch.resume(3000 * kMs);
  watch.pause(3100 * kMs);  // no heartbeat in between: the same row
  EXPECT_EQ(watch.check(5100 * kMs), Verdict::alive);
  EXPECT_EQ(watch.check(5101 * kMs), Verdict::excused);
  EXPECT_EQ(watch.check(5200 * kMs), Verdict::alive);
  watch.resume(5300 * kMs);
  EXPECT_EQ(watch.check(5400 * kMs), Verdict::alive) << "the connection stays";
}

TEST(HeartbeatWatchTest, AHeartbeatBeginsANewRowOfPauses) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(0);
  watch.resume(4000 * kMs);
  watch.beat(4001 * kMs);
  watch.pause(4002 * kMs);
  EXPECT_EQ(watch.check(9002 * kMs), Verdict::alive);
  EXPECT_EQ(watch.check(9003 * kMs), Verdict::excused);
}

TEST(HeartbeatWatchTest, PausingTwiceCountsOnce) {
  HeartbeatWatch watch;
  watch.beat(0);
  watch.pause(0);
  watch.pause(4000 * kMs);
  EXPECT_EQ(watch.check(5001 * kMs), Verdict::excused);
}

}  // namespace
}  // namespace hapticd::server
