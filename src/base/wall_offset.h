// Wall time less servo time, of two clocks that cannot be read at one moment.
#pragma once

#include <optional>

#include "base/world.h"

namespace hapticd::base {

/// Differences up to this are no step of the wall clock.
inline constexpr Nanos kWallStep = 1'000'000;

/// Nothing when this thread was interrupted between the two clocks, which a busy machine does for
/// milliseconds: that would look like a step.
inline std::optional<Nanos> tryWallOffset() noexcept {
  const Nanos before = now();
  const Nanos wall = wallNow();
  if (now() - before > kWallStep / 2) return std::nullopt;
  return wall - before;
}

/// Tries some times.
inline Nanos wallOffset() noexcept {
  for (int i = 0; i < 10; ++i) {
    if (const std::optional<Nanos> offset = tryWallOffset()) return *offset;
  }
  return wallNow() - now();
}

}  // namespace hapticd::base
