// Stop, re-arm and enable, from any thread to the guard of one servo.
#pragma once

#include <atomic>
#include <cstdint>

#include "base/time.h"

namespace hapticd::realtime {

/// One atomic word of state: the last call wins, and the guard sees calls in order. Every call is lock-free,
/// safe in a signal handler, and acts at the next tick.
class GuardControl {
 public:
  explicit GuardControl(bool armed) noexcept : word_(armed ? 0 : kDisarmed) {}
  GuardControl(const GuardControl&) = delete;
  GuardControl& operator=(const GuardControl&) = delete;

  /// Zero force until rearm(). `now`: on the servo clock, for those who compare it with a re-arm.
  void stop(base::Nanos now = 0) noexcept {
    base::Nanos before = stoppedAt_.load(std::memory_order_relaxed);
    while (before < now && !stoppedAt_.compare_exchange_weak(before, now, std::memory_order_acq_rel)) {
    }
    std::uint64_t old = word_.load(std::memory_order_relaxed);
    while (!word_.compare_exchange_weak(old, (old + kStop) | kStopped, std::memory_order_acq_rel)) {
    }
  }
  /// Ends a stop and clears latched trips; the force ramps in. Does not arm a disarmed device.
  void rearm() noexcept {
    std::uint64_t old = word_.load(std::memory_order_relaxed);
    while (!word_.compare_exchange_weak(old, rearmed(old), std::memory_order_acq_rel)) {
    }
  }
  /// The same unless forces were stopped since stops() was this number; false then.
  bool rearm(std::uint32_t stops) noexcept {
    std::uint64_t old = word_.load(std::memory_order_acquire);
    do {
      if (stopsOf(old) != stops) return false;
    } while (!word_.compare_exchange_weak(old, rearmed(old), std::memory_order_acq_rel));
    return true;
  }
  /// Allows forces; for a real device the operator decides.
  void arm() noexcept { word_.fetch_and(~kDisarmed, std::memory_order_acq_rel); }
  void disarm() noexcept { word_.fetch_or(kDisarmed, std::memory_order_acq_rel); }
  /// Lets the force ramp in from zero again, as after a reset of the scene.
  void rampIn() noexcept { ramps_.fetch_add(1, std::memory_order_acq_rel); }

  /// The latest time of a stop; of all stops that stops() counted before.
  base::Nanos stoppedAt() const noexcept { return stoppedAt_.load(std::memory_order_acquire); }
  /// Counts calls of stop().
  std::uint32_t stops() const noexcept { return stopsOf(word_.load(std::memory_order_acquire)); }
  bool stopped() const noexcept { return (word_.load(std::memory_order_acquire) & kStopped) != 0; }
  bool armed() const noexcept { return (word_.load(std::memory_order_acquire) & kDisarmed) == 0; }

  /// What the guard reads once per tick.
  struct Seen {
    bool stopped;
    bool armed;
    std::uint64_t rearms;  ///< counts calls of rearm()
    std::uint32_t ramps;   ///< counts calls of rampIn()
  };
  Seen read() const noexcept {
    const std::uint64_t word = word_.load(std::memory_order_acquire);
    return {(word & kStopped) != 0, (word & kDisarmed) == 0, (word & kRearms) / kRearm,
            ramps_.load(std::memory_order_acquire)};
  }

 private:
  static constexpr std::uint64_t kStopped = 1;
  static constexpr std::uint64_t kDisarmed = 2;
  static constexpr std::uint64_t kRearm = 4;
  static constexpr std::uint64_t kStop = 1ULL << 32;
  static constexpr std::uint64_t kRearms = kStop - kRearm;  // the bits that count them

  static constexpr std::uint32_t stopsOf(std::uint64_t word) noexcept {
    return static_cast<std::uint32_t>(word / kStop);
  }
  static constexpr std::uint64_t rearmed(std::uint64_t word) noexcept {
    return ((word & ~kRearms) | ((word + kRearm) & kRearms)) & ~kStopped;
  }

  std::atomic<std::uint64_t> word_;
  std::atomic<std::uint32_t> ramps_{0};
  std::atomic<base::Nanos> stoppedAt_{0};
};

}  // namespace hapticd::realtime
