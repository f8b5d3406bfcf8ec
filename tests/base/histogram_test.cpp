#include "base/histogram.h"

#include <gtest/gtest.h>

namespace hapticd::base {
namespace {

TEST(Histogram, PutsEveryValueInABucketOfAtMostAnEighth) {
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

TEST(Histogram, GivesQuantilesOfItsValues) {
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

TEST(Histogram, AcceptsNegativeAndHugeValues) {
  Histogram histogram;
  EXPECT_EQ(histogram.copy().quantile(0.5), 0);
  histogram.add(-5);
  EXPECT_EQ(histogram.copy().quantile(1), 0);
  histogram.add(1'000'000'000'000'000);
  EXPECT_EQ(histogram.copy().max, 1'000'000'000'000'000);
  EXPECT_EQ(histogram.copy().counts.back(), 1U);
}

TEST(Histogram, MergesAsIfOneHadCountedAll) {
  Histogram even;
  Histogram odd;
  Histogram all;
  for (Nanos i = 1; i <= 999; ++i) {
    (i % 2 == 0 ? even : odd).add(i * i);
    all.add(i * i);
  }
  Histogram::Copy merged = even.copy();
  merged += odd.copy();
  const Histogram::Copy expected = all.copy();
  EXPECT_EQ(merged.counts, expected.counts);
  EXPECT_EQ(merged.total, expected.total);
  EXPECT_EQ(merged.sum_ns, expected.sum_ns);
  EXPECT_EQ(merged.max, expected.max);
  EXPECT_EQ(merged.quantile(0.9), expected.quantile(0.9));
}

TEST(LogBuckets, TheQuantileIsTheBucketOfTheRankedValue) {
  std::array<std::uint64_t, 16> counts{};
  EXPECT_EQ(log_buckets::quantileBucket(counts, 0.5), -1);
  counts[3] = 1;
  counts[7] = 2;
  counts[12] = 1;
  EXPECT_EQ(log_buckets::quantileBucket(counts, 0), 3) << "the smallest value";
  EXPECT_EQ(log_buckets::quantileBucket(counts, 0.25), 3);
  EXPECT_EQ(log_buckets::quantileBucket(counts, 0.26), 7);
  EXPECT_EQ(log_buckets::quantileBucket(counts, 0.75), 7);
  EXPECT_EQ(log_buckets::quantileBucket(counts, 1), 12);
  EXPECT_EQ(log_buckets::quantileBucket(counts, 2), 12) << "shares are clamped";
  EXPECT_EQ(log_buckets::total(counts), 4U);
}

TEST(LogBuckets, TheLastBucketHoldsTheRest) {
  EXPECT_EQ(log_buckets::bucketOf(5, 4), 3);
  EXPECT_EQ(log_buckets::bucketOf(~std::uint64_t{0}, 192), 191);
  EXPECT_EQ(log_buckets::bucketOf(8, 192), 8);
  EXPECT_EQ(log_buckets::upperBound(8), 8);
  EXPECT_EQ(log_buckets::bucketOf(16, 192), log_buckets::bucketOf(17, 192));
  EXPECT_EQ(log_buckets::upperBound(16), 17);
}

}  // namespace
}  // namespace hapticd::base
