// hapticd render --compare: rendered forces beside those of a trajectory.
#pragma once

#include <string>
#include <vector>

#include "device/simulated/trajectory_file.h"
#include "record/force_comparison.h"

namespace hapticd::apps {

/// Positions and forces of a trajectory; `origin` is the time in it that the hand calls zero. Throws with a
/// remedy in the text when it holds no forces.
std::vector<record::ForceSample> loadReference(const std::string& file,
                                               const device::TrajectoryFormat& format, base::Nanos origin);

/// Prints the error measures. Throws when the two have no time in common.
void printComparison(const std::string& file, const std::vector<record::ForceSample>& rendered,
                     const std::vector<record::ForceSample>& reference);

}  // namespace hapticd::apps
