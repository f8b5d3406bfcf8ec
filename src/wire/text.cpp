#include "wire/text.h"

#include <algorithm>

namespace hapticd::wire {

namespace {
// Truncate untrusted text so that one client cannot flood the log.
constexpr std::size_t kLongestQuote = 64;
}  // namespace

std::string inQuotes(std::string_view text) {
  constexpr std::string_view kHex = "0123456789abcdef";
  std::string out = "\"";
  for (const char c : text.substr(0, kLongestQuote)) {
    const auto code = static_cast<unsigned char>(c);
    if (code >= 0x20 && code < 0x7f && c != '"' && c != '\\') {
      out += c;
    } else {
      out += {'\\', 'x', kHex[code >> 4], kHex[code & 15]};
    }
  }
  out += '"';
  if (text.size() > kLongestQuote)
    out += " and " + std::to_string(text.size() - kLongestQuote) + " bytes more";
  return out;
}

bool isHost(std::string_view text) noexcept {
  const auto allowed = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.';
  };
  return !text.empty() && text.size() <= 255 && std::all_of(text.begin(), text.end(), allowed);
}

}  // namespace hapticd::wire
