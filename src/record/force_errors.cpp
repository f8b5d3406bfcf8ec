#include "record/force_errors.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hapticd::record {
namespace {

using geometry::Vec3;

constexpr double kContact_N = 0.01;

Vec3 interpolated(const std::vector<TimedForce>& forces, base::Nanos time) {
  const auto next = std::lower_bound(forces.begin(), forces.end(), time,
                                     [](const TimedForce& f, base::Nanos t) { return f.time < t; });
  if (next->time == time) return next->force_N;
  const TimedForce& before = *(next - 1);
  const double share =
      static_cast<double>(time - before.time) / static_cast<double>(next->time - before.time);
  return before.force_N + share * (next->force_N - before.force_N);
}

}  // namespace

std::optional<ForceErrors> forceErrors(const std::vector<TimedForce>& rendered,
                                       const std::vector<TimedForce>& reference) {
  ForceErrors errors;
  double squares = 0;
  double magnitudeSquares = 0;
  double angleSquares = 0;
  double cosines = 0;
  for (const TimedForce& sample : reference) {
    if (rendered.empty() || sample.time < rendered.front().time || sample.time > rendered.back().time)
      continue;
    ++errors.samples;
    const Vec3 force = interpolated(rendered, sample.time);
    const double magnitude = force.norm();
    const double measured = sample.force_N.norm();
    const double off = (force - sample.force_N).norm();
    errors.largest_N = std::max(errors.largest_N, off);
    if (magnitude < kContact_N && measured < kContact_N) continue;
    ++errors.either;
    squares += off * off;
    magnitudeSquares += (magnitude - measured) * (magnitude - measured);
    if (magnitude < kContact_N || measured < kContact_N) continue;
    ++errors.both;
    const double cosine = std::clamp(force.dot(sample.force_N) / (magnitude * measured), -1.0, 1.0);
    const double angle = std::atan2(force.cross(sample.force_N).norm(), force.dot(sample.force_N));
    cosines += cosine;
    angleSquares += angle * angle;
  }
  if (errors.samples == 0) return std::nullopt;
  const auto either = static_cast<double>(std::max<std::size_t>(errors.either, 1));
  const auto both = static_cast<double>(std::max<std::size_t>(errors.both, 1));
  errors.rms_N = std::sqrt(squares / either);
  errors.magnitudeRms_N = std::sqrt(magnitudeSquares / either);
  errors.rmsDirection_deg = std::sqrt(angleSquares / both) * 180 / std::numbers::pi;
  errors.meanCosine = cosines / both;
  return errors;
}

}  // namespace hapticd::record
