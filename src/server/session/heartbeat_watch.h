// The watchdog of a client that opted into heartbeats.
#pragma once

#include <optional>
#include <utility>

#include "base/time.h"

namespace hapticd::server {

/// One for each connection; reads no clock. Time during which the server itself does not read from the client
/// does not count as silence, but it excuses a client for a limited time only.
class HeartbeatWatch {
 public:
  /// Silence after which the client is lost.
  static constexpr base::Nanos kLimit = 500'000'000;
  /// Total length of pauses, and of other data, without a heartbeat in between after which the client's
  /// forces end. Its connection stays while data arrives.
  static constexpr base::Nanos kExcuse = 5'000'000'000;

  enum class Verdict {
    alive,
    lost,     ///< silent for kLimit: end the connection
    excused,  ///< without a heartbeat for kExcuse: end its forces until one arrives; returned again every
              ///< kLimit
  };

  /// A heartbeat was received: starts or continues the watch. True when the client's forces were ended
  /// before.
  bool beat(base::Nanos now) noexcept {
    last_ = now;
    excuse_ = kExcuse;
    return std::exchange(ended_, std::nullopt).has_value();
  }
  /// The client opted out of heartbeats. True when its forces were ended before.
  bool disable() noexcept {
    last_.reset();
    return std::exchange(ended_, std::nullopt).has_value();
  }

  /// Whether the client's forces were ended, and no heartbeat has arrived since.
  bool ended() const noexcept { return ended_.has_value(); }

  /// The server stops reading from the client.
  void pause(base::Nanos now) noexcept {
    if (!paused_) paused_ = now;
  }
  /// The server reads again: the limit counts from here.
  void resume(base::Nanos now) noexcept {
    if (!paused_) return;
    excuse_ -= now - *paused_;
    paused_.reset();
    if (last_) last_ = now;
  }

  /// Other data of the client was received: heartbeats may be behind it, on a link that is slower than the
  /// client.
  void receive(base::Nanos now) noexcept {
    if (!last_ || paused_) return;
    excuse_ -= now - *last_;
    last_ = now;
  }

  /// The server stood still until now and may not have read heartbeats that were sent.
  void excuseStall(base::Nanos now) noexcept {
    if (last_ && !paused_) last_ = now;
  }

  Verdict check(base::Nanos now) noexcept {
    if (!last_) return Verdict::alive;
    if (!paused_ && now - *last_ > kLimit) return Verdict::lost;
    const base::Nanos left = paused_ ? excuse_ - (now - *paused_) : excuse_;
    if (left >= 0 || (ended_ && now - *ended_ <= kLimit)) return Verdict::alive;
    ended_ = now;
    return Verdict::excused;
  }

 private:
  std::optional<base::Nanos> last_;    // empty: not watched
  std::optional<base::Nanos> paused_;  // since when the server does not read
  base::Nanos excuse_ = kExcuse;       // the remaining part
  std::optional<base::Nanos> ended_;   // when its forces were ended last, without a heartbeat since
};

}  // namespace hapticd::server
