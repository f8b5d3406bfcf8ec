// The thread that paces a tick, for devices whose library does not call back at 1 kHz.
#pragma once

#include <atomic>
#include <functional>
#include <optional>

#include "base/clock.h"
#include "base/thread.h"
#include "realtime/servo/pacer.h"
#include "realtime/servo/thread_setup.h"

namespace hapticd::realtime {

struct ServoThreadOptions {
  double rate_Hz = 1000;
  ThreadRequest request;
  bool requireRealtime = false;  ///< start() throws when scheduling or memory lock was refused
};

/// Owns one realtime thread. One other thread starts it, once, and stops it.
class ServoThread {
 public:
  /// `tick` must not throw, allocate or lock; it and `clock` must outlive the thread. Throws
  /// std::invalid_argument for a rate outside 250 Hz … 4 kHz.
  ServoThread(std::function<void(const Pacing&)> tick, base::Clock& clock,
              const ServoThreadOptions& options = {});
  ~ServoThread();
  ServoThread(const ServoThread&) = delete;
  ServoThread& operator=(const ServoThread&) = delete;

  /// Starts the thread and returns what the system granted. Throws std::runtime_error with the remedies when
  /// realtime is required and was refused (no tick has run then), std::system_error when the system gives no
  /// thread.
  const ThreadSetup& start();
  /// Ends the loop and returns after the last tick. Idempotent.
  void stop() noexcept;
  /// Ends the loop after the present tick, without waiting. From any thread, also from within a tick.
  void requestStop() noexcept { stopping_.store(true, std::memory_order_release); }
  /// Valid after start().
  const ThreadSetup& setup() const noexcept { return setup_; }

 private:
  std::optional<Nanos> step();
  bool refused() const noexcept;

  const std::function<void(const Pacing&)> tick_;
  base::Clock& clock_;
  const ServoThreadOptions options_;
  const Nanos period_;
  ThreadSetup setup_;
  std::atomic<bool> isSetUp_{false};
  std::atomic<bool> stopping_{false};
  std::optional<Pacer> pacer_;  // by the thread; empty before its first step
  base::PacedThread thread_;    // last: its step uses the others
};

}  // namespace hapticd::realtime
