#include "bench/samples.h"

#include <gtest/gtest.h>

namespace hapticd::bench {
namespace {

TEST(Samples, quantilesAreOfTheValuesThemselves) {
  Samples samples;
  for (int i = 1000; i >= 1; --i) samples.add(i);
  const Summary s = samples.summary();
  EXPECT_EQ(s.count, 1000U);
  EXPECT_DOUBLE_EQ(s.p50, 500);
  EXPECT_DOUBLE_EQ(s.p99, 990);
  EXPECT_DOUBLE_EQ(s.p999, 999);
  EXPECT_DOUBLE_EQ(s.max, 1000);
  EXPECT_NEAR(s.mean, 500.5, 1e-9);
  EXPECT_NEAR(s.deviation, 288.675, 1e-3);
}

TEST(Samples, ofOneValueIsThatValue) {
  Samples samples;
  samples.add(7);
  const Summary s = samples.summary();
  EXPECT_DOUBLE_EQ(s.p50, 7);
  EXPECT_DOUBLE_EQ(s.p999, 7);
  EXPECT_DOUBLE_EQ(s.deviation, 0);
}

TEST(Samples, ofNothingAreZero) {
  EXPECT_EQ(Samples().summary().count, 0U);
  EXPECT_DOUBLE_EQ(Samples().shareWithin(0, 10), 0);
}

TEST(Samples, shareHasTheLowerEndAndNotTheUpper) {
  Samples samples;
  for (const double value : {0.0, 99.9, 100.0, 200.0}) samples.add(value);
  EXPECT_DOUBLE_EQ(samples.shareWithin(0, 100), 0.5);
  EXPECT_DOUBLE_EQ(samples.shareWithin(100, 200), 0.25);
}

TEST(Samples, appendsOthers) {
  Samples a;
  Samples b;
  a.add(1);
  b.add(3);
  a.add(b);
  EXPECT_DOUBLE_EQ(a.summary().mean, 2);
}

}  // namespace
}  // namespace hapticd::bench
