#include "realtime/render/rise_limit.h"

#include <algorithm>
#include <cmath>

namespace hapticd::realtime {

namespace {

// The largest share of `force_N` with which the sum is no larger than `most_N`; else the one with the
// smallest sum.
double shareInTime(double most_N, const Vec3& force_N, const Vec3& beside_N) noexcept {
  if (beside_N.isZero(0)) return most_N / force_N.norm();
  const double square = force_N.squaredNorm();
  const double half = beside_N.dot(force_N) / square;
  const double root = half * half - (beside_N.squaredNorm() - most_N * most_N) / square;
  return std::max(0.0, std::sqrt(std::max(0.0, root)) - half);
}

}  // namespace

double RiseLimit::step(const Vec3& force_N, bool known, double period_s, const Vec3& beside_N) noexcept {
  constexpr double kReturn_s = 1;
  if (!std::isfinite(rate_N_per_s_)) return 1;
  most_N_ = acted_N_ + rate_N_per_s_ * period_s;
  const double size_N = force_N.norm();
  share_ = size_N > 0 ? std::min(1.0, share_ + period_s / kReturn_s) : 1;
  if (known && size_N > 0 && (beside_N + share_ * force_N).norm() > most_N_)
    share_ = std::min(share_, shareInTime(most_N_, force_N, beside_N));
  return share_;
}

}  // namespace hapticd::realtime
