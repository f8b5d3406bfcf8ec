#include "realtime/servo/pacer.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "support/milliseconds.h"

namespace hapticd::realtime {
namespace {

constexpr Nanos kUs = 1000;

TEST(Pacer, KeepsTheGridWhenTicksAreALittleLate) {
  Pacer pacer(0, kMs);
  for (Nanos i = 1; i < 100; ++i) {
    ASSERT_EQ(pacer.deadline(), i * kMs);
    const Pacing pacing = pacer.begin(i * kMs + 60 * kUs);
    ASSERT_EQ(pacing.wakeupError, 60 * kUs);
    ASSERT_EQ(pacing.overruns, 0U);
    ASSERT_EQ(pacing.skippedPeriods, 0U);
  }
}

TEST(Pacer, SkipsLostPeriodsAndNeverCatchesUp) {
  Pacer pacer(0, kMs);
  const Pacing pacing = pacer.begin(kMs + 7'600 * kUs);  // due at 1 ms, begun at 8.6 ms
  EXPECT_EQ(pacing.wakeupError, 7'600 * kUs);
  EXPECT_EQ(pacing.overruns, 1U);
  EXPECT_EQ(pacing.skippedPeriods, 7U);
  EXPECT_EQ(pacer.deadline(), 9 * kMs);
  EXPECT_EQ(pacer.begin(9 * kMs).overruns, 1U);
}

TEST(Pacer, CountsFromHalfAMillisecondOn) {
  Pacer pacer(0, kMs);
  EXPECT_EQ(pacer.begin(kMs + 500 * kUs).overruns, 0U);
  EXPECT_EQ(pacer.begin(2 * kMs + 501 * kUs).overruns, 1U);
  EXPECT_EQ(pacer.deadline(), 3 * kMs);
}

TEST(Pacer, AtFourKilohertzALateTickIsNotFollowedByACrowd) {
  Pacer pacer(0, 250 * kUs);
  const Pacing pacing = pacer.begin(250 * kUs + 400 * kUs);
  EXPECT_EQ(pacing.overruns, 0U);
  EXPECT_EQ(pacing.skippedPeriods, 1U);
  EXPECT_EQ(pacer.deadline(), 750 * kUs);
}

TEST(Pacer, ATickThatEndsALittleLateIsFollowedAtOnce) {
  Pacer pacer(0, kMs);
  pacer.begin(kMs);
  pacer.end(2 * kMs + 400 * kUs);
  EXPECT_EQ(pacer.deadline(), 2 * kMs);
  EXPECT_EQ(pacer.begin(2 * kMs + 400 * kUs).overruns, 0U);
  EXPECT_EQ(pacer.deadline(), 3 * kMs);
}

TEST(Pacer, ATickThatEndsTooLateLosesTheNextOne) {
  Pacer pacer(0, kMs);
  pacer.begin(kMs);
  pacer.end(5 * kMs + 600 * kUs);
  EXPECT_EQ(pacer.deadline(), 6 * kMs);
  const Pacing pacing = pacer.begin(6 * kMs);
  EXPECT_EQ(pacing.overruns, 1U);
  EXPECT_EQ(pacing.skippedPeriods, 4U);  // 2, 3, 4 and 5 ms
  EXPECT_EQ(pacing.wakeupError, 0);
}

TEST(Pacer, RatesHaveBounds) {
  EXPECT_EQ(servoPeriod(1000), kMs);
  EXPECT_EQ(servoPeriod(4000), 250 * kUs);
  EXPECT_THROW(servoPeriod(200), std::invalid_argument);
  EXPECT_THROW(servoPeriod(4001), std::invalid_argument);
  EXPECT_THROW(servoPeriod(0.0 / 0.0), std::invalid_argument);
}

}  // namespace
}  // namespace hapticd::realtime
