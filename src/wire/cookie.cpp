#include "wire/cookie.h"

#include "wire/text.h"

namespace hapticd::wire {

namespace {
constexpr std::size_t kLogModeOffset = 18;
}

std::array<std::byte, kCookieBytes> encodeCookie(int log_mode) {
  std::array<std::byte, kCookieBytes> bytes{};
  const std::string text = std::string(kVersionText) + "  " + static_cast<char>('0' + log_mode);
  std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

Result<Cookie> decodeCookie(ByteView bytes) {
  const std::string_view text = asText(bytes);
  if (text.size() != kCookieBytes)
    return Error{"cookie of " + std::to_string(text.size()) + " bytes, expected 24"};
  const std::string_view major = kVersionText.substr(0, kVersionText.rfind('.') + 1);
  if (!text.starts_with(major)) {
    return Error{"peer opened with " + inQuotes(text) + ", expected " + inQuotes(std::string(major) + "xx")};
  }
  const char digit = text[kLogModeOffset];
  if (digit < '0' || digit > '3') {
    return Error{"peer opened with " + inQuotes(text) + ": log mode " + inQuotes({&digit, 1}) +
                 " is not 0 to 3"};
  }
  const std::size_t number = kVersionText.find("07");
  return Cookie{std::string(text.substr(number, kVersionText.size() - number)), digit - '0'};
}

}  // namespace hapticd::wire
