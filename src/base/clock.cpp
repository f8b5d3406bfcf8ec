#include "base/clock.h"

#include <cerrno>
#include <ctime>

namespace hapticd::base {
namespace {

constexpr Nanos kSecond = 1'000'000'000;

Nanos read(clockid_t clock) noexcept {
  timespec time{};
  clock_gettime(clock, &time);
  return static_cast<Nanos>(time.tv_sec) * kSecond + time.tv_nsec;
}

}  // namespace

Nanos MonotonicClock::now() noexcept {
  return read(CLOCK_MONOTONIC);
}

Nanos MonotonicClock::wallNow() noexcept {
  return read(CLOCK_REALTIME);
}

void MonotonicClock::sleepUntil(Nanos deadline) noexcept {
  timespec time{};
  time.tv_sec = deadline / kSecond;
  time.tv_nsec = deadline % kSecond;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

// Two clocks cannot be read at one moment: repeat a reading that was interrupted.
Nanos MonotonicClock::suspendedTime() noexcept {
  constexpr Nanos kUninterrupted = 1'000'000;
  Nanos before = 0;
  Nanos boot = 0;
  for (int i = 0; i < 10; ++i) {
    before = read(CLOCK_MONOTONIC);
    boot = read(CLOCK_BOOTTIME);
    if (read(CLOCK_MONOTONIC) - before < kUninterrupted) break;
  }
  return boot - before;
}

}  // namespace hapticd::base
