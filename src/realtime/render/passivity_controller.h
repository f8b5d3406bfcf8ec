// Passivity observer and controller (Hannaford & Ryu 2002) for the springs of resting surfaces.
//
// A sampled spring pushes with the force of the last tick and gives back a little more than it took: up to
// 1/2 K dx^2 a tick. An arm that nobody holds may dissipate less than that and bounces for ever. The observer
// books what the arm put into the springs of a contact, less what they store, plus what the arm dissipates
// without a hand. Where the account is negative, the controller brakes the arm until it is even.
#pragma once

#include <cmath>
#include <limits>

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// What holds the HIP in a tick; all zero in free space, where only the last force of a contact is booked.
struct SpringState {
  bool known = true;            ///< false: something moves or changes, which nobody books
  Vec3 force_N = Vec3::Zero();  ///< of the springs and their friction, without dampers
  Vec3 normal = Vec3::Zero();   ///< of the contact, unit
  double pressed_N = 0;         ///< the contact force along it
  double stored_J = 0;
  double stiffness_N_per_m = 0;  ///< 0: nothing holds it
  bool whole = true;             ///< false: the proxy is still on its way
  bool beside = false;           ///< another account counts what the arm dissipates without a hand
  /// Of springs and brake: what is more comes late.
  double most_N = std::numeric_limits<double>::infinity();

  void scale(double share) noexcept {
    force_N *= share;
    pressed_N *= share;
    stored_J *= share;
    stiffness_N_per_m *= share;
  }
};

/// An account begins at zero. It ends where something moves or changes; a debt is forgotten after a second
/// without contact. Servo thread: noexcept, no allocation.
class PassivityController {
 public:
  /// `bareDamping_Ns_per_m`: of the arm without a hand; infinity: it never needs help.
  explicit PassivityController(double bareDamping_Ns_per_m) noexcept
      : bareDamping_Ns_per_m_(bareDamping_Ns_per_m) {}

  /// False where step() has nothing to do.
  bool helps() const noexcept { return std::isfinite(bareDamping_Ns_per_m_); }
  /// Ends the account.
  void reset() noexcept { open_ = false; }
  /// Begins one in free space.
  void resume(const Vec3& hip_m) noexcept;
  /// In free space: the state is that after resume().
  bool isEven() const noexcept { return !helps() || (open_ && account_J_ == 0); }
  /// The force to add in this tick, newtons: against the motion of the HIP since it was last seen to move,
  /// exactly zero while the account is not negative. It never makes a surface pull.
  Vec3 step(const SpringState& spring, const Vec3& hip_m, double period_s) noexcept;

 private:
  void book(const SpringState& spring, const Vec3& move) noexcept;
  Vec3 brakeFor(const SpringState& spring, const Vec3& move) const noexcept;

  double bareDamping_Ns_per_m_;
  bool open_ = false;
  double account_J_ = 0;
  double free_s_ = 0;     // since the last contact
  double elapsed_s_ = 0;  // since the HIP was last seen to move
  double hold_s_ = 0;     // how much longer the brake acts while the HIP is not seen to move
  Vec3 hip_m_ = Vec3::Zero();
  Vec3 brake_N_ = Vec3::Zero();
  Vec3 force_N_ = Vec3::Zero();  // of spring and brake in the last tick
  double stored_J_ = 0;
};

}  // namespace hapticd::realtime
