// How much force the motors can still take: no 5 s may hold more than the continuous force on average.
//
// The budget is spent so that it never has to be cut to zero: at every moment there is enough left to go on
// with the floor (a part of the continuous force) for as long as the window remembers. A hard press from rest
// gets the peak for about half a second, then the floor until the window has forgotten the burst, then just
// under the continuous force for as long as it lasts.
#pragma once

#include <array>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::realtime {

using base::Nanos;

/// Running account of |force| over the last 5 s. One thread; noexcept, allocation-free.
class ThermalBudget {
 public:
  ThermalBudget(double peak_N, double continuous_N) noexcept;

  /// Largest force for the next tick, in newtons.
  double limit_N() const noexcept { return limit_; }
  /// Tells that `force_N` was in effect for `duration`, and renews the limit.
  void add(double force_N, Nanos duration) noexcept;

 private:
  static constexpr int kBuckets = 50;
  static constexpr Nanos kBucket = 100'000'000;

  void advance(Nanos duration) noexcept;
  double margin() const noexcept;

  double peak_;
  double continuous_;
  double floor_;
  double limit_;
  bool derated_ = false;
  std::array<double, kBuckets + 1> impulse_{};  // N·s; a ring, one bucket more than the window
  int newest_ = 0;
  Nanos filled_ = 0;  // of the newest bucket
};

}  // namespace hapticd::realtime
