// How many of the pending ticks are worth reporting: the newest state wins.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/time.h"

namespace hapticd::server {

/// Limits the age of reports when the net thread is behind: of the ticks that wait it admits the newest ones,
/// as many as can be sent before the oldest of them is kMaxAge old. The costs are the smallest of the last
/// few passes, so that one preemption is not taken for load. Pure; one for each device.
class FreshTicks {
 public:
  static constexpr base::Nanos kMaxAge = 12'000'000;

  explicit FreshTicks(double rate_Hz) : period_(std::max<base::Nanos>(base::toNanos(1 / rate_Hz), 1)) {}

  /// How many of `pending` ticks to report, at least one.
  std::size_t admit(std::size_t pending) const {
    const base::Nanos left = std::max<base::Nanos>(kMaxAge - flush_.least(), 0);
    const auto most = static_cast<std::size_t>(left / (period_ + tick_.least()));
    return std::min(pending, std::max<std::size_t>(most, 1));
  }
  /// Time for queueing the reports of one tick for all clients, including what leaves at once.
  void tickTook(base::Nanos time) { tick_.add(time); }
  /// Time for flushing the queues of all clients at the end of a pass.
  void flushTook(base::Nanos time) { flush_.add(time); }

 private:
  class Recent {
   public:
    void add(base::Nanos time) { times_[next_++ % times_.size()] = std::max<base::Nanos>(time, 0); }
    base::Nanos least() const { return *std::min_element(times_.begin(), times_.end()); }

   private:
    std::array<base::Nanos, 8> times_{};
    std::size_t next_ = 0;
  };

  base::Nanos period_;
  Recent tick_;
  Recent flush_;
};

}  // namespace hapticd::server
