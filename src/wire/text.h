// Text of strangers, made fit for logs and errors.
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

/// In quotes, with everything but printable ASCII as \xNN.
std::string inQuotes(std::string_view text);

/// Whether text may be a host: letters, digits, dots; not empty, at most 255 characters. The stock server's
/// rule.
bool isHost(std::string_view text) noexcept;

}  // namespace hapticd::wire
