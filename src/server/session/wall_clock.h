// Wall time of time stamps on the wire.
#pragma once

#include "base/wall_offset.h"
#include "wire/types.h"

namespace hapticd::server {

/// Converts servo times to wall times. The offset changes only when it is off by more than a millisecond (the
/// wall clock was set), so that the stamps of neighbouring ticks keep their true distance.
class WallClock {
 public:
  /// Detects that the wall clock was set; call it periodically.
  void refresh() noexcept {
    const std::optional<base::Nanos> fresh = base::tryWallOffset();
    if (fresh && (*fresh - offset_ > base::kWallStep || offset_ - *fresh > base::kWallStep)) offset_ = *fresh;
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
  base::Nanos offset_ = base::wallOffset();
};

}  // namespace hapticd::server
