// How far rendered forces are from the forces of a reference: measured ones, or those of another renderer.
#pragma once

#include <cstddef>
#include <span>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::record {

using base::Nanos;
using geometry::Vec3;

/// A force at one time, and the point on the surface that it belongs to.
struct ForceSample {
  Nanos time = 0;
  Vec3 force_N = Vec3::Zero();
  Vec3 point_m = Vec3::Zero();  ///< the proxy of a rendered sample
  bool touching = false;        ///< of a rendered sample
};

/// A smaller force counts as none: it has no meaningful direction.
constexpr double kSmallestForce_N = 0.05;

/// Over the samples of the reference; docs/measured-trajectories.md has the formulas. f is the rendered
/// force, g that of the reference.
struct ForceErrors {
  std::size_t samples = 0;  ///< of the reference, between the first and the last rendered one
  Nanos first = 0;
  Nanos last = 0;
  double rms_N = 0;      ///< of |f - g|
  double mean_N = 0;     ///< of |f - g|
  double largest_N = 0;  ///< |f - g|
  Nanos largestAt = 0;
  double rmsMagnitude_N = 0;  ///< of |f| - |g|
  double rmsReference_N = 0;  ///< of |g|

  std::size_t both = 0;  ///< |f| and |g| are at least kSmallestForce_N; the others partition the rest
  std::size_t onlyRendered = 0;
  std::size_t onlyReference = 0;
  std::size_t neither = 0;
  double rmsAngle_deg = 0;   ///< between f and g, over `both`
  double meanAngle_deg = 0;  ///< the same

  std::size_t touching = 0;  ///< the rendered samples around it touch
  double rmsDistance_m = 0;  ///< between the points, over `touching`
};

/// Both in the order of time, on one clock. The rendered ones are interpolated linearly to the times of the
/// reference, whose noise therefore stays as it is.
ForceErrors compareForces(std::span<const ForceSample> rendered, std::span<const ForceSample> reference);

}  // namespace hapticd::record
