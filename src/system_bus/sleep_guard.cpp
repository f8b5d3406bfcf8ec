#include "system_bus/sleep_guard.h"

#include <fcntl.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <utility>

#include "base/world.h"
#include "system_bus/bus.h"

namespace hapticd::system_bus {
namespace {

constexpr const char* kLogind = "org.freedesktop.login1";
constexpr const char* kManager = "org.freedesktop.login1.Manager";
constexpr int kLongestRetry_ms = 60'000;

// A lock that logind gave out, held until its descriptor is closed.
class Lock {
 public:
  Lock() = default;
  ~Lock() { release(); }
  Lock(const Lock&) = delete;
  Lock& operator=(const Lock&) = delete;

  bool held() const noexcept { return fd_ != kNoFd; }
  void release() noexcept {
    if (held()) ::close(std::exchange(fd_, kNoFd));
  }
  /// Returns why logind refused; empty: held.
  std::string take(Bus& bus, const char* mode, const char* why) {
    const Message request = bus.makeCall(kLogind, "/org/freedesktop/login1", kManager, "Inhibit");
    sd_bus_message_append(request.get(), "ssss", "sleep", "hapticd", why, mode);
    const Reply reply = bus.call(request.get());
    if (!reply.message) return reply.reason;
    int fd = kNoFd;
    if (sd_bus_message_read(reply.message.get(), "h", &fd) < 0) return "it gave no lock";
    fd_ = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);  // the message owns its own
    return held() ? "" : std::strerror(errno);
  }

 private:
  int fd_ = kNoFd;
};

// What is held at one logind.
class Locks {
 public:
  Locks(Bus& bus, std::function<bool()>& armed, std::function<void()>& stopForces)
      : bus_(bus), armed_(armed), stopForces_(stopForces) {
    bus_.onSignal(kLogind, kManager, "PrepareForSleep", onSleep, this);
    bus_.onOwnerChange(kLogind, onOwner, this);
  }

  /// Called again and again.
  void update() {
    if (std::exchange(sleepAnnounced_, false)) {
      spdlog::warn("the machine goes to sleep: forces are stopped until re-armed");
      stopForces_();
      delay_.release();
      block_.release();
    }
    if (asleep_) return;
    const bool armed = armed_();
    if (!armed) {
      delay_.release();
      block_.release();
    } else if (!asked_ || base::now() >= askAgain_) {
      ask(!asked_);
    }
    asked_ = armed;
  }

 private:
  // For what is not held. A refusal may end: polkit's rules change, and other locks are given back.
  void ask(bool tells) {
    constexpr base::Nanos kAskAgain = 10'000'000'000;
    askAgain_ = base::now() + kAskAgain;
    const std::string delayed =
        delay_.held() ? "" : delay_.take(bus_, "delay", "the forces on a hand must end first");
    if (!delayed.empty() && tells) spdlog::info("logind does not wait for the end of forces: {}", delayed);
    const std::string blocked = block_.held() ? "" : block_.take(bus_, "block", "a hand feels forces");
    if (!blocked.empty() && tells)
      spdlog::info("logind does not keep the machine awake for the forces: {}", blocked);
  }
  static int onSleep(sd_bus_message* signal, void* self, sd_bus_error*) noexcept {
    auto& locks = *static_cast<Locks*>(self);
    int begins = 0;
    sd_bus_message_read(signal, "b", &begins);
    locks.asleep_ = begins != 0;
    locks.sleepAnnounced_ = locks.asleep_;
    locks.asked_ = false;
    return 0;
  }
  // A logind that starts knows no locks.
  static int onOwner(sd_bus_message*, void* self, sd_bus_error*) noexcept {
    auto& locks = *static_cast<Locks*>(self);
    locks.delay_.release();
    locks.block_.release();
    locks.asked_ = locks.asleep_ = false;
    return 0;
  }

  Bus& bus_;
  std::function<bool()>& armed_;
  std::function<void()>& stopForces_;
  Lock delay_, block_;
  bool asked_ = false;  // for locks, since forces were armed
  base::Nanos askAgain_ = 0;
  bool asleep_ = false;
  bool sleepAnnounced_ = false;
};

}  // namespace

SleepGuard::SleepGuard(std::function<bool()> armed, std::function<void()> stopForces)
    : armed_(std::move(armed)),
      stopForces_(std::move(stopForces)),
      stopFd_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  thread_ = base::BlockingThread({.name = "sleep guard"}, [this] { run(); });
}

SleepGuard::~SleepGuard() {
  ::eventfd_write(stopFd_, 1);
  thread_.join();
  ::close(stopFd_);
}

void SleepGuard::run() {
  constexpr int kLook_ms = 250;
  int retry_ms = 1000;
  bool reported = false;
  eventfd_t stop = 0;
  while (::eventfd_read(stopFd_, &stop) != 0) {
    try {
      Bus bus(stopFd_);
      Locks locks(bus, armed_, stopForces_);
      while (::eventfd_read(stopFd_, &stop) != 0) {
        bus.process();
        locks.update();
        bus.wait(stopFd_, kLook_ms);
      }
      return;
    } catch (const Unavailable& reason) {
      if (!std::exchange(reported, true))
        spdlog::info("the machine may sleep while forces are armed: {}", reason.what());
    }
    pollfd wake{stopFd_, POLLIN, 0};
    ::poll(&wake, 1, retry_ms);
    retry_ms = std::min(2 * retry_ms, kLongestRetry_ms);
  }
}

}  // namespace hapticd::system_bus
