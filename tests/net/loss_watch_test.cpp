#include "net/loss_watch.h"

#include <gtest/gtest.h>

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

/// A watch of 500 ms that is asked every 100 ms.
class LossWatchTest : public testing::Test {
 protected:
  bool look(bool inFlight, int probes, int sinceHeard_ms, int gap_ms = 100) {
    now_ += base::Nanos{1'000'000} * gap_ms;
    return watch_.isLost({.inFlight = inFlight, .probes = probes, .sinceHeard = milliseconds(sinceHeard_ms)},
                         now_);
  }
  // A closed window with bytes in flight.
  bool lookClosed(std::uint32_t retransmissions, int sinceHeard_ms) {
    now_ += base::Nanos{1'000'000} * 100;
    return watch_.isLost({.inFlight = true,
                          .windowClosed = true,
                          .retransmissions = retransmissions,
                          .sinceHeard = milliseconds(sinceHeard_ms)},
                         now_);
  }

  LossWatch watch_{milliseconds(500)};
  base::Nanos now_ = base::toNanos(3600);
};

TEST_F(LossWatchTest, SilenceWithDataUnderWayIsALossAfterTheTimeout) {
  EXPECT_FALSE(look(false, 0, 60'000));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(look(true, 0, 60'000 + 100 * i)) << i;
  EXPECT_TRUE(look(true, 0, 60'500));
}

TEST_F(LossWatchTest, SilenceWithNothingUnderWayIsNone) {
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(look(false, 0, 100 * i));
}

TEST_F(LossWatchTest, AnAcknowledgementBeginsTheTimeAnew) {
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(look(true, 0, 100 * i));
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(look(true, 0, 100 * (i % 5)));
}

TEST_F(LossWatchTest, TimeInWhichNobodyLookedCountsLittle) {
  EXPECT_FALSE(look(true, 0, 10));
  EXPECT_FALSE(look(true, 0, 10'010, 10'000)) << "the machine stood still, not the peer";
  EXPECT_FALSE(look(true, 0, 10'110));
  EXPECT_FALSE(look(true, 0, 10'210));
  EXPECT_TRUE(look(true, 0, 10'310));
}

TEST_F(LossWatchTest, AProbeSoonAfterAnAnswerNeedsNone) {
  EXPECT_FALSE(look(false, 0, 350));
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(look(false, 1, 450 + 100 * i)) << i;
  EXPECT_FALSE(look(false, 0, 50)) << "the next one was answered";
}

TEST_F(LossWatchTest, AProbeAfterALongSilenceMustBeAnswered) {
  EXPECT_FALSE(look(false, 0, 1000));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(look(false, 1, 1100 + 100 * i)) << i;
  EXPECT_TRUE(look(false, 1, 1600));
}

TEST_F(LossWatchTest, OneOfTwoProbesMustBeAnswered) {
  EXPECT_FALSE(look(false, 1, 250));
  EXPECT_FALSE(look(false, 1, 350));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(look(false, 2, 650 + 100 * i)) << i;
  EXPECT_TRUE(look(false, 2, 1150));
}

// The system repeats what the peer discarded after 0.2 s, 0.4 s, ... and the peer answers each time.
TEST_F(LossWatchTest, APeerWithoutMemoryThatAnswersIsNotLost) {
  std::uint32_t retransmissions = 7;
  EXPECT_FALSE(look(true, 0, 10));
  for (int pause_ms = 200; pause_ms < 60'000; pause_ms *= 2) {
    ++retransmissions;
    for (int t_ms = 20; t_ms < pause_ms; t_ms += 100) {
      ASSERT_FALSE(lookClosed(retransmissions, t_ms)) << pause_ms << " " << t_ms;
    }
  }
}

TEST_F(LossWatchTest, APeerWithoutMemoryThatVanishesIsLost) {
  EXPECT_FALSE(lookClosed(3, 20));
  EXPECT_FALSE(lookClosed(3, 120));
  EXPECT_FALSE(lookClosed(4, 220)) << "the first repetition";
  EXPECT_FALSE(lookClosed(4, 320));
  for (int i = 0; i < 5; ++i) EXPECT_FALSE(lookClosed(5, 620 + 100 * i)) << i;
  EXPECT_TRUE(lookClosed(5, 1120));
}

TEST_F(LossWatchTest, WithoutATimeoutNothingIsEverLost) {
  watch_ = LossWatch(milliseconds(0));
  EXPECT_FALSE(watch_.active());
  for (int i = 0; i < 100; ++i) EXPECT_FALSE(look(true, 5, 100'000));
}

}  // namespace
}  // namespace hapticd::net
