// Texts of the scene to a client about a command that it sent.
#pragma once

#include <cstdint>
#include <string>

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

}  // namespace hapticd::scene
