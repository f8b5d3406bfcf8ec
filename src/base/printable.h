// Text of somebody else, made safe for terminals, logs, XML and JSON.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace hapticd::base {

/// The text as one line of UTF-8: control characters, and bytes that are no character, become U+FFFD.
std::string printable(std::string_view text);
/// The text as UTF-8: bytes that are no character become U+FFFD.
std::string utf8(std::string_view text);
/// The beginning of a text of UTF-8, in whole characters of at most this many bytes.
std::string_view beginning(std::string_view text, std::size_t most) noexcept;

}  // namespace hapticd::base
