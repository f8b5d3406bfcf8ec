// Which of the pending ticks are worth reporting, and a pass over all clients: the newest state wins.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>

#include "base/time.h"
#include "base/world.h"

namespace hapticd::server {

/// Limits the age of reports when the net thread is behind. Of the ticks that wait it admits the newest ones:
/// as many as can be sent to all clients within kCatchUp, and at most kMaxAge back. The costs are the
/// smallest of the last few passes, so that one preemption is not taken for load. Pure; one for each device.
class FreshTicks {
 public:
  static constexpr base::Nanos kMaxAge = 12'000'000;
  static constexpr base::Nanos kCatchUp = 3'000'000;
  static constexpr base::Nanos kSlice = 300'000;  ///< of a pass, before other events have their turn

  explicit FreshTicks(double rate_Hz) : period_(std::max<base::Nanos>(base::toNanos(1 / rate_Hz), 1)) {}

  /// How many ticks all clients can be sent within kCatchUp; at least one.
  std::size_t affordable() const {
    const base::Nanos left = std::max<base::Nanos>(kCatchUp - flush_.least(), 0);
    const auto cheap = static_cast<std::size_t>(left / std::max<base::Nanos>(tick_.least(), 1));
    const auto young = static_cast<std::size_t>(kMaxAge / period_);
    return std::max<std::size_t>(std::min(cheap, young), 1);
  }
  /// Time for queueing the reports of one tick for all clients, including what leaves at once.
  void tickTook(base::Nanos time) { tick_.add(time); }
  /// Time for flushing the queues of all clients.
  void flushTook(base::Nanos time) { flush_.add(time); }

 private:
  class Recent {
   public:
    void add(base::Nanos time) { times_[next_++ % times_.size()] = std::max<base::Nanos>(time, 0); }
    base::Nanos least() const {
      const auto known = static_cast<std::ptrdiff_t>(std::min(next_, times_.size()));
      return known == 0 ? 0 : *std::min_element(times_.begin(), times_.begin() + known);
    }

   private:
    std::array<base::Nanos, 8> times_{};
    std::size_t next_ = 0;
  };

  base::Nanos period_;
  Recent tick_;
  Recent flush_;
};

/// One slice of a pass over all clients: from `next` on, until `end` or for kSlice. The next slice takes
/// newer ticks first. `send(client, most)` queues what the client misses, one by one if that is at most this
/// many reports, and returns the number of reports; `flush(client)` sends what is queued. `clients`: how many
/// there are. Returns the client with whom the next slice begins.
template <class Iterator, class Send, class Flush>
Iterator serveSlice(Iterator next, Iterator end, std::size_t clients, FreshTicks& fresh, const Send& send,
                    const Flush& flush) {
  std::size_t reports = 0;
  std::size_t served = 0;  // clients that got any
  std::size_t visited = 0;
  base::Nanos sending = 0;
  base::Nanos flushing = 0;
  const base::Nanos start = base::now();
  base::Nanos now = start;
  for (; next != end && now - start <= FreshTicks::kSlice; ++next, ++visited) {
    const std::size_t got = send(*next, fresh.affordable());
    reports += got;
    served += got > 0 ? 1 : 0;
    const base::Nanos sent = base::now();
    sending += sent - now;
    flush(*next);
    now = base::now();
    flushing += now - sent;
  }
  if (visited == 0) return next;
  const double all = static_cast<double>(clients) / static_cast<double>(visited);
  const auto timesAll = [all](base::Nanos time, double share) {
    return static_cast<base::Nanos>(static_cast<double>(time) * all * share);
  };
  if (reports > 0)
    fresh.tickTook(timesAll(sending, static_cast<double>(served) / static_cast<double>(reports)));
  fresh.flushTook(timesAll(flushing, 1));
  return next;
}

}  // namespace hapticd::server
