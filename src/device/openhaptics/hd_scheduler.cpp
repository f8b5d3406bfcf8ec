#include "device/openhaptics/hd_scheduler.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

namespace hapticd::device::hd {
namespace {

constexpr int kMostErrors = 16;  // per call, so that a full stack cannot delay a tick

Code HAPTICD_HD_CALL runFrame(void* participant) {
  static_cast<Participant*>(participant)->onFrame();
  return kContinue;
}

// The library waits for a key when it rejects its licence; without a terminal it continues at once.
class NoKeyboard {
 public:
  NoKeyboard() : saved_(dup(STDIN_FILENO)) {
    const int nothing = ::open("/dev/null", O_RDONLY | O_CLOEXEC);
    if (nothing < 0) return;
    dup2(nothing, STDIN_FILENO);
    ::close(nothing);
  }
  ~NoKeyboard() {
    if (saved_ < 0) return;
    dup2(saved_, STDIN_FILENO);
    ::close(saved_);
  }
  NoKeyboard(const NoKeyboard&) = delete;
  NoKeyboard& operator=(const NoKeyboard&) = delete;

 private:
  int saved_;
};

std::string quoted(const char* name) {
  return name == nullptr ? "the default device" : "'" + std::string(name) + "'";
}

}  // namespace

// Holds the lock and stops the scheduler; restarts it afterwards if there are members.
class Scheduler::Pause {
 public:
  explicit Pause(Scheduler& scheduler) : scheduler_(scheduler), lock_(scheduler.mutex_) {
    if (scheduler_.running_) scheduler_.api_.stopScheduler();
    scheduler_.running_ = false;
  }
  ~Pause() {
    if (scheduler_.members_.empty()) return;
    scheduler_.api_.startScheduler();
    scheduler_.running_ = true;
  }
  Pause(const Pause&) = delete;
  Pause& operator=(const Pause&) = delete;

 private:
  Scheduler& scheduler_;
  std::lock_guard<std::mutex> lock_;
};

std::shared_ptr<Scheduler> Scheduler::get() {
  static std::mutex mutex;
  static std::shared_ptr<Scheduler> scheduler;
  const std::lock_guard lock(mutex);
  if (!scheduler) scheduler.reset(new Scheduler);
  return scheduler;
}

Scheduler::Scheduler() : api_(DynamicLibrary(libraryNames())) {
  // drainErrors() iterates over it in the scheduler's thread.
  members_.reserve(16);
}

Handle Scheduler::open(const std::string& name, std::string& nameThatWorked) {
  const Pause pause(*this);
  const NoKeyboard noKeyboard;
  // Without a configured name: some vendor drivers know the default device by none, some by one of these.
  std::vector<const char*> names{nullptr, "Default Device", "Default PHANToM"};
  if (!name.empty()) names = {name.c_str()};

  std::string words;
  for (const char* candidate : names) {
    const Handle device = tryOpen(candidate, words);
    if (device == kInvalidHandle) continue;
    open_.push_back(device);
    nameThatWorked = quoted(candidate);
    return device;
  }
  throw std::runtime_error(
      "no OpenHaptics device opens: " + words +
      "; check that it is connected and powered, and that the vendor's setup tool sees it");
}

Handle Scheduler::tryOpen(const char* name, std::string& words) {
  const Handle device = api_.initDevice(name);
  // The handle decides: the library does not push an error that repeats an earlier one.
  std::string reason = takeErrors();
  if (device != kInvalidHandle && std::find(open_.begin(), open_.end(), device) != open_.end()) {
    reason = "is open already";
  } else if (device != kInvalidHandle) {
    return device;
  } else if (reason.empty()) {
    reason = "fails as before";
  }
  words += (words.empty() ? "" : "; ") + quoted(name) + ": " + reason;
  return kInvalidHandle;
}

void Scheduler::close(Handle device) noexcept {
  const Pause pause(*this);
  api_.makeCurrentDevice(device);
  api_.disableDevice(device);
  open_.erase(std::remove(open_.begin(), open_.end(), device), open_.end());
}

void Scheduler::whileStopped(Handle device, const std::function<void()>& work) {
  const Pause pause(*this);
  api_.makeCurrentDevice(device);
  work();
}

void Scheduler::join(Handle device, Participant& participant, double rate_Hz) {
  {
    const Pause pause(*this);
    api_.makeCurrentDevice(device);
    takeErrors();
    if (rate_Hz != 1000) api_.setSchedulerRate(static_cast<unsigned long>(rate_Hz));
    api_.enable(kForceOutput);
    const std::string words = takeErrors();
    if (!words.empty()) {
      throw std::runtime_error("the OpenHaptics device refuses force output at " +
                               std::to_string(static_cast<int>(rate_Hz)) + " Hz: " + words);
    }
    const SchedulerHandle scheduled = api_.scheduleAsynchronous(&runFrame, &participant, kFirstPriority);
    const std::string unscheduled = takeErrors();
    if (!unscheduled.empty()) {
      throw std::runtime_error("the OpenHaptics library does not schedule the servo loop: " + unscheduled);
    }
    members_.push_back({device, &participant, scheduled});
  }
}

void Scheduler::leave(Participant& participant) noexcept {
  const Pause pause(*this);
  const auto member = std::find_if(members_.begin(), members_.end(),
                                   [&](const Member& m) { return m.participant == &participant; });
  if (member == members_.end()) return;
  api_.unschedule(member->scheduled);
  members_.erase(member);
}

void Scheduler::drainErrors() noexcept {
  for (int i = 0; i < kMostErrors; ++i) {
    const ErrorInfo error = api_.getError();
    if (error.code == kSuccess) return;
    if (isDeviceError(error.code)) deviceErrorTold_.store(true, std::memory_order_relaxed);
    const bool known = std::any_of(members_.begin(), members_.end(),
                                   [&](const Member& m) { return m.device == error.device; });
    for (const Member& member : members_) {
      if (!known || member.device == error.device) member.participant->onError(error.code);
    }
  }
}

std::string Scheduler::takeErrors() noexcept {
  std::string words;
  for (int i = 0; i < kMostErrors; ++i) {
    const ErrorInfo error = api_.getError();
    if (error.code == kSuccess) break;
    words += (words.empty() ? "" : ", ") + std::string(errorName(error.code)) + " (internal code " +
             std::to_string(error.internalCode) + ")";
  }
  return words;
}

}  // namespace hapticd::device::hd
