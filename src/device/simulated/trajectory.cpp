#include "device/simulated/trajectory.h"

#include <algorithm>
#include <array>

#include "device/simulated/text_line.h"

namespace hapticd::device {
namespace {

constexpr double kLongest_s = 1e8;
constexpr std::array<std::string_view, 7> kNames{"t", "x", "y", "z", "fx", "fy", "fz"};

std::vector<std::string_view> split(std::string_view text, std::string_view separators) {
  std::vector<std::string_view> cells;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of(separators), text.size());
    if (end > 0) cells.push_back(text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return cells;
}

// For each column, the index of its name; kNames.size() for one without meaning.
std::vector<std::size_t> columnsOf(const TrajectoryFormat& format) {
  std::vector<std::size_t> columns;
  std::array<int, kNames.size() + 1> count{};
  for (const std::string_view name : split(format.columns, ",")) {
    const auto at = std::find(kNames.begin(), kNames.end(), name);
    if (at == kNames.end() && name != "-")
      throw HandFileError("columns '" + format.columns + "': '" + std::string(name) +
                          "' is none of t, x, y, z, fx, fy, fz and -");
    columns.push_back(static_cast<std::size_t>(at - kNames.begin()));
    ++count[columns.back()];
  }
  for (std::size_t i = 0; i < kNames.size(); ++i) {
    if (count[i] > 1 || (i < 4 && count[i] == 0))
      throw HandFileError("columns '" + format.columns + "': '" + std::string(kNames[i]) +
                          "' must be there once");
  }
  return columns;
}

}  // namespace

Trajectory parseTrajectory(std::string_view text, const std::string& source, const TrajectoryFormat& format) {
  const std::vector<std::size_t> columns = columnsOf(format);
  Trajectory trajectory;
  double begin_s = 0;
  forEachLine(text, source, [&](const TextLine& line, std::string_view content) {
    const std::vector<std::string_view> cells = split(content, " \t,;");
    if (cells.size() != columns.size())
      line.fail(std::to_string(cells.size()) + " numbers where '" + format.columns + "' has " +
                std::to_string(columns.size()));
    std::array<double, kNames.size() + 1> values{};
    for (std::size_t i = 0; i < cells.size(); ++i) values[columns[i]] = line.readNumber(cells[i], i);
    const double time_s = values[0] / format.unitsPerSecond;
    if (trajectory.empty()) begin_s = time_s;
    if (!(std::abs(time_s - begin_s) <= kLongest_s))
      line.fail("time " + std::to_string(time_s) + " s is out of range: is it in milliseconds?");
    TrajectorySample sample;
    sample.time = base::toNanos(time_s - begin_s);
    sample.position_m = geometry::Vec3(values[1], values[2], values[3]) / format.unitsPerMetre;
    if (!sample.position_m.allFinite()) line.fail("the position is out of range");
    sample.force_N = {values[4], values[5], values[6]};
    if (!trajectory.empty() && sample.time < trajectory.back().time)
      line.fail("time " + std::to_string(time_s) + " s is before that of the row before");
    if (trajectory.empty() || sample.time > trajectory.back().time) trajectory.push_back(sample);
  });
  if (trajectory.empty()) throw HandFileError(source + ": no row with a sample in it");
  return trajectory;
}

Trajectory loadTrajectory(const std::filesystem::path& file, const TrajectoryFormat& format) {
  return parseTrajectory(readHandFile(file), file.string(), format);
}

}  // namespace hapticd::device
