// Texts of the scene to a client about a command that it sent.
#pragma once

#include <cstdint>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>

namespace hapticd::scene {

/// Numbers one connection; never used again.
using ClientId = std::uint32_t;

/// A text for one client: names the call, the object, the offending value and the remedy.
struct Notice {
  enum class Severity { normal, warning, error };
  ClientId client = 0;
  Severity severity = Severity::warning;
  std::string text;
};

/// The parts of a text, one after the other.
template <class... Parts>
std::string textOf(const Parts&... parts) {
  std::ostringstream text;
  static_cast<void>((text << ... << parts));
  return std::move(text).str();
}

/// In the text of what was refused for want of memory, and not for what the client sent.
inline constexpr std::string_view kOutOfMemory = "the server is out of memory";

}  // namespace hapticd::scene
