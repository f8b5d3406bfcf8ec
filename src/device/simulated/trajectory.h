// Measured motion with measured force, from text in columns: the .traj files of the Stanford and Rutgers
// haptic data (Ruffaldi, Morris, Edmunds, Barbagli & Pai, HAPTICS 2006) and others like them.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::device {

struct TrajectorySample {
  base::Nanos time = 0;  ///< since the first sample
  geometry::Vec3 position_m = geometry::Vec3::Zero();
  geometry::Vec3 force_N = geometry::Vec3::Zero();  ///< zero where the file has none
};
using Trajectory = std::vector<TrajectorySample>;

/// What the columns of a file are.
struct TrajectoryFormat {
  /// Of t, x, y, z, fx, fy, fz and - for a column without meaning; separated by commas. t, x, y, z must be
  /// there.
  std::string columns = "t,x,y,z,fx,fy,fz";
  double unitsPerMetre = 1000;
  double unitsPerSecond = 1;
};

/// Rows of numbers separated by white space, commas or semicolons; lines behind '#' are comments. Rows that
/// repeat the time of their predecessor are left out. Throws HandFileError, which names line and value, also
/// for a format that makes no sense.
Trajectory loadTrajectory(const std::filesystem::path& file, const TrajectoryFormat& format);
/// The same from text; `source` names it in errors.
Trajectory parseTrajectory(std::string_view text, const std::string& source, const TrajectoryFormat& format);

}  // namespace hapticd::device
