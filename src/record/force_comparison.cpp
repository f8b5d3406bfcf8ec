#include "record/force_comparison.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace hapticd::record {
namespace {

// atan2 instead of acos, which loses half of the digits near 0 and 180 degrees.
double angle_deg(const Vec3& a, const Vec3& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

ForceSample between(const ForceSample& a, const ForceSample& b, Nanos time) {
  const double share = static_cast<double>(time - a.time) / static_cast<double>(b.time - a.time);
  return {.time = time,
          .force_N = a.force_N + share * (b.force_N - a.force_N),
          .point_m = a.point_m + share * (b.point_m - a.point_m),
          .touching = a.touching && b.touching};
}

// Sums until finish() turns them into means.
class Sums {
 public:
  void add(const ForceSample& rendered, const ForceSample& reference) {
    if (errors_.samples++ == 0) errors_.first = reference.time;
    errors_.last = reference.time;
    addForces(rendered.force_N, reference.force_N, reference.time);
    addContact(rendered.force_N, reference.force_N);
    if (!rendered.touching) return;
    ++errors_.touching;
    errors_.rmsDistance_m += (rendered.point_m - reference.point_m).squaredNorm();
  }

  ForceErrors finish() {
    rootOfMean(errors_.rms_N, errors_.samples);
    mean(errors_.mean_N, errors_.samples);
    rootOfMean(errors_.rmsMagnitude_N, errors_.samples);
    rootOfMean(errors_.rmsReference_N, errors_.samples);
    rootOfMean(errors_.rmsAngle_deg, errors_.both);
    mean(errors_.meanAngle_deg, errors_.both);
    rootOfMean(errors_.rmsDistance_m, errors_.touching);
    return errors_;
  }

 private:
  void addForces(const Vec3& f, const Vec3& g, Nanos time) {
    const double error_N = (f - g).norm();
    const double magnitude_N = f.norm() - g.norm();
    errors_.rms_N += error_N * error_N;
    errors_.mean_N += error_N;
    errors_.rmsMagnitude_N += magnitude_N * magnitude_N;
    errors_.rmsReference_N += g.squaredNorm();
    if (error_N <= errors_.largest_N) return;
    errors_.largest_N = error_N;
    errors_.largestAt = time;
  }

  void addContact(const Vec3& f, const Vec3& g) {
    const bool felt = f.norm() >= kSmallestForce_N;
    const bool expected = g.norm() >= kSmallestForce_N;
    ++(felt && expected ? errors_.both
       : felt           ? errors_.onlyRendered
       : expected       ? errors_.onlyReference
                        : errors_.neither);
    if (!felt || !expected) return;
    const double angle = angle_deg(f, g);
    errors_.rmsAngle_deg += angle * angle;
    errors_.meanAngle_deg += angle;
  }

  static void mean(double& sum, std::size_t count) {
    if (count > 0) sum /= static_cast<double>(count);
  }
  static void rootOfMean(double& sum, std::size_t count) {
    mean(sum, count);
    sum = std::sqrt(sum);
  }

  ForceErrors errors_;
};

}  // namespace

ForceErrors compareForces(std::span<const ForceSample> rendered, std::span<const ForceSample> reference) {
  Sums sums;
  auto next = rendered.begin();
  for (const ForceSample& sample : reference) {
    next = std::find_if(next, rendered.end(), [&](const ForceSample& r) { return r.time >= sample.time; });
    if (next == rendered.end()) break;
    if (next->time == sample.time)
      sums.add(*next, sample);
    else if (next != rendered.begin())
      sums.add(between(*(next - 1), *next, sample.time), sample);
  }
  return sums.finish();
}

}  // namespace hapticd::record
