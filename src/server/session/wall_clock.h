// Wall time for what clients see.
#pragma once

#include "base/world.h"
#include "wire/types.h"

namespace hapticd::server {

/// Turns servo times into the wall times of time stamps. The offset is measured again only when it is off by
/// more than a millisecond (somebody set the clock), so that stamps of neighbouring ticks differ by their
/// true distance.
class WallClock {
 public:
  WallClock() : offset_(measure()) {}

  /// Notices when the wall clock was set; call it periodically.
  void refresh() noexcept {
    const base::Nanos fresh = measure();
    if (fresh - offset_ > 1000000 || offset_ - fresh > 1000000) offset_ = fresh;
  }
  wire::Time at(base::Nanos monotonic) const noexcept {
    const base::Nanos wall = monotonic + offset_;
    return {static_cast<std::uint32_t>(wall / 1000000000),
            static_cast<std::uint32_t>(wall % 1000000000 / 1000)};
  }
  /// Wall time less servo time.
  base::Nanos offset() const noexcept { return offset_; }
  wire::Time now() const noexcept { return at(base::now()); }

 private:
  static base::Nanos measure() noexcept { return base::wallNow() - base::now(); }

  base::Nanos offset_;
};

}  // namespace hapticd::server
