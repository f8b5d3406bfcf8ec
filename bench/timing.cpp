#include "bench/timing.h"

#include <algorithm>
#include <cerrno>
#include <thread>

#include "realtime/servo/thread_setup.h"

namespace hapticd::bench {

void sleepUntilNs(std::int64_t deadline) noexcept {
  timespec t{};
  t.tv_sec = deadline / 1'000'000'000;
  t.tv_nsec = deadline % 1'000'000'000;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, nullptr) == EINTR) {
  }
}

FineClock::FineClock() {
  const std::int64_t begin_ns = nowNs();
  const std::int64_t begin = read();
  sleepUntilNs(begin_ns + 50'000'000);
  const std::int64_t counts = read() - begin;
  us_per_count_ = static_cast<double>(nowNs() - begin_ns) * 1e-3 / static_cast<double>(counts);
  std::vector<std::int64_t> costs(10'001);
  for (std::int64_t& cost : costs) {
    const std::int64_t first = read();
    cost = read() - first;
  }
  std::nth_element(costs.begin(), costs.begin() + 5'000, costs.end());
  cost_ = costs[5'000];
}

void Evictor::evict() noexcept {
  volatile unsigned char* bytes = memory_.data();
  for (std::size_t i = 0; i < memory_.size(); i += 64) bytes[i] = static_cast<unsigned char>(bytes[i] + 1);
}

bool becomeRealtime() {
  return realtime::setUpThread({.realtime = true, .priority = 80, .cpu = -1, .lockMemory = false})
      .scheduling.granted;
}

bool realtimeGranted() {
  bool granted = false;
  std::thread([&] { granted = becomeRealtime(); }).join();
  return granted;
}

}  // namespace hapticd::bench
