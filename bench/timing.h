// Time, and a cache that has seen other work.
#pragma once

#include <time.h>

#include <cstdint>
#include <vector>
#if defined(__x86_64__)
#include <x86intrin.h>
#endif

namespace hapticd::bench {

/// CLOCK_MONOTONIC, nanoseconds.
inline std::int64_t nowNs() noexcept {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return std::int64_t{1'000'000'000} * t.tv_sec + t.tv_nsec;
}

void sleepUntilNs(std::int64_t deadline) noexcept;

/// For what takes tens of nanoseconds, where the system's clock is too coarse: the processor's counter, less
/// what it costs to read it.
class FineClock {
 public:
  FineClock();

  /// Microseconds that f() takes.
  template <class F>
  double timeUs(F&& f) const {
    const std::int64_t begin = read();
    f();
    const std::int64_t took = read() - begin - cost_;
    return took > 0 ? static_cast<double>(took) * us_per_count_ : 0;
  }

 private:
  static std::int64_t read() noexcept {
#if defined(__x86_64__)
    unsigned core = 0;
    const auto count = static_cast<std::int64_t>(__rdtscp(&core));
    _mm_lfence();
    return count;
#else
    return nowNs();
#endif
  }

  double us_per_count_ = 1e-3;
  std::int64_t cost_ = 0;
};

/// Writes 64 MB, so that nothing of anybody else stays in the caches.
class Evictor {
 public:
  Evictor() : memory_(64U << 20) {}
  void evict() noexcept;

 private:
  std::vector<unsigned char> memory_;
};

/// Gives the calling thread what a servo thread has, as far as the system grants it; true when it got
/// SCHED_FIFO.
bool becomeRealtime();
/// Whether this machine grants SCHED_FIFO to us.
bool realtimeGranted();

}  // namespace hapticd::bench
