// Rows of a stream of ticks: each tick is one, and a person is told of those that are missing.
#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <optional>

#include "hapticd/reports.h"

namespace hapticd::apps {

/// Counts the ticks between others that did not arrive.
class MissingTicks {
 public:
  /// False for a tick that is not later than one before: a server repeats the newest one to a client that has
  /// caught up, and datagrams may overtake it. Numbers begin again in a replay, times do not.
  bool add(const TickReport& report) noexcept {
    if (lastTick_ && report.tickTime <= lastTime_) return false;
    if (lastTick_ && report.tick > *lastTick_ + 1) missing_ += report.tick - *lastTick_ - 1;
    lastTick_ = report.tick;
    lastTime_ = report.tickTime;
    return true;
  }
  /// After a new connection: the server may count anew.
  void restart() noexcept { lastTick_.reset(); }
  /// Prints the number, unless it is 0 or ticks are left out on purpose at this rate.
  void print(const char* program, double rate_Hz, double servoRate_Hz) const {
    if (missing_ == 0 || rate_Hz < servoRate_Hz) return;
    std::fprintf(stderr,
                 "%s: %llu ticks between the first and the last are missing: this program or the network was "
                 "too slow for them. The server itself loses none: hapticd record --server\n",
                 program, static_cast<unsigned long long>(missing_));
  }

 private:
  std::optional<std::uint64_t> lastTick_;
  std::chrono::nanoseconds lastTime_{};
  std::uint64_t missing_ = 0;
};

}  // namespace hapticd::apps
