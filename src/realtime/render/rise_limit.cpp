#include "realtime/render/rise_limit.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {

void RiseLimit::resume(const Vec3& hip_m) noexcept {
  reset();
  open_ = true;
  hip_m_ = hip_m;
}

double RiseLimit::step(const SpringState& spring, const Vec3& force_N, const Vec3& hip_m,
                       double period_s) noexcept {
  constexpr double kReturn_s = 1;
  if (!std::isfinite(rate_N_per_s_)) return 1;
  const double returns = period_s / kReturn_s;
  most_N_ = acted_N_ + rate_N_per_s_ * period_s;
  const double size_N = force_N.norm();
  if (size_N == 0) {
    share_ = 1;
    energy_J_ = 0;
  } else if (!open_ || !spring.known) {
    share_ = std::min(1.0, share_ + returns);
    energy_J_ = share_ * spring.stored_J;
  } else {
    const Vec3 move = hip_m - hip_m_;
    const double half_J = 0.5 * force_N.dot(move);  // of the whole force; positive: given to the hand
    double put_J = energy_J_ - 0.5 * force_N_.dot(move);
    share_ = std::min({1.0, share_ + returns, most_N_ / size_N});
    // The share at which put_J - share * half_J is what the springs store, with a little for its return.
    const double whole_J = spring.stored_J + half_J;
    if (share_ < 1) put_J += returns * spring.stored_J;
    if (share_ < 1 && whole_J > 0) share_ = std::clamp(put_J / whole_J, 0.0, share_);
    energy_J_ = std::min(put_J - share_ * half_J, share_ * spring.stored_J);
  }
  open_ = true;
  hip_m_ = hip_m;
  force_N_ = share_ * force_N;
  return share_;
}

}  // namespace hapticd::realtime
