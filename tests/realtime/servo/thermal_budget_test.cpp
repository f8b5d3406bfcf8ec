// The mean over any 5 s is at most the continuous force, and the limit never falls to zero.
#include "realtime/servo/thermal_budget.h"
#include "base/time.h"

#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <random>

namespace hapticd::realtime {
namespace {

constexpr double kPeak = 3.3;
constexpr double kContinuous = 0.88;

// Writes demands within the limit and keeps the mean of the last 5 s.
class Motor {
 public:
  explicit Motor(Nanos period) : period_(period) {}
  double write(double demand_N) {
    const double force = std::min(demand_N, budget.limit_N());
    budget.add(force, period_);
    past_.push_back(force);
    sum_ += force;
    if (past_.size() > static_cast<std::size_t>(5'000'000'000 / period_)) {
      sum_ -= past_.front();
      past_.pop_front();
    }
    return force;
  }
  double mean() const { return sum_ * base::toSeconds(period_) / 5; }

  ThermalBudget budget{kPeak, kContinuous};

 private:
  Nanos period_;
  std::deque<double> past_;
  double sum_ = 0;
};

TEST(ThermalBudget, AHardPressGetsThePeakThenTheFloorThenTheContinuousForce) {
  for (const Nanos period : {4'000'000, 1'000'000, 250'000}) {
    Motor motor(period);
    double lowest = kPeak;
    for (Nanos t = 0; t < 30'000'000'000; t += period) {
      const double force = motor.write(kPeak);
      ASSERT_LE(motor.mean(), kContinuous + 1e-9);
      if (t < 300'000'000) {
        ASSERT_EQ(force, kPeak);
      }
      lowest = std::min(lowest, force);
      if (t > 10'000'000'000) {
        ASSERT_NEAR(force, 0.97 * kContinuous, 0.01);
      }
    }
    EXPECT_GT(lowest, 0.59 * kContinuous);
  }
}

TEST(ThermalBudget, WhatIsLeftIsSpentWithinATenthOfASecond) {
  constexpr double kFloor = 0.6 * kContinuous;
  Motor motor(1'000'000);
  while (motor.budget.limit_N() > kPeak - 0.5) motor.write(kPeak);
  const double before = motor.budget.limit_N() - kFloor;
  for (int i = 0; i < 100; ++i) motor.write(kPeak);
  EXPECT_NEAR((motor.budget.limit_N() - kFloor) / before, std::exp(-1), 0.02);
}

TEST(ThermalBudget, ALightPressIsNeverTouched) {
  Motor motor(1'000'000);
  for (int i = 0; i < 60'000; ++i) ASSERT_EQ(motor.write(0.8), 0.8) << i;
}

TEST(ThermalBudget, ThePeakComesBackAfterARest) {
  Motor motor(1'000'000);
  for (int i = 0; i < 10'000; ++i) motor.write(kPeak);
  EXPECT_LT(motor.budget.limit_N(), kContinuous);
  for (int i = 0; i < 5'200; ++i) motor.write(0);
  EXPECT_EQ(motor.budget.limit_N(), kPeak);
}

TEST(ThermalBudget, RandomUseStaysWithinTheBudget) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> size(0, kPeak);
  for (int run = 0; run < 20; ++run) {
    Motor motor(1'000'000);
    double demand = 0;
    for (int i = 0; i < 20'000; ++i) {
      if (random() % 400 == 0) demand = random() % 3 == 0 ? 0 : size(random);
      motor.write(demand);
      ASSERT_LE(motor.mean(), kContinuous + 1e-9) << run << " " << i;
    }
  }
}

TEST(ThermalBudget, ADeviceWithoutDeratingHasNone) {
  ThermalBudget budget(3.3, 3.3);
  for (int i = 0; i < 20'000; ++i) budget.add(3.3, 1'000'000);
  EXPECT_EQ(budget.limit_N(), 3.3);
}

}  // namespace
}  // namespace hapticd::realtime
