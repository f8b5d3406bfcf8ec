// Clocks: of the machine, or simulated.
#pragma once

#include "base/time.h"

namespace hapticd::base {

/// A monotonic clock (the servo clock) and a wall clock. All calls are realtime: noexcept, no allocation, no
/// lock.
class Clock {
 public:
  Clock() = default;
  virtual ~Clock() = default;
  Clock(const Clock&) = delete;
  Clock& operator=(const Clock&) = delete;

  /// Time on the servo clock.
  virtual Nanos now() noexcept = 0;
  /// Returns at `deadline` on the servo clock or later; immediately when it has passed.
  virtual void sleepUntil(Nanos deadline) noexcept = 0;
  /// Nanoseconds since 1970, UTC. Jumps when the clock of the machine is set.
  virtual Nanos wallNow() noexcept = 0;
  /// Total time for which the machine was suspended since it started, to within some microseconds. Realtime.
  virtual Nanos suspendedTime() noexcept { return 0; }
};

/// CLOCK_MONOTONIC and CLOCK_REALTIME. Deadlines are absolute: a late wake-up does not shift the ones after
/// it.
class MonotonicClock final : public Clock {
 public:
  Nanos now() noexcept override;
  void sleepUntil(Nanos deadline) noexcept override;
  Nanos wallNow() noexcept override;
  /// CLOCK_BOOTTIME less CLOCK_MONOTONIC.
  Nanos suspendedTime() noexcept override;
};

/// Advances only by sleepUntil(), which returns at once. For offline rendering and simulated worlds. One
/// thread.
class SimulatedClock final : public Clock {
 public:
  /// `wallAtZero`: wall time when now() is 0.
  explicit SimulatedClock(Nanos wallAtZero = 0) noexcept : wallOffset_(wallAtZero) {}

  Nanos now() noexcept override { return now_; }
  void sleepUntil(Nanos deadline) noexcept override {
    if (deadline > now_) now_ = deadline;
  }
  Nanos wallNow() noexcept override { return now_ + wallOffset_; }
  /// Sets the wall clock; now() does not change.
  void setWall(Nanos wall) noexcept { wallOffset_ = wall - now_; }
  Nanos suspendedTime() noexcept override { return suspended_; }
  /// The machine was suspended: now() does not change, the wall clock goes on.
  void suspendFor(Nanos duration) noexcept {
    suspended_ += duration;
    wallOffset_ += duration;
  }

 private:
  Nanos now_ = 0;
  Nanos wallOffset_;
  Nanos suspended_ = 0;
};

}  // namespace hapticd::base
