#include "realtime/render/energy_limit.h"

#include <algorithm>

namespace hapticd::realtime {

double EnergyLimit::step(const SpringState& springs, bool limited, const Vec3& hip_m,
                         double period_s) noexcept {
  constexpr double kReturn_s = 1;
  constexpr double kRounding = 1e-9;
  const bool touches = springs.stiffness_N_per_m > 0;
  limited = limited && touches;
  const double before = share_;
  share_ = touches ? std::min(1.0, share_ + period_s / kReturn_s) : 1;
  // A proxy that stopped on its way may be nearer to the HIP there than where it comes to rest.
  const bool arrives = !whole_ && springs.stiffness_N_per_m <= (1 + kRounding) * stiffness_N_per_m_;
  if (limited && open_ && !arrives) {
    const Vec3 move = hip_m - hip_m_;
    const double paid_J = -std::min(force_N_.dot(move), springs.force_N.dot(move));
    // A spring to a proxy that stays, or comes nearer, stores no more than its force times the way, and this.
    const double bend_J = 0.5 * std::max(stiffness_N_per_m_, springs.stiffness_N_per_m) * move.squaredNorm();
    const double returned_J = (share_ - before) * springs.stored_J;
    const double most_J = std::max(0.0, stored_J_ + paid_J + bend_J + returned_J);
    if (share_ * springs.stored_J > (1 + kRounding) * most_J) share_ = most_J / springs.stored_J;
  }
  open_ = limited;
  whole_ = springs.whole;
  stiffness_N_per_m_ = springs.stiffness_N_per_m;
  stored_J_ = share_ * springs.stored_J;
  force_N_ = share_ * springs.force_N;
  hip_m_ = hip_m;
  return share_;
}

}  // namespace hapticd::realtime
