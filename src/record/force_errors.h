// How far rendered forces are from measured ones: the measures of Ruffaldi, Morris, Edmunds, Barbagli & Pai,
// "Standardized Evaluation of Haptic Rendering Systems" (HAPTICS 2006), as far as forces go.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::record {

/// A force at a time.
struct TimedForce {
  base::Nanos time = 0;
  geometry::Vec3 force_N = geometry::Vec3::Zero();
};

/// Over the samples of the reference. A force below 0.01 N counts as no contact.
struct ForceErrors {
  std::size_t samples = 0;
  std::size_t either = 0;       ///< contact in one of the two
  std::size_t both = 0;         ///< contact in both
  double rms_N = 0;             ///< of |F - F_ref| where either has contact
  double largest_N = 0;         ///< of |F - F_ref|
  double magnitudeRms_N = 0;    ///< of |F| - |F_ref| where either has contact
  double rmsDirection_deg = 0;  ///< of the angle between F and F_ref where both have contact
  double meanCosine = 0;        ///< of that angle; near -1 where one of the two has the opposite sign
};

/// Rendered forces are interpolated linearly at the times of the reference; samples beyond them do not count.
/// Both in order of time. Nothing when no sample is left.
std::optional<ForceErrors> forceErrors(const std::vector<TimedForce>& rendered,
                                       const std::vector<TimedForce>& reference);

}  // namespace hapticd::record
