// Untrusted text, made safe for logs and error texts.
#pragma once

#include <string>
#include <string_view>

#include "wire/bytes.h"

namespace hapticd::wire {

/// The bytes as characters, in place.
inline std::string_view asText(ByteView bytes) noexcept {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

/// The characters as bytes, in place.
inline ByteView asBytes(std::string_view text) noexcept {
  return std::as_bytes(std::span(text));
}

/// The text in quotes, at most 64 bytes of it, with everything but printable ASCII as \xNN.
std::string inQuotes(std::string_view text);

/// Whether text is a valid host by the stock server's rule: 1 to 255 letters, digits and dots.
bool isHost(std::string_view text) noexcept;

}  // namespace hapticd::wire
