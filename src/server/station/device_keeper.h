// Runs the servo loop of one device, paced by the server or by the device, and reopens a lost device.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "base/clock.h"
#include "realtime/servo/servo_thread.h"
#include "realtime/servo/tick.h"
#include "realtime/servo/watchdog.h"

namespace hapticd::server {

struct DeviceKeeperOptions {
  std::string name;  ///< for the log
  double rate_Hz = 1000;
  bool requireRealtime = false;  ///< not of a vendor's thread, whose scheduling is the library's
  bool vendorThread = false;     ///< the tick of a self-paced device runs in a thread of its vendor's library
};

/// Net thread. Opening and calibrating, which may take seconds, run in a separate thread.
class DeviceKeeper {
 public:
  /// All references must outlive the keeper; `device` must be open.
  DeviceKeeper(device::Device& device, realtime::Tick& tick, base::Clock& clock,
               const DeviceKeeperOptions& options);
  ~DeviceKeeper() { stop(); }
  DeviceKeeper(const DeviceKeeper&) = delete;
  DeviceKeeper& operator=(const DeviceKeeper&) = delete;

  /// Starts the loop. Throws std::runtime_error when realtime scheduling is required and refused.
  void start();
  /// For good: interrupts the device, waits for a running attempt and ends the loop.
  void stop() noexcept;
  /// Call several times per second. Returns why the device gives no force, empty when it works. Closes and
  /// reopens a device that has been lost for 0.5 s; retries every 2 s until it opens.
  std::string poll(base::Nanos now);
  /// Starts a calibration, which may move the arm: call only with the operator's consent. The loop keeps
  /// running; poll() returns the result. A stop of the forces ends it, and one that stands prevents it. No
  /// effect while the device is being reopened or calibrated.
  void calibrate();

  /// Whether forces were stopped after a suspension of the machine since the last call.
  bool takeResumed() noexcept { return watchdog_.takeResumed(); }

  /// Any thread: no loop runs, and the device is closed, or is being opened.
  bool isClosed() const noexcept { return closed_.load(std::memory_order_acquire); }
  /// Whether the thread of the loop has realtime scheduling.
  bool realtime() const noexcept { return realtime_; }

 private:
  void startLoop();
  void demandRealtime() const;
  void stopLoop() noexcept;
  void startAttempt(std::string text, std::function<void()> attempt);
  void reopen() noexcept;
  void runCalibration(std::uint32_t stops) noexcept;
  void logSetup(const realtime::ThreadSetup& setup) const;
  void logPacedSetup();

  device::Device& device_;
  realtime::Tick& tick_;
  base::Clock& clock_;
  const DeviceKeeperOptions options_;
  realtime::Watchdog watchdog_;
  std::optional<realtime::ServoThread> servo_;

  realtime::ThreadSetup pacedSetup_;  // written by the first tick; read by the net thread after isPacedSetUp_
  std::atomic<bool> isPacedSetUp_{false};
  std::atomic<bool> realtime_{false};

  base::Nanos begun_ = 0;      // the present loop; 0: none
  base::Nanos ended_ = 0;      // the last tick before it
  base::Nanos lostSince_ = 0;  // 0: not lost
  base::Nanos nextAttempt_ = 0;
  std::string attemptText_;  // reported while the attempt runs
  base::Thread attempt_;
  std::atomic<bool> ending_{false};
  std::atomic<bool> closed_{false};
  std::atomic<bool> attemptDone_{false};
  // Errors of the last attempts to open and to calibrate; empty after success. Owned by the attempt until
  // attemptDone_.
  std::string openError_;
  std::string calibrationError_;
};

}  // namespace hapticd::server
