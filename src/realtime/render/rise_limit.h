// The guard lets a force grow by a limited rate and fall at once. A contact that grows faster is late: it
// takes little on the way in, gives the whole spring on the way out, and throws the hand back faster than it
// came.
//
// Where surfaces at rest would outrun the limit, all of their force is lowered by one share: to what the
// guard lets through, and to the energy that the hand has put in. To a hit at speed v a surface is a spring
// of at most rate / v. The share returns within a second.
#pragma once

#include <limits>

#include "realtime/render/passivity_controller.h"

namespace hapticd::realtime {

/// One contact after the other. Servo thread: noexcept, no allocation.
class RiseLimit {
 public:
  /// Infinity: no limit.
  explicit RiseLimit(double rate_N_per_s = std::numeric_limits<double>::infinity()) noexcept
      : rate_N_per_s_(rate_N_per_s) {}

  void reset() noexcept { *this = RiseLimit(rate_N_per_s_); }
  /// Begins in free space.
  void resume(const Vec3& hip_m) noexcept;
  /// The share of the contact force that acts in this tick. `force_N` is all of it. A force that `spring`
  /// does not know is not lowered; a share that was lowered before goes on.
  double step(const SpringState& spring, const Vec3& force_N, const Vec3& hip_m, double period_s) noexcept;
  /// The largest force that is in time in this tick, newtons.
  double most_N() const noexcept { return most_N_; }
  /// What acts in this tick, with all that is added to the contact force to keep it passive.
  void acts(const Vec3& force_N) noexcept { acted_N_ = force_N.norm(); }

 private:
  double rate_N_per_s_;
  bool open_ = false;  // the HIP of the last tick is known
  double share_ = 1;
  double energy_J_ = 0;  // that the hand has put in, at most what the springs store
  Vec3 hip_m_ = Vec3::Zero();
  Vec3 force_N_ = Vec3::Zero();  // of the contact in the last tick
  double acted_N_ = 0;           // in the last tick
  double most_N_ = std::numeric_limits<double>::infinity();
};

}  // namespace hapticd::realtime
