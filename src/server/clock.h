// The server's two clocks: the servo clock, and wall time for what clients see.
#pragma once

#include <ctime>

#include "geometry/types.h"
#include "wire/types.h"

namespace hapticd::server {

/// CLOCK_MONOTONIC, the servo clock.
inline geometry::Nanos monotonicNow() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return static_cast<geometry::Nanos>(t.tv_sec) * 1000000000 + t.tv_nsec;
}

/// Turns servo times into the wall times of time stamps. The offset is measured again only when it is off by
/// more than a millisecond (somebody set the clock), so that stamps of neighbouring ticks differ by their
/// true distance.
class WallClock {
 public:
  WallClock() { offset_ = measure(); }

  /// Looks whether the wall clock was set; call it now and then.
  void refresh() noexcept {
    const geometry::Nanos fresh = measure();
    if (fresh - offset_ > 1000000 || offset_ - fresh > 1000000) offset_ = fresh;
  }
  wire::Time at(geometry::Nanos monotonic) const noexcept {
    const geometry::Nanos wall = monotonic + offset_;
    return {static_cast<std::uint32_t>(wall / 1000000000),
            static_cast<std::uint32_t>(wall % 1000000000 / 1000)};
  }
  /// Wall time less servo time.
  geometry::Nanos offset() const noexcept { return offset_; }
  wire::Time now() const noexcept { return at(monotonicNow()); }

 private:
  static geometry::Nanos measure() noexcept {
    timespec t{};
    clock_gettime(CLOCK_REALTIME, &t);
    return static_cast<geometry::Nanos>(t.tv_sec) * 1000000000 + t.tv_nsec - monotonicNow();
  }
  geometry::Nanos offset_ = 0;
};

}  // namespace hapticd::server
