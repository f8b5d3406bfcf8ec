#include "device/simulated/hand_file.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <iterator>

#include "base/time.h"

namespace hapticd::device {
namespace {

constexpr std::array<std::string_view, 4> kHeaders = {
    "t_s,x_m,y_m,z_m",
    "t_s,x_m,y_m,z_m,buttons",
    "t_s,x_m,y_m,z_m,qx,qy,qz,qw",
    "t_s,x_m,y_m,z_m,qx,qy,qz,qw,buttons",
};
constexpr std::size_t kMostColumns = 9;
constexpr double kMostSeconds = 1e8;

struct Line {
  const std::string& source;
  std::size_t number;

  [[noreturn]] void fail(const std::string& what) const {
    throw HandFileError(source + ":" + std::to_string(number) + ": " + what);
  }
};

std::string_view trimmed(std::string_view text) {
  const auto isSpace = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && isSpace(text.front())) text.remove_prefix(1);
  while (!text.empty() && isSpace(text.back())) text.remove_suffix(1);
  return text;
}

bool startsLikeANumber(std::string_view text) {
  return !text.empty() && std::string_view("+-.0123456789").find(text.front()) != std::string_view::npos;
}

// The number of columns that a header announces.
std::size_t readHeader(std::string_view text, const Line& line) {
  std::string compact;
  std::copy_if(text.begin(), text.end(), std::back_inserter(compact),
               [](char c) { return c != ' ' && c != '\t'; });
  if (std::find(kHeaders.begin(), kHeaders.end(), compact) == kHeaders.end()) {
    line.fail("header '" + std::string(text) + "' is not t_s,x_m,y_m,z_m[,qx,qy,qz,qw][,buttons]");
  }
  return static_cast<std::size_t>(std::count(compact.begin(), compact.end(), ',')) + 1;
}

double readNumber(std::string_view text, std::size_t column, const Line& line) {
  std::string_view digits = trimmed(text);
  if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc{} || end != digits.data() + digits.size() || !std::isfinite(value)) {
    line.fail("column " + std::to_string(column + 1) + " '" + std::string(trimmed(text)) +
              "' is not a finite number");
  }
  return value;
}

std::size_t readNumbers(std::string_view text, const Line& line, std::array<double, kMostColumns>& values) {
  std::size_t count = 0;
  for (bool more = true; more; ++count) {
    const std::size_t comma = text.find(',');
    more = comma != std::string_view::npos;
    if (count == kMostColumns) line.fail("more than 9 columns");
    values[count] = readNumber(text.substr(0, comma), count, line);
    if (more) text.remove_prefix(comma + 1);
  }
  return count;
}

Nanos readTime(double time_s, Nanos before, const Line& line) {
  if (time_s < 0 || time_s > kMostSeconds) line.fail("time " + std::to_string(time_s) + " s is out of range");
  const Nanos time = base::toNanos(time_s);
  if (time <= before) line.fail("time " + std::to_string(time_s) + " s is not after the row before");
  return time;
}

Quat readOrientation(const Quat& quaternion, const Line& line) {
  const double length = quaternion.norm();
  if (std::abs(length - 1) > 0.01) {
    line.fail("quaternion of length " + std::to_string(length) + " is not a rotation");
  }
  return quaternion.normalized();
}

std::uint32_t readButtons(double buttons, const Line& line) {
  if (buttons != std::floor(buttons) || buttons < 0 || buttons > 4294967295.0) {
    line.fail("buttons " + std::to_string(buttons) + " is not a set of bits");
  }
  return static_cast<std::uint32_t>(buttons);
}

}  // namespace

std::shared_ptr<const HandFile> HandFile::load(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in || std::filesystem::is_directory(file)) {
    throw HandFileError(file.string() + ": cannot be opened as a hand file");
  }
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  return parse(text, file.string());
}

std::shared_ptr<const HandFile> HandFile::parse(std::string_view text, const std::string& source) {
  std::shared_ptr<HandFile> hand(new HandFile);
  std::size_t columns = 0;
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view content = trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (content.empty() || content.front() == '#') continue;

    const Line line{source, number};
    if (columns == 0 && !startsLikeANumber(content)) {
      columns = readHeader(content, line);
      continue;
    }
    std::array<double, kMostColumns> v{};
    const std::size_t count = readNumbers(content, line, v);
    if (columns == 0 && (count == 4 || count == 5 || count == 8 || count == 9)) columns = count;
    if (count != columns) {
      line.fail(std::to_string(count) + " columns where " +
                (columns == 0 ? "4, 5, 8 or 9" : std::to_string(columns)) + " are expected");
    }

    Row row{0, Vec3(v[1], v[2], v[3]), Quat::Identity(), 0};
    row.time = readTime(v[0], hand->rows_.empty() ? -1 : hand->rows_.back().time, line);
    if (columns >= 8) row.orientation = readOrientation(Quat(v[7], v[4], v[5], v[6]), line);
    if (columns == 5 || columns == 9) row.buttons = readButtons(v[columns - 1], line);
    hand->rows_.push_back(row);
  }
  if (hand->rows_.empty()) throw HandFileError(source + ": no row with a hand in it");
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
  const Vec3 way = b.position_m - a.position_m;
  return {a.position_m + s * way, way / base::toSeconds(b.time - a.time),
          a.orientation.slerp(s, b.orientation), a.buttons};
}

}  // namespace hapticd::device
