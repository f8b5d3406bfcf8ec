// A recorded or scripted hand from a CSV file: t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons], or any file with the
// columns time_ns,hip_x_m,hip_y_m,hip_z_m that hapticd writes (record/sample.h); other columns are ignored.
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "device/simulated/hand_path.h"

namespace hapticd::device {

/// The file cannot be read as a hand; the text names file, line and value.
class HandFileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Interpolates positions linearly and orientations by slerp; buttons stay until the next row. Before the
/// first row and after the last one the hand rests. With time_ns the hand begins at the first row, and rows
/// that repeat or precede their predecessor are ignored.
class HandFile final : public HandPath {
 public:
  /// Throws HandFileError.
  static std::shared_ptr<const HandFile> load(const std::filesystem::path& file);
  /// The same from text; `source` names it in errors.
  static std::shared_ptr<const HandFile> parse(std::string_view text, const std::string& source);

  HandPose at(Nanos sinceStart) const noexcept override;
  Nanos duration() const noexcept override { return rows_.back().time; }
  /// Time of the first row.
  Nanos begin() const noexcept { return rows_.front().time; }
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
  std::string remark_;
};

}  // namespace hapticd::device
