#include "realtime/render/passivity_controller.h"

#include <algorithm>

namespace hapticd::realtime {

Vec3 PassivityController::step(const SpringState& spring, const Vec3& hip_m, double period_s) noexcept {
  constexpr double kForgotten_s = 1;
  if (!helps()) return Vec3::Zero();
  if (!spring.known) {
    open_ = false;
    return Vec3::Zero();
  }
  if (!open_) {
    resume(hip_m);
    stored_J_ = spring.stored_J;  // what it holds at first was put there before
  }
  const bool touches = spring.stiffness_N_per_m > 0;
  elapsed_s_ += period_s;
  const Vec3 move = hip_m - hip_m_;
  book(spring, move);
  const bool seen = !move.isZero(0) || !touches;
  if (seen) {
    brake_N_ = touches ? brakeFor(spring, move) : Vec3(Vec3::Zero());
    hold_s_ = elapsed_s_;
    elapsed_s_ = 0;
  }
  // Some devices measure less often than the servo ticks: their positions repeat, and the brake of the last
  // motion acts until the next one is due.
  hold_s_ -= period_s;
  if (hold_s_ < -0.5 * period_s) brake_N_.setZero();
  free_s_ = touches ? 0 : free_s_ + period_s;
  if (free_s_ > kForgotten_s) account_J_ = 0;
  hip_m_ = hip_m;
  force_N_ = spring.force_N + brake_N_;
  stored_J_ = spring.stored_J;
  return brake_N_;
}

void PassivityController::resume(const Vec3& hip_m) noexcept {
  *this = PassivityController(bareDamping_Ns_per_m_);
  open_ = true;
  hip_m_ = hip_m;
}

void PassivityController::book(const SpringState& spring, const Vec3& move) noexcept {
  const double taken = -force_N_.dot(move) - (spring.stored_J - stored_J_);
  // What friction took long ago must not feed a later oscillation: the account holds no more than zero.
  const double bare_J = spring.beside ? 0 : bareDamping_Ns_per_m_ * move.squaredNorm() / elapsed_s_;
  account_J_ = std::min(0.0, account_J_ + taken + bare_J);
}

Vec3 PassivityController::brakeFor(const SpringState& spring, const Vec3& move) const noexcept {
  const double squared = move.squaredNorm();
  // Rounding of the stored energy is no debt.
  const double rounding = 1e-12 * (spring.stored_J + spring.stiffness_N_per_m * squared);
  if (account_J_ >= -rounding) return Vec3::Zero();
  // More than K T would drive the arm instead of braking it.
  const double damping = std::min(-account_J_ * elapsed_s_ / squared, spring.stiffness_N_per_m * elapsed_s_);
  const double pressed = std::max(0.0, spring.pressed_N);
  if (pressed == 0) return Vec3::Zero();
  Vec3 brake = -damping / elapsed_s_ * move;
  const double lifted = -brake.dot(spring.normal);
  if (lifted > pressed) brake *= pressed / lifted;
  if ((spring.force_N + brake).norm() > spring.most_N)
    brake *= std::clamp((spring.most_N - spring.force_N.norm()) / brake.norm(), 0.0, 1.0);
  return brake;
}

}  // namespace hapticd::realtime
