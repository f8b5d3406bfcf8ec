// A store of energy that bounds what a force may add to the hand.
#pragma once

#include <algorithm>

#include "realtime/remote/remote_input.h"

namespace hapticd::realtime {

/// Starts with an amount, takes back what the hand returns and a small power, and holds no more than its
/// capacity.
class EnergyTank {
 public:
  explicit EnergyTank(const EnergyBudget& budget) noexcept : budget_(budget), energy_J_(budget.start_J) {}

  EnergyTank(const EnergyBudget& budget, double balance_J) noexcept : budget_(budget), energy_J_(balance_J) {}

  double energy_J() const noexcept { return std::max(0.0, energy_J_); }
  /// The same, below zero for a debt.
  double balance_J() const noexcept { return energy_J_; }
  /// Takes work that was done on the hand; negative work fills the tank. What an empty tank gives while its
  /// user still falls to zero is a debt, repaid first.
  void give(double work_J) noexcept {
    energy_J_ = std::clamp(energy_J_ - work_J, -budget_.capacity_J, budget_.capacity_J);
  }
  void refill(double step_s) noexcept { give(-budget_.refill_W * step_s); }
  /// Other limits, from now on; the content stays within them.
  void setBudget(const EnergyBudget& budget) noexcept {
    budget_ = budget;
    give(0);
  }
  const EnergyBudget& budget() const noexcept { return budget_; }

 private:
  EnergyBudget budget_;
  double energy_J_;
};

}  // namespace hapticd::realtime
