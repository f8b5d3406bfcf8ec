// When the next tick is due: a grid of deadlines that a late tick neither shifts nor crowds.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::realtime {

using base::Nanos;

inline constexpr double kMinServoRate_Hz = 250;
inline constexpr double kMaxServoRate_Hz = 4000;

/// The time between ticks. Throws std::invalid_argument outside 250 Hz … 4 kHz.
Nanos servoPeriod(double rate_Hz);

/// A tick that starts later than this counts as an overrun.
inline constexpr Nanos kOverrunLateness = 500'000;

/// When a tick was due and when it began.
struct Pacing {
  Nanos now = 0;                     ///< start of the tick on the servo clock
  Nanos wakeupError = 0;             ///< start less deadline
  std::uint64_t overruns = 0;        ///< ticks that were more than 0.5 ms late, or lost to the one before
  std::uint64_t skippedPeriods = 0;  ///< points of the grid without a tick
};

/// Deadlines at start + n * period. Deadlines that have passed are skipped: there are never two ticks for one
/// moment, and a tick that takes too long leaves time for others.
class Pacer {
 public:
  Pacer(Nanos start, Nanos period) noexcept
      : period_(period), tolerated_(std::min(kOverrunLateness, period / 2)), deadline_(start + period) {}

  /// When the next tick is due.
  Nanos deadline() const noexcept { return deadline_; }

  /// Tells that a tick starts at `now`; the next one is due at the next point of the grid.
  Pacing begin(Nanos now) noexcept {
    pacing_.now = now;
    pacing_.wakeupError = std::max<Nanos>(now - deadline_, 0);
    pacing_.overruns += pacing_.wakeupError > kOverrunLateness ? 1 : 0;
    skipTo(now);
    deadline_ += period_;
    return pacing_;
  }

  /// Tells that the tick ended at `now`: a little late for the next one is tolerated, else that one is lost.
  void end(Nanos now) noexcept {
    if (now - deadline_ <= tolerated_) return;
    ++pacing_.overruns;
    skipTo(now);
    ++pacing_.skippedPeriods;
    deadline_ += period_;
  }

 private:
  // To the last point of the grid that is not after `now`.
  void skipTo(Nanos now) noexcept {
    const Nanos skipped = std::max<Nanos>(now - deadline_, 0) / period_;
    pacing_.skippedPeriods += static_cast<std::uint64_t>(skipped);
    deadline_ += skipped * period_;
  }

  Nanos period_;
  Nanos tolerated_;
  Nanos deadline_;
  Pacing pacing_;
};

}  // namespace hapticd::realtime
