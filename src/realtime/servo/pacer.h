// Fixed-grid deadlines: a late tick causes neither drift nor catch-up ticks.
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/time.h"
#include "geometry/types.h"

namespace hapticd::realtime {

using base::Nanos;

inline constexpr double kMinServoRate_Hz = 250;
inline constexpr double kMaxServoRate_Hz = 4000;

/// The period of a rate. Throws std::invalid_argument outside 250 Hz … 4 kHz.
Nanos servoPeriod(double rate_Hz);

/// A tick that starts later than this counts as an overrun.
inline constexpr Nanos kOverrunLateness = 500'000;

/// The pacing of one tick, and totals.
struct Pacing {
  Nanos now = 0;                     ///< start of the tick on the servo clock
  Nanos wakeupError = 0;             ///< start minus deadline, >= 0
  std::uint64_t overruns = 0;        ///< ticks more than 0.5 ms late, or lost to a long tick before
  std::uint64_t skippedPeriods = 0;  ///< grid points without a tick
};

/// Deadlines at start + n * period. Passed deadlines are skipped: late ticks never pile up, and a tick that
/// takes too long still leaves processor time to other threads.
class Pacer {
 public:
  Pacer(Nanos start, Nanos period) noexcept
      : period_(period), tolerated_(std::min(kOverrunLateness, period / 2)), deadline_(start + period) {}

  /// When the next tick is due.
  Nanos deadline() const noexcept { return deadline_; }

  /// A tick starts at `now`; the next one is due at the next grid point.
  Pacing begin(Nanos now) noexcept {
    pacing_.now = now;
    pacing_.wakeupError = std::max<Nanos>(now - deadline_, 0);
    pacing_.overruns += pacing_.wakeupError > kOverrunLateness ? 1 : 0;
    skipTo(now);
    deadline_ += period_;
    return pacing_;
  }

  /// The tick ended at `now`. If that is past the next deadline by more than the tolerance, the next tick is
  /// lost.
  void end(Nanos now) noexcept {
    if (now - deadline_ <= tolerated_) return;
    ++pacing_.overruns;
    skipTo(now);
    ++pacing_.skippedPeriods;
    deadline_ += period_;
  }

 private:
  // To the last grid point that is not after `now`.
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
