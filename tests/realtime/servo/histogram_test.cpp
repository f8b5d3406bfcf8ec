#include "realtime/servo/histogram.h"

#include <gtest/gtest.h>

namespace hapticd::realtime {
namespace {

TEST(Histogram, EveryValueIsInABucketOfAtMostAnEighth) {
  for (Nanos value = 0; value < 20'000'000'000; value += 1 + value / 50) {
    const int bucket = Histogram::bucketOf(value);
    ASSERT_LT(bucket, Histogram::kBuckets);
    if (bucket == Histogram::kBuckets - 1) break;
    ASSERT_LE(value, Histogram::upperBound(bucket));
    ASSERT_GT(value, bucket == 0 ? -1 : Histogram::upperBound(bucket - 1));
    ASSERT_LE(Histogram::upperBound(bucket), value + value / 8);
  }
  EXPECT_GT(Histogram::upperBound(Histogram::kBuckets - 2), 15'000'000'000);
}

TEST(Histogram, QuantilesAreOfWhatWasAdded) {
  Histogram histogram;
  for (Nanos i = 1; i <= 1000; ++i) histogram.add(i * 1000);
  const Histogram::Copy copy = histogram.copy();
  EXPECT_EQ(copy.total, 1000U);
  EXPECT_EQ(copy.sum_ns, 500'500'000U);
  EXPECT_EQ(copy.max, 1'000'000);
  EXPECT_NEAR(static_cast<double>(copy.quantile(0.5)), 500e3, 64e3);
  EXPECT_NEAR(static_cast<double>(copy.quantile(0.99)), 990e3, 70e3);
  EXPECT_EQ(copy.quantile(1), 1'000'000);
}

TEST(Histogram, EmptyNegativeAndHugeAreDefined) {
  Histogram histogram;
  EXPECT_EQ(histogram.copy().quantile(0.5), 0);
  histogram.add(-5);
  EXPECT_EQ(histogram.copy().quantile(1), 0);
  histogram.add(1'000'000'000'000'000);
  EXPECT_EQ(histogram.copy().max, 1'000'000'000'000'000);
  EXPECT_EQ(histogram.copy().counts.back(), 1U);
}

}  // namespace
}  // namespace hapticd::realtime
