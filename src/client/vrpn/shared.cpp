#include "hapticd/vrpn/vrpn_Shared.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "base/world.h"

namespace {

constexpr std::int64_t kMillion = 1000000;

// Longer times are taken for this one, some 73,000 years, so that sums of two do not overflow.
constexpr std::int64_t kMost_us = std::numeric_limits<std::int64_t>::max() / 4;

std::int64_t microseconds(const timeval& t) {
  const auto limited = [](std::int64_t value, std::int64_t most) { return std::clamp(value, -most, most); };
  return limited(t.tv_sec, kMost_us / kMillion) * kMillion + limited(t.tv_usec, kMost_us);
}
timeval fromMicroseconds(std::int64_t us) {
  return {us / kMillion, us % kMillion};
}
timeval fromMicroseconds(double us) {
  constexpr auto kMost = static_cast<double>(kMost_us);
  return std::isnan(us) ? timeval{}
                        : fromMicroseconds(std::int64_t{std::llround(std::clamp(us, -kMost, kMost))});
}

}  // namespace

timeval vrpn_TimevalNormalize(const timeval& t) {
  return fromMicroseconds(microseconds(t));
}
timeval vrpn_TimevalSum(const timeval& a, const timeval& b) {
  return fromMicroseconds(microseconds(a) + microseconds(b));
}
timeval vrpn_TimevalDiff(const timeval& a, const timeval& b) {
  return fromMicroseconds(microseconds(a) - microseconds(b));
}
timeval vrpn_TimevalScale(const timeval& t, double factor) {
  return fromMicroseconds(static_cast<double>(microseconds(t)) * factor);
}
unsigned long vrpn_TimevalDuration(timeval end, timeval start) {
  return static_cast<unsigned long>(microseconds(end) - microseconds(start));
}
double vrpn_TimevalDurationSeconds(timeval end, timeval start) {
  return static_cast<double>(microseconds(end) - microseconds(start)) / static_cast<double>(kMillion);
}
bool vrpn_TimevalGreater(const timeval& a, const timeval& b) {
  return microseconds(a) > microseconds(b);
}
bool vrpn_TimevalEqual(const timeval& a, const timeval& b) {
  return microseconds(a) == microseconds(b);
}
double vrpn_TimevalMsecs(const timeval& t) {
  return static_cast<double>(microseconds(t)) / 1000;
}
timeval vrpn_MsecsTimeval(const double ms) {
  return fromMicroseconds(ms * 1000);
}
void vrpn_SleepMsecs(double ms) {
  hapticd::base::sleepFor(hapticd::base::toNanos(std::fmin(std::fmax(ms * 1e-3, 0), 1e9)));
}

int vrpn_buffer(char** insert, vrpn_int32* left, const timeval t) {
  if (*left < 8) return -1;
  vrpn_buffer(insert, left, static_cast<vrpn_int32>(t.tv_sec));
  return vrpn_buffer(insert, left, static_cast<vrpn_int32>(t.tv_usec));
}

int vrpn_unbuffer(const char** buffer, timeval* t) {
  vrpn_int32 seconds = 0;
  vrpn_int32 us = 0;
  vrpn_unbuffer(buffer, &seconds);
  vrpn_unbuffer(buffer, &us);
  *t = {seconds, us};
  return 0;
}

int vrpn_buffer(char** insert, vrpn_int32* left, const char* text, vrpn_int32 length) {
  const std::size_t size = length < 0 ? std::strlen(text) + 1 : static_cast<std::size_t>(length);
  if (*left < 0 || static_cast<std::size_t>(*left) < size) return -1;
  std::memcpy(*insert, text, size);
  *insert += size;
  *left -= static_cast<vrpn_int32>(size);
  return 0;
}

int vrpn_unbuffer(const char** buffer, char* text, vrpn_int32 length) {
  // As in VRPN, a negative length is the size of the buffer for text that ends with a NUL.
  const auto room = static_cast<std::size_t>(length < 0 ? -length : length);
  std::size_t size = room;
  if (length < 0) {
    size = strnlen(*buffer, room) + 1;
    if (size > room) return -1;
  }
  std::memcpy(text, *buffer, size);
  *buffer += size;
  return 0;
}
