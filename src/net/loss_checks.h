// Checks very many connections for loss without holding up other events.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "base/world.h"
//
#include <boost/asio/steady_timer.hpp>

namespace hapticd::net {

/// A connection that wants to be checked.
class LossChecked {
 public:
  virtual ~LossChecked() = default;
  /// Ends the connection when its peer is lost. Returns the time until the next check, or nothing for a
  /// series of checks that has ended.
  virtual std::optional<std::chrono::milliseconds> checkLoss(std::uint32_t series) = 0;
};

/// One timer for all connections: each check asks the system, and ten thousand that fall due at once must not
/// delay a message. Works for at most kSlice, then pauses for kPause; with more connections than that allows
/// each is checked less often. Loop thread.
class LossChecks {
 public:
  explicit LossChecks(boost::asio::io_context& context) : timer_(context) {}

  /// Begins a series of checks.
  void add(std::weak_ptr<LossChecked> connection, std::uint32_t series, std::chrono::milliseconds delay) {
    due_.emplace(base::now() + nanos(delay), Entry{std::move(connection), series});
    if (due_.begin()->first < next_) arm(due_.begin()->first);
  }

 private:
  static constexpr base::Nanos kSlice = 200'000;
  static constexpr base::Nanos kPause = 2'000'000;
  static constexpr base::Nanos kNever = INT64_MAX;

  struct Entry {
    std::weak_ptr<LossChecked> connection;
    std::uint32_t series;
  };

  static base::Nanos nanos(std::chrono::milliseconds time) { return std::chrono::nanoseconds(time).count(); }

  void arm(base::Nanos time) {
    next_ = time;
    timer_.expires_at(boost::asio::steady_timer::time_point(std::chrono::nanoseconds(time)));
    timer_.async_wait([this](const boost::system::error_code& error) {
      if (!error) run();
    });
  }

  void run() {
    const base::Nanos begin = base::now();
    base::Nanos now = begin;
    while (!due_.empty() && due_.begin()->first <= now && now - begin < kSlice) {
      const Entry entry = std::move(due_.extract(due_.begin()).mapped());
      if (const auto connection = entry.connection.lock()) {
        const auto again = connection->checkLoss(entry.series);
        if (again) due_.emplace(now + nanos(*again), entry);
      }
      now = base::now();
    }
    next_ = kNever;
    if (!due_.empty()) arm(std::max(due_.begin()->first, now + kPause));
  }

  boost::asio::steady_timer timer_;
  std::multimap<base::Nanos, Entry> due_;
  base::Nanos next_ = kNever;  // when the timer expires
};

}  // namespace hapticd::net
