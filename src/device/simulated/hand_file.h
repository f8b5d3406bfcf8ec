// A recorded or scripted hand from a CSV file: t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons].
#pragma once

#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "device/simulated/hand_path.h"

namespace hapticd::device {

/// A file that cannot be read as a hand; the text names file, line and value.
class HandFileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Positions between rows are interpolated linearly, orientations by slerp; buttons stay until the next row.
/// Before the first row and after the last the hand rests there.
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

 private:
  struct Row {
    Nanos time;
    Vec3 position_m;
    Quat orientation;
    std::uint32_t buttons;
  };
  HandFile() = default;

  std::vector<Row> rows_;
};

}  // namespace hapticd::device
