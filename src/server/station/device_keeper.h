// The loop of one device: paced here or by the device, and brought back when only opening the device anew
// helps.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "base/clock.h"
#include "realtime/servo/servo_thread.h"
#include "realtime/servo/tick.h"

namespace hapticd::server {

struct DeviceKeeperOptions {
  std::string name;  ///< for the log
  double rate_Hz = 1000;
  bool requireRealtime = false;
  bool vendorsThread = false;  ///< the callback of a self-paced device comes in a thread that is not ours
};

/// Net thread, but for what it does itself in a thread of its own: opening a device may take seconds.
class DeviceKeeper {
 public:
  /// All outlive the keeper; `device` is open.
  DeviceKeeper(device::Device& device, realtime::Tick& tick, base::Clock& clock,
               const DeviceKeeperOptions& options);
  ~DeviceKeeper() { stop(); }
  DeviceKeeper(const DeviceKeeper&) = delete;
  DeviceKeeper& operator=(const DeviceKeeper&) = delete;

  /// Starts the loop. Throws std::runtime_error when it gets no realtime rights and must have them.
  void start();
  /// The loop has ended, and nothing is tried any more.
  void stop() noexcept;
  /// Some times a second: why forces are held, in words; empty when all is well. A device that has been lost
  /// for half a second is closed and opened anew, every two seconds until it opens.
  std::string look(base::Nanos now);
  /// A person consents to a calibration now, which may move the arm. The loop goes on meanwhile; look() tells
  /// how it ended. Nothing while the device is opened anew or calibrated already.
  void calibrate();

  /// The thread of the loop has realtime scheduling.
  bool realtime() const noexcept { return realtime_; }

 private:
  void startLoop();
  void stopLoop() noexcept;
  void begin(std::string doing, std::function<void()> attempt);
  void openAnew() noexcept;
  void tryToCalibrate() noexcept;
  void say(const realtime::SetupAnswer& answer) const;
  void sayPacedSetup();

  device::Device& device_;
  realtime::Tick& tick_;
  base::Clock& clock_;
  const DeviceKeeperOptions options_;
  std::optional<realtime::ServoThread> servo_;

  realtime::ThreadSetup pacedSetup_;  // the callback's, then the net thread's
  std::atomic<bool> isPacedSetUp_{false};
  std::atomic<bool> realtime_{false};

  base::Nanos lostSince_ = 0;  // 0: not lost
  base::Nanos nextAttempt_ = 0;
  std::string doing_;  // of the attempt
  base::Thread attempt_;
  std::atomic<bool> attempted_{false};
  // Of the last attempt to open and to calibrate; empty when it succeeded. The attempt's until attempted_.
  std::string refusal_;
  std::string notCalibrated_;
};

}  // namespace hapticd::server
