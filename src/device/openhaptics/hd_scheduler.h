// The HDAPI of this process: library, scheduler thread and error stack, shared by all devices.
#pragma once

#include <array>
#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "device/openhaptics/hd_api.h"

namespace hapticd::device::hd {

/// A device that takes part in the scheduler. Both calls come in the scheduler's thread.
class Participant {
 public:
  virtual ~Participant() = default;
  /// Once in each tick.
  virtual void onFrame() noexcept = 0;
  /// An error of this device, or one that names no known device.
  virtual void onError(Enum code) noexcept = 0;
};

/// All calls except drainErrors() must come from other threads than the scheduler's. They stop the scheduler
/// briefly, because the library allows most calls only then.
class Scheduler {
 public:
  /// The scheduler of this process; loads the library at first use. Throws LibraryError.
  static std::shared_ptr<Scheduler> get();

  const Api& api() const noexcept { return api_; }

  /// Opens a device: first by `name` unless empty, then by each default name. Throws std::runtime_error with
  /// all errors.
  Handle open(const std::string& name, std::string& nameThatWorked);
  void close(Handle device) noexcept;

  /// Runs `work` with this device current and the scheduler stopped.
  void whileStopped(Handle device, const std::function<void()>& work);

  /// The participant receives frames from now on. Throws std::runtime_error when the scheduler refuses.
  void join(Handle device, Participant& participant, double rate_Hz);
  void leave(Participant& participant) noexcept;

  /// Whether the library has reported a device error. It reports an identical error only once, so the next
  /// one may go unreported. Any thread.
  bool deviceErrorTold() const noexcept { return deviceErrorTold_.load(std::memory_order_relaxed); }

  /// Passes the errors on the stack to the devices that they name. Scheduler's thread.
  void drainErrors() noexcept;
  /// Empties the error stack and returns its text; empty when there was no error. Only while the scheduler is
  /// stopped.
  std::string takeErrors() noexcept;

 private:
  struct Member {
    Handle device;
    Participant* participant;
    SchedulerHandle scheduled;
  };
  class Pause;

  Scheduler();
  Handle tryOpen(const char* name, std::string& words);

  const Api api_;
  std::mutex mutex_;
  bool running_ = false;
  std::vector<Handle> open_;
  std::vector<Member> members_;  // changes only while the scheduler is stopped
  std::atomic<bool> deviceErrorTold_{false};
};

}  // namespace hapticd::device::hd
