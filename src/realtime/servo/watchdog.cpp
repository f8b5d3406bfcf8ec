#include "realtime/servo/watchdog.h"

#include <algorithm>

#include "base/world.h"
#include "realtime/servo/thread_setup.h"

namespace hapticd::realtime {
namespace {

constexpr int kAboveTheServo = 1;
constexpr Nanos kSuspension = 100'000'000;  // less is the error of two clock readings

}  // namespace

void Watchdog::start() {
  if (thread_.running()) return;
  ended_ = tick_.finishedAt();
  isSetUp_ = false;
  watching_.store(true, std::memory_order_release);
  thread_ = base::Thread({.name = "watchdog"}, [this] { return step(); });
}

void Watchdog::stop() noexcept {
  watching_.store(false, std::memory_order_release);
  thread_.stop();
}

Nanos Watchdog::silence() const noexcept {
  const Nanos finished = tick_.finishedAt();
  if (!watching_.load(std::memory_order_acquire) || finished == ended_.load(std::memory_order_acquire))
    return 0;
  return std::max<Nanos>(clock_.now() - finished, 0);
}

std::optional<Nanos> Watchdog::step() noexcept {
  if (!watching_.load(std::memory_order_acquire)) return std::nullopt;
  if (!isSetUp_) {
    isSetUp_ = true;
    ThreadRequest request{.lockMemory = false};
    request.priority += kAboveTheServo;
    setUpThread(request);
    suspendedBefore_ = suspended_();
  }
  if (const Nanos suspended = suspended_(); suspended - suspendedBefore_ > kSuspension) {
    suspendedBefore_ = suspended;
    tick_.control().stop(clock_.now());
    resumed_.store(true, std::memory_order_release);
  }
  const bool silent = silence() > kSilence;
  if (silent) canZero_.store(tick_.overtake(), std::memory_order_release);
  overtook_.store(silent, std::memory_order_release);
  return base::now() + kStep;
}

}  // namespace hapticd::realtime
