// Passivity observer and controller (Hannaford & Ryu 2002) for the springs of resting surfaces.
//
// A sampled spring pushes with the force of the last tick and gives back a little more than it took: up to
// 1/2 K dx^2 a tick. An arm that nobody holds may dissipate less than that and bounces for ever. The observer
// books what the arm put into the springs of a contact, less what they store, plus what the arm dissipates
// without a hand. Where the account is negative, the controller brakes the arm until it is even.
#pragma once

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// What holds the HIP in a tick.
struct SpringState {
  Vec3 force_N = Vec3::Zero();  ///< of the springs and their friction, without dampers
  Vec3 normal = Vec3::Zero();   ///< of the contact, unit
  double pressed_N = 0;         ///< the contact force along it
  double stored_J = 0;
  double stiffness_N_per_m = 0;  ///< 0: nothing holds it, or something that moves
};

/// One contact after the other: an account starts at zero with each. Servo thread: noexcept, no allocation.
class PassivityController {
 public:
  /// `bareDamping_Ns_per_m`: of the arm without a hand; infinity: it never needs help.
  explicit PassivityController(double bareDamping_Ns_per_m) noexcept
      : bareDamping_Ns_per_m_(bareDamping_Ns_per_m) {}

  /// Ends the contact.
  void reset() noexcept { inContact_ = false; }
  /// The force to add in this tick, newtons: against the motion of the HIP since the last tick, exactly zero
  /// while the account is not negative. It never makes a surface pull.
  Vec3 step(const SpringState& spring, const Vec3& hip_m, double period_s) noexcept;

 private:
  double bareDamping_Ns_per_m_;
  bool inContact_ = false;
  double account_J_ = 0;
  Vec3 hip_m_ = Vec3::Zero();
  Vec3 force_N_ = Vec3::Zero();  // of spring and controller in the last tick
  double stored_J_ = 0;
};

}  // namespace hapticd::realtime
