#include "realtime/render/passivity_controller.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {

Vec3 PassivityController::step(const SpringState& spring, const Vec3& hip_m, double period_s) noexcept {
  if (!std::isfinite(bareDamping_Ns_per_m_)) return Vec3::Zero();
  if (!(spring.stiffness_N_per_m > 0)) {
    inContact_ = false;
    return Vec3::Zero();
  }
  const Vec3 move = inContact_ ? Vec3(hip_m - hip_m_) : Vec3(Vec3::Zero());
  const double squared = move.squaredNorm();
  if (inContact_) {
    const double taken = -force_N_.dot(move) - (spring.stored_J - stored_J_);
    // What friction took long ago must not feed a later oscillation: the account holds no more than zero.
    account_J_ = std::min(0.0, account_J_ + taken + bareDamping_Ns_per_m_ * squared / period_s);
  } else {
    account_J_ = 0;
  }
  Vec3 brake = Vec3::Zero();
  // Rounding of the stored energy is no debt.
  const double rounding = 1e-12 * (spring.stored_J + spring.stiffness_N_per_m * squared);
  if (account_J_ < -rounding && squared > 0) {
    // More than K T would drive the arm instead of braking it.
    const double damping = std::min(-account_J_ * period_s / squared, spring.stiffness_N_per_m * period_s);
    brake = -damping / period_s * move;
    const double pressed = std::max(0.0, spring.pressed_N);
    const double lifted = -brake.dot(spring.normal);
    if (lifted > pressed) brake *= pressed / lifted;
    if (pressed == 0) brake.setZero();
  }
  inContact_ = true;
  hip_m_ = hip_m;
  force_N_ = spring.force_N + brake;
  stored_J_ = spring.stored_J;
  return brake;
}

}  // namespace hapticd::realtime
