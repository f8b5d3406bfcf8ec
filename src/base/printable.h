// Text of somebody else, made safe for terminals, logs, XML and JSON.
#pragma once

#include <string>
#include <string_view>

namespace hapticd::base {

/// The text as one line of UTF-8: control characters, and bytes that are no character, become U+FFFD.
std::string printable(std::string_view text);

}  // namespace hapticd::base
