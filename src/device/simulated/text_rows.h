// What the readers of hand files share: text with one row of values on each line.
#pragma once

#include <cstddef>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <string_view>

namespace hapticd::device {

/// The file cannot be read as a hand; the text names file, line and value.
class HandFileError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The place of a row, for errors.
struct TextLine {
  const std::string& source;
  std::size_t number;

  [[noreturn]] void fail(const std::string& what) const;
};

/// Without spaces, tabs and carriage returns at both ends.
std::string_view trimmed(std::string_view text) noexcept;

bool startsLikeANumber(std::string_view text) noexcept;

/// Control characters, which text has none of but tabs.
bool isBinary(std::string_view line) noexcept;

/// A value of the file in quotes, for errors: its beginning, as one line.
std::string quoted(std::string_view value);

/// `column` counts from 0 and is only for the error. Throws HandFileError.
double readNumber(std::string_view text, std::size_t column, const TextLine& line);

/// Throws HandFileError.
std::string readText(const std::filesystem::path& file);

/// Calls use(content, number) for each line that is not empty. A byte order mark before the text is no part
/// of it.
template <class Use>
void forEachLine(std::string_view text, Use&& use) {
  constexpr std::string_view kMark = "\xEF\xBB\xBF";
  if (text.starts_with(kMark)) text.remove_prefix(kMark.size());
  for (std::size_t number = 1; !text.empty(); ++number) {
    const std::size_t end = text.find('\n');
    const std::string_view content = trimmed(text.substr(0, end));
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
    if (!content.empty()) use(content, number);
  }
}

}  // namespace hapticd::device
