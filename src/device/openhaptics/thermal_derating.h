// Reduces the force limit while the motors are warm.
#pragma once

#include <algorithm>

namespace hapticd::device {

/// A force limit that falls slowly to the continuous force while the motors are warmer than 0.7, and rises
/// again below 0.5. step() is realtime: noexcept, no allocation, no lock.
class ThermalDerating {
 public:
  ThermalDerating(double peak_N, double continuous_N) noexcept
      : peak_N_(peak_N), continuous_N_(std::min(peak_N, continuous_N)), limit_N_(peak_N) {}

  /// Advances one tick of 1 ms at this temperature (0 cold … 1 hot) and returns the limit.
  double step(double temperature) noexcept {
    if (temperature > 0.7) limit_N_ *= 0.999;
    if (temperature < 0.5) limit_N_ *= 1.001;
    limit_N_ = std::clamp(limit_N_, continuous_N_, peak_N_);
    return limit_N_;
  }

 private:
  double peak_N_;
  double continuous_N_;
  double limit_N_;
};

}  // namespace hapticd::device
