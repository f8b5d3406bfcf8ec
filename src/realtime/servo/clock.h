// Time for the servo loop: the machine's own, or one that stands still until told.
#pragma once

#include "geometry/types.h"

namespace hapticd::realtime {

using geometry::Nanos;

/// What the loop asks of time. Both calls are realtime: noexcept, no allocation, no lock.
class Clock {
 public:
  Clock() = default;
  virtual ~Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

  virtual Nanos now() noexcept = 0;
  /// Returns at `deadline` or later; at once when it has passed.
  virtual void sleepUntil(Nanos deadline) noexcept = 0;
};

/// CLOCK_MONOTONIC, with absolute deadlines: a late wake-up does not shift the ones after it.
class MonotonicClock final : public Clock {
 public:
  Nanos now() noexcept override;
  void sleepUntil(Nanos deadline) noexcept override;
};

/// Moves only when told, for offline rendering: sleeping sets the time. One thread.
class SimulatedClock final : public Clock {
 public:
  Nanos now() noexcept override { return now_; }
  void sleepUntil(Nanos deadline) noexcept override {
    if (deadline > now_) now_ = deadline;
  }

 private:
  Nanos now_ = 0;
};

}  // namespace hapticd::realtime
