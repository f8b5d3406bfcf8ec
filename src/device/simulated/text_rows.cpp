#include "device/simulated/text_rows.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>

#include "base/printable.h"
#include "base/world.h"

namespace hapticd::device {

void TextLine::fail(const std::string& what) const {
  throw HandFileError(source + ":" + std::to_string(number) + ": " + what);
}

std::string_view trimmed(std::string_view text) noexcept {
  const auto isSpace = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && isSpace(text.front())) text.remove_prefix(1);
  while (!text.empty() && isSpace(text.back())) text.remove_suffix(1);
  return text;
}

bool startsLikeANumber(std::string_view text) noexcept {
  return !text.empty() && std::string_view("+-.0123456789").find(text.front()) != std::string_view::npos;
}

bool isBinary(std::string_view line) noexcept {
  return std::any_of(line.begin(), line.end(), [](char c) { return c >= 0 && c < ' ' && c != '\t'; });
}

std::string quoted(std::string_view value) {
  constexpr std::size_t kMostBytes = 200;
  std::string begin(base::beginning(value, kMostBytes));
  const char* const end = begin.size() < value.size() ? "...'" : "'";
  std::replace(begin.begin(), begin.end(), '\t', ' ');
  return "'" + base::printable(begin) + end;
}

double readNumber(std::string_view text, std::size_t column, const TextLine& line) {
  std::string_view digits = text;
  if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (error != std::errc{} || end != digits.data() + digits.size() || !std::isfinite(value))
    line.fail("column " + std::to_string(column + 1) + " " + quoted(text) + " is not a finite number");
  return value;
}

std::string readText(const std::filesystem::path& file) {
  try {
    const std::vector<std::byte> content = base::world().files.read(file);
    return {reinterpret_cast<const char*>(content.data()), content.size()};
  } catch (const std::system_error& error) {
    throw HandFileError(file.string() + ": cannot be read as a hand file: " + error.code().message());
  }
}

}  // namespace hapticd::device
