// The unit of time of all rooms.
#pragma once

#include <cstdint>

namespace hapticd::base {

/// Nanoseconds: on the servo clock (CLOCK_MONOTONIC when live, simulated time offline), or on the wall clock
/// (since 1970, UTC) where the name says so.
using Nanos = std::int64_t;

constexpr double toSeconds(Nanos t) noexcept {
  return static_cast<double>(t) * 1e-9;
}
constexpr Nanos toNanos(double seconds) noexcept {
  return static_cast<Nanos>(seconds * 1e9 + (seconds < 0 ? -0.5 : 0.5));
}

}  // namespace hapticd::base
