// A contact with what rests gives no more than the hand put into it.
//
// Between HIP and proxy is one spring, with the stiffness of what is near the proxy. Where the HIP passes the
// middle of a body, the proxy goes around it in one tick, from a soft surface to a place beside a stiff one,
// and a spring as long as the one before stores several times as much: it would throw the hand out. It acts
// with the share that stores what there was. The share returns slowly: within a second. The same where it
// goes from a face that yields, whose spring stores less, to a place beside one that does not.
#pragma once

#include "realtime/render/passivity_controller.h"

namespace hapticd::realtime {

/// One contact after the other. Servo thread: noexcept, no allocation.
class EnergyLimit {
 public:
  void reset() noexcept { *this = EnergyLimit(); }
  /// The share of `springs` that acts in this tick, 0 … 1. Not `limited`: something moves, or a command
  /// changed it; what is stored then is taken as it is.
  double step(const SpringState& springs, bool limited, const Vec3& hip_m, double period_s) noexcept;
  double share() const noexcept { return share_; }

 private:
  double share_ = 1;
  bool open_ = false;  // what follows is of the last tick
  bool whole_ = true;
  double stiffness_N_per_m_ = 0;
  double stored_J_ = 0;  // by what acted
  Vec3 force_N_ = Vec3::Zero();
  Vec3 hip_m_ = Vec3::Zero();
};

}  // namespace hapticd::realtime
