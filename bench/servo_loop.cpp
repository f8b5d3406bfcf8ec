#include "bench/servo_loop.h"

#include <chrono>
#include <thread>

#include "base/time.h"

namespace hapticd::bench {

bool StrokingDevice::read(base::Nanos now, device::DeviceState& state) noexcept {
  state.time = now;
  state.position_m = hand_[next_].position_m;
  if (begun_.load(std::memory_order_acquire)) next_ = (next_ + 1) % hand_.size();
  return true;
}

ServoLoop::ServoLoop()
    : tick_(device_, clock_), servo_([this](const realtime::Pacing& p) { turn(p); }, clock_), ring_(kMost) {
  granted_ = servo_.start().scheduling.granted;
}

ServoLoop::~ServoLoop() {
  servo_.stop();
}

void ServoLoop::turn(const realtime::Pacing& pacing) noexcept {
  tick_(pacing);
  tick_.reports().consume([](const realtime::TickReport&) {});
  const std::uint64_t n = ticks_.load(std::memory_order_relaxed);
  ring_[n % kMost] = {pacing.wakeupError, tick_.last().timing.compute};
  ticks_.store(n + 1, std::memory_order_release);
}

LoopFigures ServoLoop::observe(double seconds) {
  const std::uint64_t begin = ticks_.load(std::memory_order_acquire);
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
  const std::uint64_t end = ticks_.load(std::memory_order_acquire);
  LoopFigures figures;
  for (std::uint64_t n = begin; n < end; ++n) {
    const Noted& noted = ring_[n % kMost];
    figures.wakeup_us.add(static_cast<double>(noted.wakeup_ns) * 1e-3);
    figures.compute_us.add(static_cast<double>(noted.compute_ns) * 1e-3);
    if (noted.wakeup_ns > realtime::kOverrunLateness) ++figures.overruns;
  }
  return figures;
}

}  // namespace hapticd::bench
