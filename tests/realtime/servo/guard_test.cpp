// Every rule of the guard, tick by tick.
#include "realtime/servo/guard.h"
#include "base/time.h"
#include "support/milliseconds.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace hapticd::realtime {
namespace {

constexpr double kTiny = 1e-9;

GuardOptions armedOptions() {
  GuardOptions options;
  options.armed = true;
  return options;
}

// Drives a guard as a tick does. Public members are the inputs of the next step.
class Bench {
 public:
  explicit Bench(const GuardOptions& options = armedOptions(), Nanos period = kMs)
      : nominal(period), control(options.armed), guard(options, control, period) {
    in.period = 0;
  }

  Vec3 step() {
    in.state = haveState ? &state : nullptr;
    const Vec3 force = guard.step(in);
    in.period = nominal;
    return force;
  }
  Vec3 steps(Nanos duration) {
    Vec3 force = Vec3::Zero();
    for (Nanos t = 0; t < duration; t += nominal) force = step();
    return force;
  }
  // Past the ramp, with a constant force.
  void settle(const Vec3& force) {
    in.force_N = force;
    steps(600 * kMs);
  }
  Vec3 lateStep(Nanos late) {
    in.late = late;
    in.period = nominal + late;
    const Vec3 force = step();
    in.late = 0;
    return force;
  }
  bool active(Trip trip) const { return (guard.report().active & bit(trip)) != 0; }
  bool latched(Trip trip) const { return (guard.report().latched & bit(trip)) != 0; }
  std::uint32_t count(Trip trip) const { return guard.report().counts[static_cast<std::size_t>(trip)]; }

  Nanos nominal;
  GuardControl control;
  Guard guard;
  GuardInput in;
  device::DeviceState state;
  bool haveState = true;
};

class AtRate : public testing::TestWithParam<double> {
 protected:
  Nanos period() const { return base::toNanos(1 / GetParam()); }
};
INSTANTIATE_TEST_SUITE_P(Guard, AtRate, testing::Values(250.0, 1000.0, 4000.0));

TEST(Guard, TheTableOfTripsIsInOrder) {
  for (std::size_t i = 0; i < kTripCount; ++i) {
    EXPECT_EQ(static_cast<std::size_t>(kTrips[i].trip), i);
    EXPECT_FALSE(kTrips[i].name.empty());
    EXPECT_NE(kTrips[i].forceError, ForceError::recovered);
  }
}

TEST_P(AtRate, RampsInOverHalfASecond) {
  Bench bench(armedOptions(), period());
  bench.in.force_N = Vec3(0, 2, 0);
  Nanos t = 0;
  for (; t <= 500 * kMs; t += period()) {
    const Vec3 force = bench.step();
    const double gain = static_cast<double>(t) / (500.0 * kMs);
    if (t >= 5 * kMs) {
      EXPECT_NEAR(force.y(), 2 * gain, kTiny);
    }  // before, the slew limit acts, too
    EXPECT_LE(force.y(), 2 * gain + kTiny);
  }
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
  EXPECT_NEAR(bench.guard.report().gain, 1, kTiny);
}

TEST(Guard, PassesWhatIsWithinTheLimits) {
  Bench bench;
  bench.settle(Vec3::Zero());
  for (int i = 0; i < 1000; ++i) {
    const double y = 1.5 + 1.5 * std::sin(0.1 * i);
    bench.in.force_N = Vec3(0.2, y, 0);
    if (i < 5) {  // the first step from zero is 1.5 N
      bench.step();
      continue;
    }
    ASSERT_NEAR((bench.step() - bench.in.force_N).norm(), 0, kTiny) << i;
  }
}

TEST(Guard, ANonFiniteForceIsZeroAndRampsInAgain) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Bench bench;
    bench.settle(Vec3(0, 2, 0));
    bench.in.force_N = Vec3(bad, 2, 0);
    EXPECT_EQ(bench.step(), Vec3::Zero());
    EXPECT_TRUE(bench.active(Trip::notFinite));
    EXPECT_EQ(bench.count(Trip::notFinite), 1U);
    bench.in.force_N = Vec3(0, 2, 0);
    EXPECT_EQ(bench.step(), Vec3::Zero());
    EXPECT_FALSE(bench.active(Trip::notFinite));
    EXPECT_NEAR(bench.steps(250 * kMs).y(), 1, 1e-6);
    EXPECT_NEAR(bench.steps(300 * kMs).y(), 2, kTiny);
  }
}

TEST(Guard, ANonFiniteStateIsZeroForce) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.state.position_m.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_TRUE(bench.active(Trip::notFinite));
}

TEST(Guard, ClampsToThePeakAndKeepsTheDirection) {
  Bench bench;
  bench.settle(Vec3(30, 40, 0));
  const Vec3 force = bench.step();
  EXPECT_NEAR(force.norm(), 3.3, kTiny);
  EXPECT_NEAR((force / 3.3 - Vec3(0.6, 0.8, 0)).norm(), 0, kTiny);
  EXPECT_TRUE(bench.active(Trip::peakForce));
  EXPECT_EQ(bench.count(Trip::peakForce), 1U) << "one clamp that lasts is one";
  bench.in.force_N = Vec3(1e308, 1e308, 1e308);
  const Vec3 huge = bench.steps(20 * kMs);
  EXPECT_NEAR(huge.norm(), 3.3, kTiny);
  bench.in.force_N = Vec3(1, 0, 0);
  bench.step();
  EXPECT_FALSE(bench.active(Trip::peakForce));
}

TEST_P(AtRate, TheForceRisesByOneNewtonInAMillisecond) {
  Bench bench(armedOptions(), period());
  bench.settle(Vec3::Zero());
  bench.in.force_N = Vec3(0, 0, 3);
  const double perTick = 1000 * base::toSeconds(period());
  for (int i = 1; i <= 20; ++i) ASSERT_NEAR(bench.step().z(), std::min(3.0, i * perTick), kTiny);
}

TEST(Guard, TheForceFallsAtOnceAndTurnsThroughZero) {
  Bench bench;
  bench.settle(Vec3(0, 3, 0));
  bench.in.force_N = Vec3(0, 0.5, 0);
  EXPECT_NEAR(bench.step().y(), 0.5, kTiny);
  EXPECT_FALSE(bench.active(Trip::slew));
  bench.settle(Vec3(0, 3, 0));
  bench.in.force_N = Vec3(0, -3, 0);  // its old part along the new direction is none
  EXPECT_NEAR(bench.step().y(), -1, kTiny);
  EXPECT_TRUE(bench.active(Trip::slew));
  EXPECT_NEAR(bench.step().y(), -2, kTiny);
  EXPECT_NEAR(bench.step().y(), -3, kTiny);
  bench.in.force_N = Vec3(3, 0, 0);
  EXPECT_NEAR((bench.step() - Vec3(1, 0, 0)).norm(), 0, kTiny);
}

// From F0 to F1: by the distance of F1 from the segment between zero and F0, computed here by a search.
TEST_P(AtRate, ForcesGrowTurnAndReverseByOneNewtonInAMillisecond) {
  Bench bench(armedOptions(), period());
  bench.settle(Vec3::Zero());
  const double perTick = 1000 * base::toSeconds(period());
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(-1, 1);
  Vec3 last = Vec3::Zero();
  double most = 0;
  double dropped = 0;
  for (int i = 0; i < 20'000; ++i) {
    if (i % 7 == 0) {
      const double size = i % 3 == 0 ? 0 : 3.3;
      bench.in.force_N = size * Vec3(uniform(random), uniform(random), uniform(random)).normalized();
    }
    const Vec3 next = bench.step();
    double distance = 1e9;
    for (int k = 0; k <= 100; ++k) distance = std::min(distance, (next - 0.01 * k * last).norm());
    ASSERT_LE(distance, perTick + 0.01 * last.norm() + kTiny) << i;
    most = std::max(most, distance);
    dropped = std::max(dropped, last.norm() - next.norm());
    last = next;
  }
  EXPECT_GT(most, 0.9 * std::min(perTick, 3.0));
  EXPECT_GT(dropped, 2) << "towards zero at once";
}

TEST(Guard, ALimitedForceStaysAsNearToTheWantedOneAsItMay) {
  Bench bench;
  bench.settle(Vec3(3, 0, 0));
  bench.in.force_N = Vec3(1.5, 2.5, 0);  // falls to 1.5 N at once and turns by 1 N
  EXPECT_NEAR((bench.step() - Vec3(1.5, 1, 0)).norm(), 0, kTiny);
  EXPECT_TRUE(bench.active(Trip::slew));
  for (int i = 0; i < 5; ++i) bench.step();
  EXPECT_NEAR((bench.step() - Vec3(1.5, 2.5, 0)).norm(), 0, kTiny);
  EXPECT_FALSE(bench.active(Trip::slew));
}

// The written force obeys the law while the gain ramps in, too.
TEST(Guard, TheGainDoesNotLetAForceReverseFaster) {
  Bench bench;
  Vec3 last = Vec3::Zero();
  for (int i = 0; i < 600; ++i) {
    bench.in.force_N = Vec3(0, i / 10 % 2 == 0 ? 3.3 : -3.3, 0);
    const Vec3 next = bench.step();
    const double allowed = 1 + kTiny;
    if (next.y() * last.y() < 0) {
      ASSERT_LE(std::abs(next.y()), allowed) << i;
    } else {
      ASSERT_LE(std::abs(next.y()) - std::abs(last.y()), allowed) << i;
    }
    last = next;
  }
}

TEST(Guard, TurningForcesKeepTheirSize) {
  Bench bench;
  bench.settle(Vec3(3, 0, 0));
  for (int i = 0; i < 500; ++i) {  // 10 turns in a second
    const double angle = 2 * M_PI * i / 100.0;
    bench.in.force_N = 3 * Vec3(std::cos(angle), std::sin(angle), 0);
    ASSERT_NEAR((bench.step() - bench.in.force_N).norm(), 0, kTiny);
  }
}

TEST(Guard, SpeedTripsInTheThirdTickAndLatches) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.state.velocity_m_per_s = Vec3(1.3, 0, 0);
  EXPECT_GT(bench.step().y(), 1.9);
  EXPECT_GT(bench.step().y(), 1.9);
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_TRUE(bench.latched(Trip::speed));
  EXPECT_EQ(bench.count(Trip::speed), 1U);
  bench.state.velocity_m_per_s.setZero();
  EXPECT_EQ(bench.steps(1000 * kMs), Vec3::Zero()) << "waits for a re-arm";
  bench.control.rearm();
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_FALSE(bench.latched(Trip::speed));
  EXPECT_NEAR(bench.steps(250 * kMs).y(), 1, 1e-6);
}

TEST(Guard, TwoFastTicksAreNoTrip) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  for (int i = 0; i < 30; ++i) {
    bench.state.velocity_m_per_s = Vec3(0, i % 3 == 2 ? 1.1 : 5.0, 0);
    ASSERT_GT(bench.step().y(), 1.9);
  }
}

TEST(Guard, ARearmWaitsUntilTheHandIsCalm) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.state.velocity_m_per_s = Vec3(2, 0, 0);
  bench.steps(3 * kMs);
  bench.state.velocity_m_per_s = Vec3(0.5, 0, 0);
  bench.control.rearm();
  EXPECT_EQ(bench.steps(1000 * kMs), Vec3::Zero());
  EXPECT_TRUE(bench.active(Trip::speed));
  EXPECT_FALSE(bench.latched(Trip::speed));
  bench.state.velocity_m_per_s = Vec3(0.2, 0, 0);
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
}

// A cable that is unplugged while the hand is fast: the first states after it have a fault and no speed.
TEST(Guard, AHandThatIsOutOfSightIsNotCalm) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.state.velocity_m_per_s = Vec3(2, 0, 0);
  bench.steps(3 * kMs);
  bench.state.velocity_m_per_s = Vec3::Zero();
  bench.state.hold = device::kHoldFault;
  bench.steps(100 * kMs);
  bench.state.hold = device::kHoldNone;
  bench.state.velocity_m_per_s = Vec3(0.5, 0, 0);
  bench.control.rearm();
  EXPECT_EQ(bench.steps(1000 * kMs), Vec3::Zero());
  EXPECT_TRUE(bench.active(Trip::speed));
  bench.state.velocity_m_per_s = Vec3(0.2, 0, 0);
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
}

TEST(Guard, ASimulatedHandRecoversByItselfWhenCalm) {
  GuardOptions options = armedOptions();
  options.selfRecover = true;
  Bench bench(options);
  bench.settle(Vec3(0, 2, 0));
  bench.state.velocity_m_per_s = Vec3(2, 0, 0);
  EXPECT_EQ(bench.steps(3 * kMs), Vec3::Zero());
  EXPECT_TRUE(bench.latched(Trip::speed));
  bench.state.velocity_m_per_s = Vec3(0.1, 0, 0);
  EXPECT_EQ(bench.step(), Vec3::Zero());
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
  EXPECT_EQ(bench.lateStep(60 * kMs), Vec3::Zero());
  EXPECT_TRUE(bench.latched(Trip::stalled));
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
}

TEST_P(AtRate, ALateTickLetsTheForceDecayOverTwentyMilliseconds) {
  Bench bench(armedOptions(), period());
  bench.settle(Vec3(0, 2, 0));
  EXPECT_NEAR(bench.lateStep(3 * kMs).y(), 2, kTiny) << "3 ms is not more than 3 ms";
  EXPECT_NEAR(bench.lateStep(4 * kMs).y(), 2, kTiny);
  EXPECT_TRUE(bench.active(Trip::late));
  EXPECT_EQ(bench.count(Trip::late), 1U);
  Nanos t = period();
  for (; t < 20 * kMs; t += period()) {
    EXPECT_NEAR(bench.step().y(), 2 * (1 - static_cast<double>(t) / (20.0 * kMs)), kTiny);
    EXPECT_FALSE(bench.active(Trip::late));
  }
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_NEAR(bench.steps(200 * kMs).y(), 0.8, 1e-6) << "then it ramps in";
  EXPECT_EQ(bench.guard.report().latched, 0U);
}

TEST(Guard, AStallIsZeroAtOnceAndAFault) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  EXPECT_EQ(bench.lateStep(51 * kMs), Vec3::Zero());
  EXPECT_TRUE(bench.latched(Trip::stalled));
  EXPECT_EQ(bench.steps(1000 * kMs), Vec3::Zero());
  bench.control.rearm();
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
  EXPECT_EQ(bench.count(Trip::stalled), 1U);
}

TEST(Guard, ALateTickRaisesNothingByMoreThanTwoTicks) {
  Bench bench;
  bench.settle(Vec3::Zero());
  bench.in.force_N = Vec3(0, 3.2, 0);
  EXPECT_LE(bench.lateStep(2900'000).y(), 2 + kTiny);
}

TEST(Guard, EveryHoldIsZeroWhileItLastsAndRampsAfter) {
  const std::pair<std::uint32_t, Trip> holds[] = {{device::kHoldNotCalibrated, Trip::notCalibrated},
                                                  {device::kHoldDeadMan, Trip::deadMan},
                                                  {device::kHoldInkwell, Trip::inkwell},
                                                  {device::kHoldHot, Trip::hot}};
  for (const auto& [hold, trip] : holds) {
    Bench bench;
    bench.settle(Vec3(0, 2, 0));
    bench.state.hold = hold;
    EXPECT_EQ(bench.step(), Vec3::Zero());
    EXPECT_TRUE(bench.active(trip));
    EXPECT_EQ(bench.steps(100 * kMs), Vec3::Zero());
    EXPECT_EQ(bench.count(trip), 1U);
    bench.state.hold = device::kHoldNone;
    EXPECT_EQ(bench.step(), Vec3::Zero());
    EXPECT_FALSE(bench.active(trip));
    EXPECT_NEAR(bench.steps(250 * kMs).y(), 1, 1e-6);
    EXPECT_EQ(bench.guard.report().latched, 0U);
  }
}

TEST(Guard, ADriverErrorLatches) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.state.hold = device::kHoldFault;
  EXPECT_EQ(bench.step(), Vec3::Zero());
  bench.state.hold = device::kHoldNone;
  EXPECT_EQ(bench.steps(100 * kMs), Vec3::Zero());
  EXPECT_TRUE(bench.latched(Trip::deviceFault));
  bench.control.rearm();
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 2, kTiny);
}

TEST(Guard, NoStateOrARefusedWriteIsZero) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.haveState = false;
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_TRUE(bench.active(Trip::noState));
  bench.haveState = true;
  bench.settle(Vec3(0, 2, 0));
  bench.in.writeFailed = true;
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_EQ(bench.count(Trip::noState), 2U);
}

TEST(Guard, StopIsZeroInTheNextTickUntilRearmed) {
  Bench bench;
  bench.settle(Vec3(0, 3, 0));
  bench.control.stop();
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_TRUE(bench.guard.report().stopped);
  EXPECT_EQ(bench.steps(2000 * kMs), Vec3::Zero());
  bench.control.rearm();
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_FALSE(bench.guard.report().stopped);
  EXPECT_NEAR(bench.steps(250 * kMs).y(), 1.5, 1e-6);
}

TEST(Guard, TheLastOfStopAndRearmWins) {
  Bench bench;
  bench.settle(Vec3(0, 3, 0));
  bench.control.rearm();
  bench.control.stop();
  EXPECT_EQ(bench.steps(600 * kMs), Vec3::Zero());
  bench.control.stop();
  bench.control.rearm();
  bench.steps(600 * kMs);
  EXPECT_NEAR(bench.step().y(), 3, kTiny);
}

TEST(Guard, RealDevicesStartDisarmedAndARearmDoesNotEnableThem) {
  Bench bench(GuardOptions{});
  bench.settle(Vec3(0, 3, 0));
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_FALSE(bench.guard.report().armed);
  EXPECT_TRUE(bench.active(Trip::disarmed));
  bench.control.rearm();
  EXPECT_EQ(bench.steps(600 * kMs), Vec3::Zero());
  bench.control.arm();
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_NEAR(bench.steps(250 * kMs).y(), 1.5, 1e-6);
  EXPECT_TRUE(bench.guard.report().armed);
  bench.control.disarm();
  EXPECT_EQ(bench.step(), Vec3::Zero());
}

TEST(Guard, AResetRampsInAnew) {
  Bench bench;
  bench.settle(Vec3(0, 2, 0));
  bench.control.rampIn();
  EXPECT_EQ(bench.step(), Vec3::Zero());
  EXPECT_NEAR(bench.steps(250 * kMs).y(), 1, 1e-6);
}

TEST_P(AtRate, AJumpOfGeometryIsBlendedOverTwentyMilliseconds) {
  Bench bench(armedOptions(), period());
  bench.settle(Vec3(0, 1, 0));
  bench.in.force_N = Vec3(0, 3, 0);
  bench.in.geometryJump = true;
  for (Nanos t = period(); t <= 20 * kMs; t += period()) {
    EXPECT_NEAR(bench.step().y(), 1 + 2 * static_cast<double>(t) / (20.0 * kMs), kTiny);
    bench.in.geometryJump = false;
  }
  EXPECT_NEAR(bench.step().y(), 3, kTiny);
  EXPECT_EQ(bench.count(Trip::geometryJump), 1U);
  bench.in.force_N.setZero();  // what was touched vanishes
  bench.in.geometryJump = true;
  EXPECT_GT(bench.step().y(), 2);
  bench.in.geometryJump = false;
  bench.steps(20 * kMs);
  EXPECT_NEAR(bench.step().y(), 0, kTiny);
}

TEST(Guard, GeometryThatJumpsInEveryTickIsStillFollowed) {
  Bench bench;
  bench.settle(Vec3(0, 1, 0));
  bench.in.force_N = Vec3(0, 3, 0);
  bench.in.geometryJump = true;
  EXPECT_NEAR(bench.steps(200 * kMs).y(), 3, 1e-3);
}

TEST(Guard, ADeepFirstContactIsToldAsLongAsItLasts) {
  Bench bench;
  bench.settle(Vec3(0, 1, 0));
  EXPECT_FALSE(bench.active(Trip::deepContact));
  bench.in.deepContact = true;
  bench.steps(3 * kMs);
  EXPECT_TRUE(bench.active(Trip::deepContact));
  bench.in.deepContact = false;
  EXPECT_NEAR(bench.step().y(), 1, kTiny) << "told, not limited";
  EXPECT_FALSE(bench.active(Trip::deepContact));
  EXPECT_EQ(bench.count(Trip::deepContact), 1U);
}

TEST(Guard, RawPassesEverythingFinite) {
  GuardOptions options;
  options.enabled = false;
  Bench bench(options);
  bench.in.force_N = Vec3(0, 50, 0);
  EXPECT_EQ(bench.step(), Vec3(0, 50, 0));
  bench.in.force_N = Vec3(0, std::numeric_limits<double>::quiet_NaN(), 0);
  EXPECT_EQ(bench.step(), Vec3::Zero());
}

TEST(Guard, AHotDeviceGetsItsContinuousForce) {
  GuardOptions options = armedOptions();
  options.continuousForce_N = 0.88;
  Bench bench(options);
  bench.in.force_N = Vec3(0, 3.3, 0);
  double mean = 0;
  double most = 0;
  for (int i = 0; i < 20'000; ++i) {
    const double force = bench.step().norm();
    most = std::max(most, force);
    if (i >= 10'000) mean += force / 10'000;
  }
  EXPECT_TRUE(bench.active(Trip::thermal));
  EXPECT_EQ(bench.count(Trip::thermal), 1U);
  EXPECT_GT(most, 3.2);
  EXPECT_LE(mean, 0.88);
  EXPECT_GT(mean, 0.84);
  EXPECT_LT(bench.guard.report().limit_N, 0.88);
}

}  // namespace
}  // namespace hapticd::realtime
