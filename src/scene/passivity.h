// How stiff and damped a wall may be before the sampled loop feeds energy to the hand.
#pragma once

#include <limits>

#include "scene/config.h"

namespace hapticd::scene {

/// Of springs and dampers that act at the same time.
struct SpringSum {
  double stiffness_N_per_m = 0;
  double damping_Ns_per_m = 0;
};

/// K (T/2 + t_d) + B < b (Colgate and Schenkel 1997, with the transport delay added to half a period).
class PassivityBound {
 public:
  explicit PassivityBound(const SceneConfig& config)
      : delay_s_(config.servoPeriod_s / 2 + config.transportDelay_s),
        damping_Ns_per_m_(config.raw ? std::numeric_limits<double>::infinity()
                                     : kMargin * config.ownDamping_Ns_per_m) {}

  double maxStiffness_N_per_m() const { return damping_Ns_per_m_ / delay_s_; }
  /// What they take of the bound, in N s/m.
  double loadOf(const SpringSum& sum) const {
    return sum.stiffness_N_per_m * delay_s_ + sum.damping_Ns_per_m;
  }
  /// The factor, at most 1, that keeps all that makes up the load together within the bound.
  double shareOf(double load_Ns_per_m) const {
    return load_Ns_per_m > damping_Ns_per_m_ ? damping_Ns_per_m_ / load_Ns_per_m : 1;
  }
  /// What damping is left beside a stiffness.
  double maxDamping_Ns_per_m(double stiffness_N_per_m) const {
    return damping_Ns_per_m_ - stiffness_N_per_m * delay_s_;
  }

 private:
  static constexpr double kMargin = 0.999;  // the bound itself is not passive
  double delay_s_;
  double damping_Ns_per_m_;
};

}  // namespace hapticd::scene
