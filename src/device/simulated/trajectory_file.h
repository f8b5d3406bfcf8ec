// A measured trajectory (.traj): positions of a probe and forces over time, one sample on each line of a
// text. docs/measured-trajectories.md says what is known of the files in the field, and what is assumed here.
#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.h"
#include "device/simulated/text_rows.h"
#include "geometry/types.h"

namespace hapticd::device {

using base::Nanos;
using geometry::Vec3;

/// Which column of a row holds what.
struct TrajectoryColumns {
  std::size_t count = 0;  ///< columns in a row, those to be skipped included
  std::size_t time = 0;
  std::array<std::size_t, 3> position{};
  std::optional<std::array<std::size_t, 3>> force;

  /// From names in the order of the columns: "t,x,y,z,fx,fy,fz", "-" for a column to skip. t, x, y and z are
  /// necessary; fx, fy and fz come together. Throws std::invalid_argument.
  static TrajectoryColumns parse(std::string_view names);
};

/// What the text of a trajectory does not say.
struct TrajectoryFormat {
  std::optional<TrajectoryColumns> columns;  ///< by their number unless set: t,x,y,z or t,x,y,z,fx,fy,fz
  double unit_m = 1e-3;                      ///< length of one unit of position
  double unit_s = 1;                         ///< duration of one unit of time
  bool forceOnSurface = false;               ///< forces act on the surface; they are negated
};

struct TrajectorySample {
  Nanos time = 0;  ///< as in the file; later than that of the sample before
  Vec3 position_m = Vec3::Zero();
  Vec3 force_N = Vec3::Zero();  ///< on the probe; zero if the file has no forces
};

struct Trajectory {
  std::vector<TrajectorySample> samples;  ///< at least one
  bool hasForce = false;
  /// What a person should know about how the file was read, as the end of a sentence after its name; empty
  /// when nothing.
  std::string remark;

  /// By its name, whatever the case: "probe.traj".
  static bool isNameOf(const std::filesystem::path& file);
  /// Throws HandFileError.
  static Trajectory load(const std::filesystem::path& file, const TrajectoryFormat& format = {});
  /// The same from text; `source` names it in errors.
  static Trajectory parse(std::string_view text, const std::string& source,
                          const TrajectoryFormat& format = {});
};

}  // namespace hapticd::device
