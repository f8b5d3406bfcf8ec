// Error measures against figures that were computed by hand.
#include "record/force_comparison.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "support/milliseconds.h"

namespace hapticd::record {
namespace {

ForceSample felt(Nanos time, const Vec3& force_N, const Vec3& proxy_m = Vec3::Zero(), bool touching = true) {
  return {time, force_N, proxy_m, touching};
}

TEST(ForceComparison, FindsNoErrorBetweenEqualForces) {
  const std::vector<ForceSample> samples{felt(0, Vec3(0, 0, 1)), felt(kMs, Vec3(1, 2, 3))};
  const ForceErrors errors = compareForces(samples, samples);
  EXPECT_EQ(errors.samples, 2U);
  EXPECT_EQ(errors.rms_N, 0);
  EXPECT_EQ(errors.largest_N, 0);
  EXPECT_EQ(errors.rmsMagnitude_N, 0);
  EXPECT_EQ(errors.both, 2U);
  EXPECT_NEAR(errors.rmsAngle_deg, 0, 1e-12);
  EXPECT_EQ(errors.touching, 2U);
  EXPECT_EQ(errors.rmsDistance_m, 0);
}

// Errors of 3, 4 and 0 N: RMS sqrt(25 / 3), mean 7 / 3. Angles of 0, 90 and 180 degrees over the first three:
// mean 90, RMS sqrt((8100 + 32400) / 3).
TEST(ForceComparison, GivesTheFiguresOfAComputationByHand) {
  const std::vector<ForceSample> rendered{felt(0, Vec3(0, 0, 5)), felt(kMs, Vec3(0, 0, 0)),
                                          felt(2 * kMs, Vec3(1, 0, 0))};
  const std::vector<ForceSample> reference{felt(0, Vec3(0, 0, 2)), felt(kMs, Vec3(0, 4, 0)),
                                           felt(2 * kMs, Vec3(1, 0, 0))};
  const ForceErrors errors = compareForces(rendered, reference);
  EXPECT_NEAR(errors.rms_N, std::sqrt(25.0 / 3), 1e-12);
  EXPECT_NEAR(errors.mean_N, 7.0 / 3, 1e-12);
  EXPECT_EQ(errors.largest_N, 4);
  EXPECT_EQ(errors.largestAt, kMs);
  EXPECT_NEAR(errors.rmsMagnitude_N, std::sqrt(25.0 / 3), 1e-12);
  EXPECT_NEAR(errors.rmsReference_N, std::sqrt(21.0 / 3), 1e-12);
  EXPECT_EQ(errors.both, 2U);
  EXPECT_EQ(errors.onlyReference, 1U);

  const std::vector<ForceSample> turned{felt(0, Vec3(0, 0, 2)), felt(kMs, Vec3(0, 4, 0)),
                                        felt(2 * kMs, Vec3(1, 0, 0))};
  const std::vector<ForceSample> other{felt(0, Vec3(0, 0, 1)), felt(kMs, Vec3(0, 0, 4)),
                                       felt(2 * kMs, Vec3(-3, 0, 0))};
  const ForceErrors angles = compareForces(turned, other);
  EXPECT_EQ(angles.both, 3U);
  EXPECT_NEAR(angles.meanAngle_deg, 90, 1e-12);
  EXPECT_NEAR(angles.rmsAngle_deg, std::sqrt(40500.0 / 3), 1e-10);
}

// A magnitude error is not a vector error: equal magnitudes at right angles.
TEST(ForceComparison, TellsMagnitudeFromDirection) {
  const ForceErrors errors =
      compareForces(std::vector{felt(0, Vec3(1, 0, 0))}, std::vector{felt(0, Vec3(0, 1, 0))});
  EXPECT_NEAR(errors.rms_N, std::numbers::sqrt2, 1e-12);
  EXPECT_EQ(errors.rmsMagnitude_N, 0);
  EXPECT_NEAR(errors.meanAngle_deg, 90, 1e-12);
}

TEST(ForceComparison, CountsWhichOfTheTwoFeelsAContact) {
  const double none = 0.9 * kSmallestForce_N;
  const double some = 1.1 * kSmallestForce_N;
  const std::vector<ForceSample> rendered{felt(0, Vec3(none, 0, 0)), felt(1, Vec3(some, 0, 0)),
                                          felt(2, Vec3(none, 0, 0)), felt(3, Vec3(some, 0, 0)),
                                          felt(4, Vec3(some, 0, 0))};
  const std::vector<ForceSample> reference{felt(0, Vec3(0, none, 0)), felt(1, Vec3(0, none, 0)),
                                           felt(2, Vec3(0, some, 0)), felt(3, Vec3(0, some, 0)),
                                           felt(4, Vec3(some, 0, 0))};
  const ForceErrors errors = compareForces(rendered, reference);
  EXPECT_EQ(errors.neither, 1U);
  EXPECT_EQ(errors.onlyRendered, 1U);
  EXPECT_EQ(errors.onlyReference, 1U);
  EXPECT_EQ(errors.both, 2U);
  // Directions of forces that count as none are left out.
  EXPECT_NEAR(errors.meanAngle_deg, 45, 1e-12);
}

// The reference at 400 Hz, the rendering at 1 kHz: half way between two ticks.
TEST(ForceComparison, InterpolatesTheRenderingToTheTimesOfTheReference) {
  std::vector<ForceSample> rendered;
  for (Nanos t = 0; t <= 10 * kMs; t += kMs)
    rendered.push_back(felt(t, Vec3(0, 0, static_cast<double>(t)), Vec3(static_cast<double>(t), 0, 0)));
  std::vector<ForceSample> reference;
  for (Nanos t = 0; t <= 10 * kMs; t += 2'500'000)
    reference.push_back(felt(t, Vec3(0, 0, static_cast<double>(t)), Vec3(static_cast<double>(t), 0, 3)));
  const ForceErrors errors = compareForces(rendered, reference);
  EXPECT_EQ(errors.samples, 5U);
  EXPECT_NEAR(errors.rms_N, 0, 1e-6);  // of 10^7 N
  EXPECT_NEAR(errors.rmsDistance_m, 3, 1e-6);
}

TEST(ForceComparison, MeasuresDistancesWhereTheRenderingTouches) {
  const std::vector<ForceSample> rendered{
      felt(0, Vec3::Zero(), Vec3(9, 9, 9), false), felt(2, Vec3::Zero(), Vec3(0, 0, 0), true),
      felt(4, Vec3::Zero(), Vec3(0, 0, 0), true), felt(6, Vec3::Zero(), Vec3(9, 9, 9), false)};
  const std::vector<ForceSample> reference{
      felt(0, Vec3::Zero(), Vec3(0, 0, 0)), felt(1, Vec3::Zero(), Vec3(0, 0, 0)),
      felt(2, Vec3::Zero(), Vec3(3, 0, 0)), felt(3, Vec3::Zero(), Vec3(0, 4, 0)),
      felt(5, Vec3::Zero(), Vec3(0, 0, 0))};
  const ForceErrors errors = compareForces(rendered, reference);
  EXPECT_EQ(errors.samples, 5U);
  EXPECT_EQ(errors.touching, 2U);
  EXPECT_NEAR(errors.rmsDistance_m, std::sqrt(12.5), 1e-12);
}

TEST(ForceComparison, LeavesOutWhatWasNotRendered) {
  const std::vector<ForceSample> rendered{felt(10, Vec3(1, 0, 0)), felt(20, Vec3(1, 0, 0))};
  const std::vector<ForceSample> reference{felt(0, Vec3(7, 0, 0)),  felt(9, Vec3(7, 0, 0)),
                                           felt(10, Vec3(1, 0, 0)), felt(15, Vec3(2, 0, 0)),
                                           felt(20, Vec3(1, 0, 0)), felt(21, Vec3(7, 0, 0))};
  const ForceErrors errors = compareForces(rendered, reference);
  EXPECT_EQ(errors.samples, 3U);
  EXPECT_EQ(errors.first, 10);
  EXPECT_EQ(errors.last, 20);
  EXPECT_EQ(errors.largest_N, 1);
  EXPECT_EQ(errors.largestAt, 15);
  EXPECT_EQ(compareForces(rendered, std::vector{felt(30, Vec3(1, 0, 0))}).samples, 0U);
  EXPECT_EQ(compareForces({}, reference).samples, 0U);
  EXPECT_EQ(compareForces(rendered, {}).rms_N, 0);
}

}  // namespace
}  // namespace hapticd::record
