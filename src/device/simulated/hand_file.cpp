#include "device/simulated/hand_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <system_error>

#include "base/printable.h"
#include "base/time.h"

namespace hapticd::device {
namespace {

// Beyond these, differences would leave 64 bits or a double.
constexpr double kLongest_s = 1e8;
constexpr double kFarthest_m = 1e6;
constexpr std::size_t kAbsent = static_cast<std::size_t>(-1);
constexpr std::string_view kRecordingBegins = "HAPTICS";  // its first line

// The cells of a row, trimmed and without quotes around them. Commas in quotes do not separate.
void split(std::string_view text, std::vector<std::string_view>& cells) {
  cells.clear();
  bool inQuotes = false;
  std::size_t begin = 0;
  for (std::size_t i = 0; i <= text.size(); ++i) {
    if (i < text.size() && text[i] == '"') inQuotes = !inQuotes;
    if (i < text.size() && (text[i] != ',' || inQuotes)) continue;
    std::string_view cell = trimmed(text.substr(begin, i - begin));
    if (cell.size() >= 2 && cell.front() == '"' && cell.back() == '"') cell = cell.substr(1, cell.size() - 2);
    cells.push_back(cell);
    begin = i + 1;
  }
}

// Where a file has what.
struct Columns {
  std::size_t count = 0;
  std::size_t time = kAbsent;
  std::size_t position = kAbsent;     ///< x, y, z
  std::size_t orientation = kAbsent;  ///< qx, qy, qz, qw
  std::size_t buttons = kAbsent;
  std::size_t device = kAbsent;
  bool nanoseconds = false;   ///< the time; seconds otherwise
  bool fromFirstRow = false;  ///< times are absolute: the hand begins at the first row
  std::string remark;
};

// t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons] without a header.
Columns unnamed(std::size_t count, const TextLine& line) {
  if (count > 9) line.fail("more than 9 columns");
  if (count != 4 && count != 5 && count != 8 && count != 9)
    line.fail(std::to_string(count) + " columns where 4, 5, 8 or 9 are expected");
  Columns columns;
  columns.count = count;
  columns.time = 0;
  columns.position = 1;
  if (count >= 8) columns.orientation = 4;
  if (count == 5 || count == 9) columns.buttons = count - 1;
  return columns;
}

std::size_t find(const std::vector<std::string_view>& names, std::string_view name) {
  const auto at = std::find(names.begin(), names.end(), name);
  return at == names.end() ? kAbsent : static_cast<std::size_t>(at - names.begin());
}

// The first of several columns in a row.
template <std::size_t N>
std::size_t findAll(const std::vector<std::string_view>& names, const std::array<std::string, N>& wanted) {
  const auto at = std::search(names.begin(), names.end(), wanted.begin(), wanted.end());
  return at == names.end() ? kAbsent : static_cast<std::size_t>(at - names.begin());
}

Columns named(const std::vector<std::string_view>& names, std::string_view text, const TextLine& line) {
  Columns columns;
  columns.count = names.size();
  std::string time;
  for (const char* name : {"time_ns", "t_s", "time_s"}) {
    columns.time = find(names, time = name);
    if (columns.time != kAbsent) break;
  }
  std::string prefix;
  for (const char* name : {"hip_", "hand_", ""}) {
    prefix = name;
    columns.position = findAll<3>(names, {prefix + "x_m", prefix + "y_m", prefix + "z_m"});
    if (columns.position != kAbsent) break;
  }
  if (columns.time == kAbsent || columns.position == kAbsent) {
    line.fail("header " + quoted(text) +
              " is not t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons] and has no columns "
              "time_ns,hip_x_m,hip_y_m,hip_z_m");
  }
  columns.orientation = findAll<4>(names, {"qx", "qy", "qz", "qw"});
  columns.buttons = find(names, "buttons");
  columns.device = find(names, "device");
  columns.nanoseconds = time == "time_ns";
  columns.fromFirstRow = time != "t_s";
  // What hapticd writes has time_ns and hip_x_m, what people write t_s and x_m.
  const bool written = time == "time_ns" && prefix == "hip_";
  const bool byHand = time == "t_s" && prefix.empty();
  if (!written && !byHand)
    columns.remark = "reads '" + time + "' and '" + prefix + "x_m', columns of an older version of hapticd";
  return columns;
}

Nanos readNanos(std::string_view text, std::size_t column, const TextLine& line) {
  Nanos value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size())
    line.fail("column " + std::to_string(column + 1) + " " + quoted(text) + " is not a whole number");
  return value;
}

Nanos readTime(std::string_view text, const Columns& columns, const TextLine& line) {
  if (columns.nanoseconds) return readNanos(text, columns.time, line);
  const double time_s = readNumber(text, columns.time, line);
  if (!columns.fromFirstRow && (time_s < 0 || time_s > kLongest_s))
    line.fail("time " + std::to_string(time_s) + " s is out of range");
  if (std::abs(time_s) > 9e9) line.fail("time " + std::to_string(time_s) + " s is out of range");
  return base::toNanos(time_s);
}

Quat readOrientation(const Quat& quaternion, const TextLine& line) {
  const double length = quaternion.norm();
  if (std::abs(length - 1) > 0.01)
    line.fail("quaternion of length " + std::to_string(length) + " is not a rotation");
  return quaternion.normalized();
}

std::uint32_t readButtons(double buttons, const TextLine& line) {
  if (buttons != std::floor(buttons) || buttons < 0 || buttons > 4294967295.0)
    line.fail("buttons " + std::to_string(buttons) + " is not a set of bits");
  return static_cast<std::uint32_t>(buttons);
}

}  // namespace

// Row by row into a HandFile.
class HandFile::Parser {
 public:
  Parser(HandFile& hand, const std::string& source) : hand_(hand), source_(source) {}

  void add(std::string_view content, std::size_t number) {
    const TextLine line{source_, number};
    if (isBinary(content) || content == kRecordingBegins)
      line.fail(
          "holds binary data: a hand is text with one row on each line; 'hapticd export --to csv' "
          "makes it of a recording");
    split(content, cells_);
    if (cells_.size() < 4 && content.find_first_of(";\t") != std::string_view::npos)
      line.fail("columns end at commas, and numbers have a decimal point, got " + quoted(content));
    if (columns_.count == 0 && !startsLikeANumber(content)) {
      columns_ = named(cells_, content, line);
      return;
    }
    if (columns_.count == 0) columns_ = unnamed(cells_.size(), line);
    if (cells_.size() != columns_.count) {
      line.fail(std::to_string(cells_.size()) + " columns where " + std::to_string(columns_.count) +
                " are expected");
    }
    if (isOfThisDevice()) addRow(line);
  }

  std::string remark() const {
    std::string text;
    const auto add = [&](const std::string& what) { text += (text.empty() ? "" : "; ") + what; };
    if (!columns_.remark.empty()) add(columns_.remark);
    if (otherDevices_) add("holds several devices, only the first is used: " + base::printable(device_));
    if (skipped_ > 0)
      add("skips " + std::to_string(skipped_) + " row(s) whose time is not after that of a row before");
    return text;
  }

 private:
  bool isOfThisDevice() {
    if (columns_.device == kAbsent) return true;
    const std::string_view device = cells_[columns_.device];
    if (hand_.rows_.empty()) device_ = device;
    otherDevices_ = otherDevices_ || device != device_;
    return device == device_;
  }

  double number(std::size_t column, const TextLine& line) const {
    return readNumber(cells_[column], column, line);
  }

  double coordinate(std::size_t column, const TextLine& line) const {
    const double value_m = number(column, line);
    if (std::abs(value_m) > kFarthest_m) {
      line.fail("column " + std::to_string(column + 1) + " " + quoted(cells_[column]) +
                " is a position beyond 1e6 m");
    }
    return value_m;
  }

  void addRow(const TextLine& line) {
    Nanos time = readTime(cells_[columns_.time], columns_, line);
    if (hand_.rows_.empty() && columns_.fromFirstRow) hand_.origin_ = time;
    const double duration_s = base::toSeconds(time) - base::toSeconds(hand_.origin_);
    if (duration_s > kLongest_s)
      line.fail("time " + std::to_string(base::toSeconds(time)) +
                " s is more than 1e8 s after the first row");
    // A client may write a report twice, or a late one after its successor; the wall clock may be set back.
    if (columns_.fromFirstRow && !hand_.rows_.empty() &&
        (duration_s < -kLongest_s || time - hand_.origin_ <= hand_.rows_.back().time)) {
      ++skipped_;
      return;
    }
    time -= hand_.origin_;
    if (!hand_.rows_.empty() && time <= hand_.rows_.back().time)
      line.fail("time " + std::to_string(base::toSeconds(time)) + " s is not after the row before");
    const std::size_t x = columns_.position;
    Row row{time, Vec3(coordinate(x, line), coordinate(x + 1, line), coordinate(x + 2, line)),
            Quat::Identity(), 0};
    if (const std::size_t q = columns_.orientation; q != kAbsent) {
      row.orientation = readOrientation(
          Quat(number(q + 3, line), number(q, line), number(q + 1, line), number(q + 2, line)), line);
    }
    if (columns_.buttons != kAbsent) row.buttons = readButtons(number(columns_.buttons, line), line);
    hand_.rows_.push_back(row);
  }

  HandFile& hand_;
  const std::string& source_;
  Columns columns_;
  std::vector<std::string_view> cells_;
  std::string device_;
  bool otherDevices_ = false;
  std::size_t skipped_ = 0;
};

std::shared_ptr<const HandFile> HandFile::load(const std::filesystem::path& file,
                                               const TrajectoryFormat& format) {
  if (Trajectory::isNameOf(file)) return of(Trajectory::load(file, format));
  return parse(readText(file), file.string());
}

std::shared_ptr<const HandFile> HandFile::parse(std::string_view text, const std::string& source) {
  std::shared_ptr<HandFile> hand(new HandFile);
  Parser parser(*hand, source);
  forEachLine(text, [&](std::string_view content, std::size_t number) {
    if (content.front() != '#') parser.add(content, number);
  });
  if (hand->rows_.empty()) throw HandFileError(source + ": no row with a hand in it");
  hand->remark_ = parser.remark();
  return hand;
}

std::shared_ptr<const HandFile> HandFile::of(const Trajectory& trajectory) {
  std::shared_ptr<HandFile> hand(new HandFile);
  hand->origin_ = trajectory.samples.front().time;
  for (const TrajectorySample& sample : trajectory.samples)
    hand->rows_.push_back({sample.time - hand->origin_, sample.position_m, Quat::Identity(), 0});
  hand->remark_ = trajectory.remark;
  return hand;
}

HandPose HandFile::at(Nanos sinceStart) const noexcept {
  const auto next = std::upper_bound(rows_.begin(), rows_.end(), sinceStart,
                                     [](Nanos t, const Row& row) { return t < row.time; });
  if (next == rows_.begin() || next == rows_.end()) {
    const Row& row = next == rows_.begin() ? rows_.front() : rows_.back();
    return {row.position_m, Vec3::Zero(), row.orientation, row.buttons};
  }
  const Row& a = *(next - 1);
  const Row& b = *next;
  const double s = static_cast<double>(sinceStart - a.time) / static_cast<double>(b.time - a.time);
  const Vec3 step_m = b.position_m - a.position_m;
  return {a.position_m + s * step_m, step_m / base::toSeconds(b.time - a.time),
          a.orientation.slerp(s, b.orientation), a.buttons};
}

}  // namespace hapticd::device
