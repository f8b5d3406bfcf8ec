// Wall time of time stamps on the wire.
#pragma once

#include "base/world.h"
#include "wire/types.h"

namespace hapticd::server {

/// Converts servo times to wall times. The offset changes only when it is off by more than a millisecond (the
/// wall clock was set), so that the stamps of neighbouring ticks keep their true distance.
class WallClock {
 public:
  WallClock() : offset_(measure()) {}

  /// Detects that the wall clock was set; call it periodically.
  void refresh() noexcept {
    const base::Nanos fresh = measure();
    if (fresh - offset_ > 1000000 || offset_ - fresh > 1000000) offset_ = fresh;
  }
  wire::Time at(base::Nanos monotonic) const noexcept {
    const base::Nanos wall = monotonic + offset_;
    return {static_cast<std::uint32_t>(wall / 1000000000),
            static_cast<std::uint32_t>(wall % 1000000000 / 1000)};
  }
  /// Wall time minus servo time.
  base::Nanos offset() const noexcept { return offset_; }
  wire::Time now() const noexcept { return at(base::now()); }

 private:
  static base::Nanos measure() noexcept { return base::wallNow() - base::now(); }

  base::Nanos offset_;
};

}  // namespace hapticd::server
