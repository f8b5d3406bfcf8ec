// Ends the force of a servo that hangs.
#pragma once

#include <atomic>
#include <optional>

#include "base/clock.h"
#include "base/thread.h"
#include "base/world.h"
#include "realtime/servo/tick.h"

namespace hapticd::realtime {

/// Watches the ticks of one loop from a thread of its own, with a higher priority than the servo's where the
/// system grants it. When no tick has ended for kSilence, it ends the force (Device::zeroFromOtherThread()),
/// again in every step until ticks end. A loop that has not ended its first tick has written no force. After
/// the machine was suspended it stops the forces: nobody knows where the hand is.
class Watchdog {
 public:
  static constexpr Nanos kSilence = 20'000'000;
  static constexpr Nanos kStep = 5'000'000;

  /// Both must outlive the watchdog; `clock` is that of the tick. `suspended` is the total time of
  /// suspension.
  Watchdog(Tick& tick, base::Clock& clock, Nanos (*suspended)() noexcept = base::suspendedTime)
      : tick_(tick), clock_(clock), suspended_(suspended) {}
  ~Watchdog() { stop(); }
  Watchdog(const Watchdog&) = delete;
  Watchdog& operator=(const Watchdog&) = delete;

  /// Before the loop starts.
  void start();
  /// After the loop has ended and before the device is closed: when this returns, the watchdog no longer
  /// calls the device. Idempotent.
  void stop() noexcept;

  /// Any thread: how long no tick of this loop has ended; 0 before the first one and without a loop.
  Nanos silence() const noexcept;
  /// Any thread: the watchdog acted in the present silence, and whether the driver could end the force.
  bool overtook() const noexcept { return overtook_.load(std::memory_order_acquire); }
  bool canZero() const noexcept { return canZero_.load(std::memory_order_acquire); }
  /// Any thread: whether the forces were stopped after a suspension since the last call.
  bool takeResumed() noexcept { return resumed_.exchange(false, std::memory_order_acq_rel); }

 private:
  std::optional<Nanos> step() noexcept;

  Tick& tick_;
  base::Clock& clock_;
  Nanos (*const suspended_)() noexcept;
  std::atomic<bool> watching_{false};
  std::atomic<Nanos> ended_{0};  // when the last tick of the previous loop ended
  std::atomic<bool> overtook_{false};
  std::atomic<bool> canZero_{false};
  std::atomic<bool> resumed_{false};
  bool isSetUp_ = false;       // by the thread
  Nanos suspendedBefore_ = 0;  // likewise
  base::Thread thread_;        // last: its step uses the others
};

}  // namespace hapticd::realtime
