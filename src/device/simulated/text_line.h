// A line of a text file of numbers, and errors that name it.
#pragma once

#include <charconv>
#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>

#include "base/world.h"

namespace hapticd::device {

/// The file cannot be read as a hand; the text names file, line and value.
class HandFileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

struct TextLine {
  const std::string& source;
  std::size_t number;

  [[noreturn]] void fail(const std::string& what) const {
    throw HandFileError(source + ":" + std::to_string(number) + ": " + what);
  }

  /// The number in a cell; `column` counts from 0.
  double readNumber(std::string_view text, std::size_t column) const {
    std::string_view digits = text;
    if (!digits.empty() && digits.front() == '+') digits.remove_prefix(1);
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc{} || end != digits.data() + digits.size() || !std::isfinite(value))
      fail("column " + std::to_string(column + 1) + " '" + std::string(text) + "' is not a finite number");
    return value;
  }
};

inline std::string_view trimmed(std::string_view text) {
  const auto isSpace = [](char c) { return c == ' ' || c == '\t' || c == '\r'; };
  while (!text.empty() && isSpace(text.front())) text.remove_prefix(1);
  while (!text.empty() && isSpace(text.back())) text.remove_suffix(1);
  return text;
}

/// Calls visit(line, content) for each line that is neither empty nor a comment behind '#'.
template <class Visit>
void forEachLine(std::string_view text, const std::string& source, Visit&& visit) {
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view content = trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (!content.empty() && content.front() != '#') visit(TextLine{source, number}, content);
  }
}

/// The whole file. Throws HandFileError.
inline std::string readHandFile(const std::filesystem::path& file) {
  try {
    const std::vector<std::byte> content = base::world().files.read(file);
    return {reinterpret_cast<const char*>(content.data()), content.size()};
  } catch (const std::system_error& error) {
    throw HandFileError(file.string() + ": cannot be read as a hand file: " + error.code().message());
  }
}

}  // namespace hapticd::device
