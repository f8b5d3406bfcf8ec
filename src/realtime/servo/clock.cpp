#include "realtime/servo/clock.h"

#include <cerrno>
#include <ctime>

namespace hapticd::realtime {
namespace {

constexpr Nanos kSecond = 1'000'000'000;

}  // namespace

Nanos MonotonicClock::now() noexcept {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<Nanos>(time.tv_sec) * kSecond + time.tv_nsec;
}

void MonotonicClock::sleepUntil(Nanos deadline) noexcept {
  timespec time{};
  time.tv_sec = deadline / kSecond;
  time.tv_nsec = deadline % kSecond;
  while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, nullptr) == EINTR) {
  }
}

}  // namespace hapticd::realtime
