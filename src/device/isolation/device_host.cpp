#include "device/isolation/device_host.h"

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <exception>
#include <string>
#include <utility>

#include "base/world.h"
#include "device/isolation/shared_block.h"

namespace hapticd::device {
namespace {

using namespace isolation;

// The loop on this side: state out, the newest force in, one tick late.
class Exchange {
 public:
  Exchange(Device& device, SharedBlock& block, const DeviceHostOptions& options)
      : device_(device),
        block_(block),
        period_(base::toNanos(1 / options.rate_Hz)),
        commandLife_(commandLife(period_)),
        beforeFirstTick_(options.beforeFirstTick) {}
  ~Exchange() { stop(); }

  void start() {
    if (device_.traits().selfPaced) {
      device_.start([this, first = true](Nanos now) mutable {
        if (std::exchange(first, false) && beforeFirstTick_) beforeFirstTick_();
        tick(now);
      });
    } else if (!thread_.running()) {
      leave_ = false;
      thread_ = base::BlockingThread({.name = "device host"}, [this] { run(); });
    }
  }

  void stop() noexcept {
    device_.stop();
    leave_ = true;
    if (!thread_.running()) return;
    thread_.join();
    device_.write(Vec3::Zero());
  }

 private:
  void tick(Nanos now) noexcept {
    DeviceState state;
    const bool valid = device_.read(now, state);
    Posted posted = Posted::of(state);
    posted.valid = valid ? 1 : 0;
    posted.lost = device_.lost() ? 1 : 0;
    posted.time = base::now();
    block_.state.write(posted);
    countUp(block_.posts);

    const Command& command = block_.command.read();
    if (command.number != lastCommand_) {
      lastCommand_ = command.number;
      commandTime_ = now;
    }
    const bool ended = command.number <= block_.endedUpTo.load(std::memory_order_acquire);
    const bool fresh = !ended && now - commandTime_ <= commandLife_ && command.force_N.allFinite();
    device_.write(fresh ? command.force_N : Vec3(Vec3::Zero()));
    if (device_.zeroSent()) block_.sentUpTo.store(lastCommand_, std::memory_order_release);
  }

  void run() noexcept {
    if (beforeFirstTick_) beforeFirstTick_();
    for (Nanos due = base::now() + period_; !leave_; due += period_) {
      base::world().clock.sleepUntil(due);
      const Nanos now = base::now();
      if (now > due + period_) due = now;  // no catch-up ticks
      tick(now);
    }
  }

  Device& device_;
  SharedBlock& block_;
  const Nanos period_;
  const Nanos commandLife_;
  const std::function<void()> beforeFirstTick_;
  base::BlockingThread thread_;
  std::atomic<bool> leave_{false};
  std::uint64_t lastCommand_ = 0;
  Nanos commandTime_ = 0;
};

bool serverIsGone() {
  pollfd server{kSocketDescriptor, 0, 0};
  return poll(&server, 1, 0) > 0 && (server.revents & (POLLHUP | POLLERR)) != 0;
}

std::string answer(const std::string& request, Device& device, SharedBlock& block, Exchange& exchange) {
  const auto stopped = [&] {
    return block.stopsCalibration.load(std::memory_order_acquire) != 0 || serverIsGone();
  };
  try {
    if (request == "start") exchange.start();
    if (request == "stop") exchange.stop();
    if (request == "calibrate") device.calibrate(stopped);
    return "+" + (request == "fault" ? device.faultText() : std::string());
  } catch (const std::exception& error) {
    return std::string("-") + error.what();
  }
}

bool send(const std::string& text) {
  return ::send(kSocketDescriptor, text.data(), text.size(), MSG_NOSIGNAL) >= 0;
}

// Empty when the server is gone.
std::string receive() {
  char text[64];
  long size = -1;
  do {
    size = recv(kSocketDescriptor, text, sizeof text, 0);
  } while (size < 0 && errno == EINTR);
  return {text, size > 0 ? static_cast<std::size_t>(size) : 0};
}

}  // namespace

int refuseDeviceHost(const std::string& reason) {
  send("-" + reason);
  return 1;
}

int runDeviceHost(Device& device, const DeviceHostOptions& options) {
  // Signals concern the server, which then ends this process in order; so does its death.
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP, SIGTTOU, SIGPIPE}) {
    std::signal(signal, SIG_IGN);
  }
  try {
    const SharedMemory memory(kMemoryDescriptor);
    try {
      device.open();
    } catch (const std::exception& error) {
      return refuseDeviceHost(error.what());
    }
    DeviceTraits traits = device.traits();
    const Nanos life = commandLife(base::toNanos(1 / options.rate_Hz));
    traits.forceLife = traits.forceLife > 0 ? std::min(traits.forceLife, life) : life;
    memory->profile = SharedProfile::of(device.profile(), traits);
    {
      Exchange exchange(device, *memory, options);
      send("+");
      for (std::string request = receive(); !request.empty(); request = receive()) {
        send(answer(request, device, *memory, exchange));
      }
    }
    device.close();
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "device host: %s\n", error.what());
    return 1;
  }
}

}  // namespace hapticd::device
