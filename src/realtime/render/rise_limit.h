// The guard lets a force grow by a limited rate and fall at once. A contact that grows faster is late: it
// takes little on the way in, gives the whole spring on the way out, and throws the hand back faster than it
// came.
//
// Where surfaces at rest would outrun the limit, all of their force is lowered by one share, to what the
// guard lets through. To a hit at speed v a surface is a spring of at most rate / v. The share returns
// slowly, so that the spring gives no more than it took: within a second.
#pragma once

#include <limits>

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Vec3;

/// One contact after the other. Servo thread: noexcept, no allocation.
class RiseLimit {
 public:
  /// Infinity: no limit.
  explicit RiseLimit(double rate_N_per_s) noexcept : rate_N_per_s_(rate_N_per_s) {}

  void reset() noexcept { *this = RiseLimit(rate_N_per_s_); }
  /// The share of the contact force `force_N` that acts in this tick, `beside_N` what other contacts, which
  /// limit themselves. What moves or changes (not `known`) is not lowered, but a share that was lowered
  /// before goes on.
  double step(const Vec3& force_N, bool known, double period_s, const Vec3& beside_N = Vec3::Zero()) noexcept;
  /// The largest force that is in time in this tick, newtons.
  double most_N() const noexcept { return most_N_; }
  /// What acts in this tick: the contact force and all that is added to keep it passive.
  void acts(const Vec3& force_N) noexcept { acted_N_ = force_N.norm(); }

 private:
  double rate_N_per_s_;
  double share_ = 1;
  double acted_N_ = 0;  // in the last tick
  double most_N_ = std::numeric_limits<double>::infinity();
};

}  // namespace hapticd::realtime
