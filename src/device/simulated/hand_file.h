// A recorded or scripted hand from a CSV file: t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons], or any file with the
// columns time_ns,hip_x_m,hip_y_m,hip_z_m that hapticd writes (record/sample.h); other columns are ignored.
// Files named *.traj are measured trajectories (trajectory_file.h).
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "device/simulated/hand_path.h"
#include "device/simulated/trajectory_file.h"

namespace hapticd::device {

/// Interpolates positions linearly and orientations by slerp; buttons stay until the next row. Before the
/// first row and after the last one the hand rests. With time_ns the hand begins at the first row, and rows
/// that repeat or precede their predecessor are skipped with a remark. A trajectory begins at its first
/// sample.
class HandFile final : public HandPath {
 public:
  /// `format` is for trajectories. Throws HandFileError.
  static std::shared_ptr<const HandFile> load(const std::filesystem::path& file,
                                              const TrajectoryFormat& format = {});
  /// A CSV file from text; `source` names it in errors.
  static std::shared_ptr<const HandFile> parse(std::string_view text, const std::string& source);
  static std::shared_ptr<const HandFile> of(const Trajectory& trajectory);

  HandPose at(Nanos sinceStart) const noexcept override;
  Nanos duration() const noexcept override { return rows_.back().time; }
  /// Time of the first row.
  Nanos begin() const noexcept { return rows_.front().time; }
  /// Time of the file at which the path starts.
  Nanos origin() const noexcept { return origin_; }
  std::size_t rows() const noexcept { return rows_.size(); }
  /// What a person should know about how the file was read, as the end of a sentence after its name; empty
  /// when nothing.
  const std::string& remark() const noexcept { return remark_; }

 private:
  struct Row {
    Nanos time;
    Vec3 position_m;
    Quat orientation;
    std::uint32_t buttons;
  };
  class Parser;
  HandFile() = default;

  std::vector<Row> rows_;
  Nanos origin_ = 0;
  std::string remark_;
};

}  // namespace hapticd::device
