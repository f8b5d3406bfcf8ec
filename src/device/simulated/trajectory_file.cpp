#include "device/simulated/trajectory_file.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace hapticd::device {
namespace {

// Beyond these a unit is wrong, or the arithmetic of a renderer would overflow.
constexpr double kFarthestSample_m = 1e3;
constexpr double kStrongest_N = 1e6;
constexpr double kLatest_s = 9e9;
constexpr double kLongestTrajectory_s = 1e8;
// Slower files exist, but times in milliseconds are likelier.
constexpr double kSlowest_Hz = 10;

std::string_view withoutComment(std::string_view text) {
  return trimmed(text.substr(0, std::min({text.find('#'), text.find('%'), text.find("//")})));
}

// Columns end at a comma, a semicolon, or a run of spaces.
void splitColumns(std::string_view text, std::vector<std::string_view>& cells) {
  cells.clear();
  const auto skipSpaces = [&] {
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  };
  while (true) {
    const std::size_t end = text.find_first_of(" \t,;");
    cells.push_back(text.substr(0, end));
    if (end == std::string_view::npos) return;
    text.remove_prefix(end);
    skipSpaces();
    if (text.empty() || (text.front() != ',' && text.front() != ';')) continue;
    text.remove_prefix(1);
    skipSpaces();
  }
}

// Commas between digits and other separators beside them, without a decimal point: "0 1,5 2,5 30,5" would be
// read as seven columns.
bool mayHaveDecimalCommas(std::string_view text) {
  const auto isDigit = [&](std::size_t i) { return text[i] >= '0' && text[i] <= '9'; };
  const auto isComma = [&](std::size_t i) { return i < text.size() && text[i] == ','; };
  bool between = false;
  bool others = false;
  for (std::size_t i = 1; i + 1 < text.size(); ++i) {
    if (text[i] == '.') return false;
    if (isComma(i)) between = between || (isDigit(i - 1) && isDigit(i + 1));
    if (text[i] == ';') others = true;
    if (text[i] != ' ' && text[i] != '\t') continue;
    const std::size_t next = text.find_first_not_of(" \t", i);
    others = others || !(isComma(next) || isComma(text.find_last_not_of(" \t", i)));
  }
  return between && others;
}

TrajectoryColumns columnsByNumber(std::size_t count, const TextLine& line) {
  if (count == 4) return TrajectoryColumns::parse("t,x,y,z");
  if (count == 7) return TrajectoryColumns::parse("t,x,y,z,fx,fy,fz");
  line.fail(std::to_string(count) +
            " columns where 4 (t,x,y,z) or 7 (t,x,y,z,fx,fy,fz) are expected: name them with --traj-columns");
}

std::string numberOf(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

// Row by row into a Trajectory.
class Parser {
 public:
  Parser(const std::string& source, const TrajectoryFormat& format)
      : source_(source), format_(format), columns_(format.columns) {}

  void add(std::string_view content, std::size_t number) {
    const TextLine line{source_, number};
    if (isBinary(content))
      line.fail("holds binary data: a .traj file is read as text with one sample on each line");
    content = withoutComment(content);
    if (content.empty()) return;
    if (trajectory_.samples.empty() && !startsLikeANumber(content)) {
      ++headerLines_;
      return;
    }
    if (mayHaveDecimalCommas(content))
      line.fail("has commas in numbers or as some of the separators: give " + quoted(content) +
                " decimal points, or one kind of separator");
    splitColumns(content, cells_);
    if (!columns_) columns_ = columnsByNumber(cells_.size(), line);
    if (cells_.size() != columns_->count) {
      line.fail(std::to_string(cells_.size()) + " columns where " + std::to_string(columns_->count) +
                " are expected");
    }
    addSample(line);
  }

  Trajectory take() {
    if (trajectory_.samples.empty()) {
      throw HandFileError(source_ + ": no sample in it" +
                          (headerLines_ > 0 ? "; no line begins with a number" : ""));
    }
    trajectory_.hasForce = columns_->force.has_value();
    trajectory_.remark = remark();
    return std::move(trajectory_);
  }

 private:
  double number(std::size_t column, double unit, double most, const char* what, const TextLine& line) const {
    const double value = unit * readNumber(cells_[column], column, line);
    if (std::abs(value) > most) {
      line.fail("column " + std::to_string(column + 1) + " " + quoted(cells_[column]) + " is " + what +
                " beyond " + numberOf(most));
    }
    return value;
  }

  Vec3 vector(const std::array<std::size_t, 3>& at, double unit, double most, const char* what,
              const TextLine& line) const {
    return {number(at[0], unit, most, what, line), number(at[1], unit, most, what, line),
            number(at[2], unit, most, what, line)};
  }

  void addSample(const TextLine& line) {
    const double time_s = number(columns_->time, format_.unit_s, kLatest_s, "a time in s", line);
    TrajectorySample sample;
    sample.time = base::toNanos(time_s);
    sample.position_m =
        vector(columns_->position, format_.unit_m, kFarthestSample_m, "a position in m", line);
    if (columns_->force) {
      const double sign = format_.forceOnSurface ? -1 : 1;
      sample.force_N = vector(*columns_->force, sign, kStrongest_N, "a force in N", line);
    }
    if (isNext(time_s, sample.time, line)) trajectory_.samples.push_back(sample);
  }

  // A repeated time is what a clock coarser than the sampling gives; time that runs back is a damaged file.
  bool isNext(double time_s, Nanos time, const TextLine& line) {
    if (trajectory_.samples.empty()) {
      first_s_ = time_s;
      return true;
    }
    const Nanos before = trajectory_.samples.back().time;
    if (time == before) {
      ++repeated_;
      return false;
    }
    if (time < before) {
      line.fail("time " + numberOf(time_s) + " s is before that of the sample before, " +
                numberOf(base::toSeconds(before)) + " s");
    }
    if (time_s - first_s_ > kLongestTrajectory_s)
      line.fail("time " + numberOf(time_s) + " s is more than " + numberOf(kLongestTrajectory_s) +
                " s after the first one");
    return true;
  }

  std::string remark() const {
    std::string text;
    const auto add = [&](const std::string& what) { text += (text.empty() ? "" : "; ") + what; };
    if (headerLines_ > 0) add("skips " + std::to_string(headerLines_) + " line(s) before the first sample");
    if (repeated_ > 0)
      add("skips " + std::to_string(repeated_) + " sample(s) that repeat the time of the one before");
    if (trajectory_.samples.size() < 2) return text;
    const Nanos duration = trajectory_.samples.back().time - trajectory_.samples.front().time;
    const double rate_Hz = static_cast<double>(trajectory_.samples.size() - 1) / base::toSeconds(duration);
    if (rate_Hz < kSlowest_Hz) {
      add("has " + numberOf(std::round(rate_Hz * 1e3) / 1e3) +
          " samples per second; if its times are milliseconds, add --traj-time-unit ms");
    }
    return text;
  }

  const std::string& source_;
  const TrajectoryFormat& format_;
  std::optional<TrajectoryColumns> columns_;
  std::vector<std::string_view> cells_;
  Trajectory trajectory_;
  double first_s_ = 0;
  std::size_t headerLines_ = 0;
  std::size_t repeated_ = 0;
};

}  // namespace

TrajectoryColumns TrajectoryColumns::parse(std::string_view names) {
  constexpr std::array<std::string_view, 7> kNames{"t", "x", "y", "z", "fx", "fy", "fz"};
  constexpr std::size_t kNoColumn = static_cast<std::size_t>(-1);
  std::array<std::size_t, kNames.size()> at{};
  at.fill(kNoColumn);
  TrajectoryColumns columns;
  for (std::size_t begin = 0; begin <= names.size(); ++columns.count) {
    const std::size_t end = std::min(names.find(',', begin), names.size());
    const std::string_view name = trimmed(names.substr(begin, end - begin));
    begin = end + 1;
    if (name == "-") continue;
    const auto known = std::find(kNames.begin(), kNames.end(), name);
    if (known == kNames.end())
      throw std::invalid_argument("'" + std::string(name) + "' is none of t, x, y, z, fx, fy, fz and -");
    std::size_t& column = at[static_cast<std::size_t>(known - kNames.begin())];
    if (column != kNoColumn) throw std::invalid_argument("'" + std::string(name) + "' is there twice");
    column = columns.count;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    if (at[i] == kNoColumn) throw std::invalid_argument("'" + std::string(kNames[i]) + "' is missing");
  }
  columns.time = at[0];
  columns.position = {at[1], at[2], at[3]};
  const auto forces = std::count(at.begin() + 4, at.end(), kNoColumn);
  if (forces != 0 && forces != 3) throw std::invalid_argument("fx, fy and fz come together");
  if (forces == 0) columns.force = {at[4], at[5], at[6]};
  return columns;
}

bool Trajectory::isNameOf(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return extension == ".traj";
}

Trajectory Trajectory::load(const std::filesystem::path& file, const TrajectoryFormat& format) {
  return parse(readText(file), file.string(), format);
}

Trajectory Trajectory::parse(std::string_view text, const std::string& source,
                             const TrajectoryFormat& format) {
  Parser parser(source, format);
  forEachLine(text, [&](std::string_view content, std::size_t number) { parser.add(content, number); });
  return parser.take();
}

}  // namespace hapticd::device
