#include "realtime/render/rise_limit.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {

double RiseLimit::step(const Vec3& force_N, bool known, double period_s) noexcept {
  constexpr double kReturn_s = 1;
  if (!std::isfinite(rate_N_per_s_)) return 1;
  most_N_ = acted_N_ + rate_N_per_s_ * period_s;
  const double size_N = force_N.norm();
  share_ = size_N > 0 ? std::min(1.0, share_ + period_s / kReturn_s) : 1;
  if (known && share_ * size_N > most_N_) share_ = most_N_ / size_N;
  return share_;
}

}  // namespace hapticd::realtime
