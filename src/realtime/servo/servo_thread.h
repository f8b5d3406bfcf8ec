// The thread that paces a tick, for devices that do not call back by themselves.
#pragma once

#include <atomic>
#include <functional>
#include <thread>

#include "base/clock.h"
#include "realtime/servo/pacer.h"
#include "realtime/servo/thread_setup.h"

namespace hapticd::realtime {

struct ServoThreadOptions {
  double rate_Hz = 1000;
  ThreadRequest request;
  bool requireRealtime = false;  ///< start() throws when scheduling or memory lock was refused
};

/// Owns one realtime thread. Started once and stopped by one other thread.
class ServoThread {
 public:
  /// `tick` must not throw, allocate or lock; it and `clock` must outlive the thread. Throws
  /// std::invalid_argument for a rate outside 250 Hz … 4 kHz.
  ServoThread(std::function<void(const Pacing&)> tick, base::Clock& clock, const ServoThreadOptions& options = {});
  ~ServoThread();
  ServoThread(const ServoThread&) = delete;
  ServoThread& operator=(const ServoThread&) = delete;

  /// Starts the thread and returns what it got. Throws std::runtime_error with the remedies when realtime is
  /// required and refused; no tick has run then.
  const ThreadSetup& start();
  /// Returns after the last tick. Idempotent.
  void stop() noexcept;
  /// Asks the loop to end after the present tick, without waiting; also from within a tick.
  void requestStop() noexcept { stopping_.store(true, std::memory_order_release); }
  /// Valid after start().
  const ThreadSetup& setup() const noexcept { return setup_; }
  Nanos period() const noexcept { return period_; }

 private:
  enum class Go { wait, run, leave };

  void run();
  void loop() noexcept;

  const std::function<void(const Pacing&)> tick_;
  base::Clock& clock_;
  const ServoThreadOptions options_;
  const Nanos period_;
  ThreadSetup setup_;
  std::atomic<bool> isSetUp_{false};
  std::atomic<Go> go_{Go::wait};
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

}  // namespace hapticd::realtime
