#include "base/printable.h"

#include <algorithm>
#include <cstddef>

namespace hapticd::base {
namespace {

// Bytes of the character of UTF-8 that begins the text; 0: none does.
std::size_t characterBytes(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const unsigned lead = byte(0);
  if (lead < 0x80) return 1;
  const std::size_t bytes = lead >= 0xc2 && lead <= 0xdf   ? 2
                            : (lead & 0xf0U) == 0xe0       ? 3
                            : lead >= 0xf0 && lead <= 0xf4 ? 4
                                                           : 0;
  for (std::size_t i = 1; i < bytes; ++i) {
    if ((byte(i) & 0xc0U) != 0x80) return 0;
  }
  const unsigned second = byte(1);
  const bool overlong = (lead == 0xe0 && second < 0xa0) || (lead == 0xf0 && second < 0x90);
  const bool noCharacter = (lead == 0xed && second > 0x9f) || (lead == 0xf4 && second > 0x8f) ||
                           (lead == 0xef && second == 0xbf && byte(2) > 0xbd);  // not in XML
  return overlong || noCharacter ? 0 : bytes;
}

bool isControl(std::string_view character) {
  const auto lead = static_cast<unsigned char>(character.front());
  return lead < 0x20 || lead == 0x7f || (lead == 0xc2 && static_cast<unsigned char>(character[1]) < 0xa0);
}

template <class Replaced>
std::string replaced(std::string_view text, Replaced&& isReplaced) {
  std::string out;
  while (!text.empty()) {
    const std::size_t bytes = characterBytes(text);
    out += bytes == 0 || isReplaced(text) ? "\xef\xbf\xbd" : text.substr(0, bytes);
    text.remove_prefix(std::max<std::size_t>(bytes, 1));
  }
  return out;
}

}  // namespace

std::string printable(std::string_view text) {
  return replaced(text, isControl);
}

std::string utf8(std::string_view text) {
  return replaced(text, [](std::string_view) { return false; });
}

std::string_view beginning(std::string_view text, std::size_t most) noexcept {
  if (text.size() <= most) return text;
  while (most > 0 && (static_cast<unsigned char>(text[most]) & 0xc0U) == 0x80) --most;
  return text.substr(0, most);
}

}  // namespace hapticd::base
