#include "realtime/servo/thermal_budget.h"

#include <algorithm>
#include <numeric>

#include "base/time.h"

namespace hapticd::realtime {
namespace {

constexpr double kFloorShare = 0.6;   // of the continuous force
constexpr double kSpending_s = 0.1;   // time constant with which the rest is spent
constexpr double kRestedShare = 0.5;  // share of the budget in use below which the peak is allowed again

}  // namespace

ThermalBudget::ThermalBudget(double peak_N, double continuous_N) noexcept
    : peak_(peak_N),
      continuous_(std::min(continuous_N, peak_N)),
      floor_(kFloorShare * continuous_),
      limit_(peak_N) {}

void ThermalBudget::add(double force_N, Nanos duration) noexcept {
  if (continuous_ >= peak_) return;
  memory_.impulse_Ns[static_cast<std::size_t>(memory_.newest)] += force_N * base::toSeconds(duration);
  advance(duration);

  constexpr double kWindow_s = base::toSeconds(kBuckets * kBucket);
  limit_ = std::clamp(floor_ + margin() / kSpending_s, 0.0, peak_);
  if (limit_ < continuous_) memory_.derated = true;
  const double used = std::accumulate(memory_.impulse_Ns.begin(), memory_.impulse_Ns.end(), 0.0);
  if (used < kRestedShare * kWindow_s * continuous_) memory_.derated = false;
  if (memory_.derated) {
    // The largest constant force that the margin sustains; without it the limit would ripple.
    constexpr double kAccount_s = base::toSeconds((kBuckets + 1) * kBucket);
    const double steady = (kWindow_s * continuous_ + kSpending_s * floor_) / (kAccount_s + kSpending_s);
    limit_ = std::min(limit_, steady);
  }
}

void ThermalBudget::advance(Nanos duration) noexcept {
  memory_.filled += duration;
  for (int i = 0; i <= kBuckets && memory_.filled >= kBucket; ++i) {
    memory_.filled -= kBucket;
    memory_.newest = (memory_.newest + 1) % (kBuckets + 1);
    memory_.impulse_Ns[static_cast<std::size_t>(memory_.newest)] = 0;
  }
  memory_.filled %= kBucket;
}

// The rest of the budget, N·s, if only the floor is written from now on. The window is fullest just before
// one of its buckets leaves.
double ThermalBudget::margin() const noexcept {
  double kept = 0;
  double fullest = 0;
  double ahead_s = base::toSeconds((kBuckets + 1) * kBucket - memory_.filled);
  for (int age = 0; age <= kBuckets; ++age) {  // newest first: the sum without all older ones
    kept +=
        memory_.impulse_Ns[static_cast<std::size_t>((memory_.newest + kBuckets + 1 - age) % (kBuckets + 1))];
    fullest = std::max(fullest, kept + floor_ * ahead_s);
    ahead_s -= base::toSeconds(kBucket);
  }
  return base::toSeconds(kBuckets * kBucket) * continuous_ - fullest;
}

}  // namespace hapticd::realtime
