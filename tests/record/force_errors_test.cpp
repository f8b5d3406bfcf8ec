#include "record/force_errors.h"

#include <gtest/gtest.h>

namespace hapticd::record {
namespace {

using geometry::Vec3;

constexpr base::Nanos kMs = 1'000'000;

TEST(ForceErrors, AgreementIsZero) {
  const std::vector<TimedForce> forces{{0, {0, 0, 0}}, {kMs, {0, 0, 1}}, {2 * kMs, {0, 3, 4}}};
  const auto errors = forceErrors(forces, forces);
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->samples, 3U);
  EXPECT_EQ(errors->either, 2U);
  EXPECT_EQ(errors->both, 2U);
  EXPECT_EQ(errors->rms_N, 0);
  EXPECT_EQ(errors->largest_N, 0);
  EXPECT_EQ(errors->rmsDirection_deg, 0);
  EXPECT_EQ(errors->meanCosine, 1);
}

// Off by 3 N and by 4 N: RMS sqrt(12.5). A right angle and none: RMS 90 / sqrt(2).
TEST(ForceErrors, AsComputedByHand) {
  const auto errors = forceErrors({{0, {0, 0, 2}}, {kMs, {0, 4, 0}}}, {{0, {0, 0, 5}}, {kMs, {0, 0, 3}}});
  ASSERT_TRUE(errors);
  EXPECT_NEAR(errors->rms_N, std::sqrt((9.0 + 25.0) / 2), 1e-12);
  EXPECT_NEAR(errors->largest_N, 5, 1e-12);
  EXPECT_NEAR(errors->magnitudeRms_N, std::sqrt((9.0 + 1.0) / 2), 1e-12);
  EXPECT_NEAR(errors->rmsDirection_deg, 90 / std::sqrt(2), 1e-9);
  EXPECT_NEAR(errors->meanCosine, 0.5, 1e-12);
}

TEST(ForceErrors, ContactInOneOnlyHasNoDirection) {
  const auto errors = forceErrors({{0, {0, 0, 2}}, {kMs, {0, 0, 0}}}, {{0, {0, 0, 0}}, {kMs, {0, 0, 0.001}}});
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->either, 1U);
  EXPECT_EQ(errors->both, 0U);
  EXPECT_NEAR(errors->rms_N, 2, 1e-12);
  EXPECT_EQ(errors->rmsDirection_deg, 0);
}

TEST(ForceErrors, RenderedForcesAreInterpolatedAndOthersDoNotCount) {
  const std::vector<TimedForce> rendered{{0, {0, 0, 0}}, {kMs, {0, 0, 4}}};
  const auto errors = forceErrors(
      rendered, {{-kMs, {9, 9, 9}}, {kMs / 4, {0, 0, 1}}, {kMs / 2, {0, 0, 2}}, {2 * kMs, {9, 9, 9}}});
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->samples, 2U);
  EXPECT_NEAR(errors->rms_N, 0, 1e-12);
  EXPECT_FALSE(forceErrors(rendered, {{2 * kMs, {0, 0, 1}}}));
  EXPECT_FALSE(forceErrors({}, {{0, {0, 0, 1}}}));
}

TEST(ForceErrors, OppositeForcesHaveACosineOfMinusOne) {
  const auto errors = forceErrors({{0, {0, 0, 2}}}, {{0, {0, 0, -2}}});
  ASSERT_TRUE(errors);
  EXPECT_EQ(errors->meanCosine, -1);
  EXPECT_NEAR(errors->rmsDirection_deg, 180, 1e-9);
}

}  // namespace
}  // namespace hapticd::record
