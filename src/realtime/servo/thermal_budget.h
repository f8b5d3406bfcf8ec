// Thermal limit of the motors: the mean force over any 5 s stays at or below the continuous force.
//
// The limit never falls to zero: at every moment the budget that is left suffices for a floor (a share of the
// continuous force) until the window has passed. A hard press from rest gets the peak force for about half a
// second, then the floor until the burst has left the window, then just under the continuous force.
#pragma once

#include <array>
#include <cstdint>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::realtime {

using base::Nanos;

/// What a budget knows of earlier ticks. A plain value.
struct ThermalMemory {
  static constexpr int kBuckets = 50;
  static constexpr Nanos kBucket = 100'000'000;

  std::array<double, kBuckets + 1> impulse_Ns{};  ///< a ring with one bucket more than the window
  std::int32_t newest = 0;
  Nanos filled = 0;  ///< time in the newest bucket
  bool derated = false;
};

/// Running account of |force| over the last 5 s. One thread; noexcept, allocation-free.
class ThermalBudget {
 public:
  ThermalBudget(double peak_N, double continuous_N) noexcept;

  /// Largest force for the next tick, newtons.
  double limit_N() const noexcept { return limit_; }
  /// Accounts for `force_N` during `duration` and updates the limit.
  void add(double force_N, Nanos duration) noexcept;

  const ThermalMemory& memory() const noexcept { return memory_; }
  void resume(const ThermalMemory& memory) noexcept { memory_ = memory; }

 private:
  static constexpr int kBuckets = ThermalMemory::kBuckets;
  static constexpr Nanos kBucket = ThermalMemory::kBucket;

  void advance(Nanos duration) noexcept;
  double margin() const noexcept;

  double peak_;
  double continuous_;
  double floor_;
  double limit_;
  ThermalMemory memory_;
};

}  // namespace hapticd::realtime
