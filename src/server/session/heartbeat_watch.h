// The watchdog of a client that opted into heartbeats.
#pragma once

#include <optional>

#include "base/time.h"

namespace hapticd::server {

/// Pure; one for each connection. Time in which the server itself does not read from the client is never held against the
/// client, but it does not excuse a client for ever.
class HeartbeatWatch {
 public:
  /// Silence after which the client counts as lost.
  static constexpr base::Nanos kLimit = 500'000'000;
  /// How long pauses without a heartbeat in between excuse the client's forces.
  static constexpr base::Nanos kExcuse = 5'000'000'000;

  enum class Verdict {
    alive,
    lost,     ///< silent for kLimit: end the connection
    excused,  ///< paused for kExcuse: end its forces; said once
  };

  /// A heartbeat came: watching begins or goes on.
  void beat(base::Nanos now) noexcept {
    last_ = now;
    excuse_ = kExcuse;
    ended_ = false;
  }
  /// The client took its promise back.
  void forget() noexcept { last_.reset(); }

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

  Verdict check(base::Nanos now) noexcept {
    if (!last_) return Verdict::alive;
    if (!paused_) return now - *last_ > kLimit ? Verdict::lost : Verdict::alive;
    if (ended_ || now - *paused_ <= excuse_) return Verdict::alive;
    ended_ = true;
    return Verdict::excused;
  }

 private:
  std::optional<base::Nanos> last_;    // empty: not watched
  std::optional<base::Nanos> paused_;  // since when the server does not read
  base::Nanos excuse_ = kExcuse;       // what is left of it
  bool ended_ = false;                 // the excuse was spent and reported
};

}  // namespace hapticd::server
