// The one HDAPI of a process: its library, its scheduler thread, its error stack, shared by all its devices.
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

/// A device as the scheduler needs it. Both calls come in the scheduler's thread.
class Participant {
 public:
  virtual ~Participant() = default;
  /// Once in each tick.
  virtual void onFrame() noexcept = 0;
  /// An error of this device, or of nobody known.
  virtual void onError(Enum code) noexcept = 0;
};

/// All calls but drainErrors() are for other threads than the scheduler's; they stop the scheduler for a
/// moment, because the library allows most things only then.
class Scheduler {
 public:
  /// The scheduler of this process; loads the library at first use. Throws LibraryError.
  static std::shared_ptr<Scheduler> get();

  const Api& api() const noexcept { return api_; }

  /// Opens a device: first by `name` unless empty, then by each default name. Throws std::runtime_error with
  /// every error.
  Handle open(const std::string& name, std::string& nameThatWorked);
  void close(Handle device) noexcept;

  /// Runs `work` with this device current and the scheduler stopped.
  void whileStopped(Handle device, const std::function<void()>& work);

  /// From here on the participant gets frames. Throws std::runtime_error when the scheduler refuses.
  void join(Handle device, Participant& participant, double rate_Hz);
  void leave(Participant& participant) noexcept;

  /// Any thread: an error of a device was told before. The library tells an identical one only once, so from
  /// then on silence may hide the next.
  bool deviceErrorTold() const noexcept { return deviceErrorTold_.load(std::memory_order_relaxed); }

  /// Scheduler's thread: hands the errors on the stack to the devices that they name.
  void drainErrors() noexcept;
  /// Empties the error stack into words; empty when there was none. Only while the scheduler is stopped.
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
