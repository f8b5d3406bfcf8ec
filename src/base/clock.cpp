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

}  // namespace hapticd::base
