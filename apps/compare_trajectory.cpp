#include "compare_trajectory.h"

#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace hapticd::apps {
namespace {

using record::ForceErrors;

// Longer than any trajectory; nanoseconds between clocks further apart may not fit into Nanos.
constexpr double kFarApart_s = 1e9;

void requireNearClocks(const std::string& file, base::Nanos first, base::Nanos origin) {
  const double after_s = base::toSeconds(first) - base::toSeconds(origin);
  if (std::abs(after_s) <= kFarApart_s) return;
  char text[64];
  std::snprintf(text, sizeof text, " begins %.1f s %s the hand", std::abs(after_s),
                after_s > 0 ? "after" : "before");
  throw std::runtime_error(file + text + ": both need the same clock");
}

void print(const ForceErrors& errors) {
  std::printf("force       RMS error %.4g N", errors.rms_N);
  if (errors.rmsReference_N > 0)
    std::printf(" (%.3g %% of the RMS force, %.4g N)", 100 * errors.rms_N / errors.rmsReference_N,
                errors.rmsReference_N);
  std::printf(", mean %.4g N, at most %.4g N (at %.3f s)\n", errors.mean_N, errors.largest_N,
              base::toSeconds(errors.largestAt));
  std::printf("magnitude   RMS error %.4g N\n", errors.rmsMagnitude_N);
  if (errors.both > 0)
    std::printf("direction   RMS angle %.4g deg, mean %.4g deg, over %zu samples\n", errors.rmsAngle_deg,
                errors.meanAngle_deg, errors.both);
  std::printf("contact     both %zu, only rendered %zu, only in the file %zu, neither %zu (from %g N on)\n",
              errors.both, errors.onlyRendered, errors.onlyReference, errors.neither,
              record::kSmallestForce_N);
  if (errors.touching > 0)
    std::printf("proxy       RMS distance %.4g mm from the file's positions, over %zu samples\n",
                errors.rmsDistance_m * 1e3, errors.touching);
}

void printHints(const std::string& file, const ForceErrors& errors) {
  if (errors.both > 0 && errors.meanAngle_deg > 90)
    std::fprintf(stderr,
                 "hapticd: the forces in %s point the other way: if they act on the surface instead of the "
                 "probe, add --traj-force surface\n",
                 file.c_str());
  if (errors.touching == 0)
    std::fprintf(stderr,
                 "hapticd: the hand touched nothing at these times: do mesh and trajectory have the same "
                 "origin, axes and unit?\n");
}

}  // namespace

std::vector<record::ForceSample> loadReference(const std::string& file,
                                               const device::TrajectoryFormat& format, base::Nanos origin) {
  const device::Trajectory trajectory = device::Trajectory::load(file, format);
  if (!trajectory.hasForce)
    throw std::runtime_error(file + " has no forces to compare with: it has no columns fx, fy and fz");
  if (!trajectory.remark.empty())
    std::fprintf(stderr, "hapticd: %s: %s\n", file.c_str(), trajectory.remark.c_str());
  requireNearClocks(file, trajectory.samples.front().time, origin);
  std::vector<record::ForceSample> samples;
  samples.reserve(trajectory.samples.size());
  for (const device::TrajectorySample& sample : trajectory.samples)
    samples.push_back(
        {.time = sample.time - origin, .force_N = sample.force_N, .point_m = sample.position_m});
  return samples;
}

void printComparison(const std::string& file, const std::vector<record::ForceSample>& rendered,
                     const std::vector<record::ForceSample>& reference) {
  const ForceErrors errors = record::compareForces(rendered, reference);
  if (errors.samples == 0) {
    char text[160];
    std::snprintf(text, sizeof text,
                  " has samples from %.3f s to %.3f s, but the hand moves from %.3f s to %.3f s",
                  base::toSeconds(reference.front().time), base::toSeconds(reference.back().time),
                  base::toSeconds(rendered.front().time), base::toSeconds(rendered.back().time));
    throw std::runtime_error(file + text + ": both need the same clock");
  }
  std::printf("compared    %zu of %zu samples of %s, %.3f s to %.3f s\n", errors.samples, reference.size(),
              file.c_str(), base::toSeconds(errors.first), base::toSeconds(errors.last));
  print(errors);
  printHints(file, errors);
}

}  // namespace hapticd::apps
