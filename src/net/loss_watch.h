// Whether a peer is gone, told from what the system knows of its acknowledgements.
#pragma once

#include <algorithm>
#include <chrono>
#include <optional>

#include "base/time.h"

namespace hapticd::net {

/// What the system tells of a connection at one moment (TCP_INFO).
struct LinkState {
  bool inFlight = false;                    ///< something was sent that the peer has not acknowledged
  int probes = 0;                           ///< window or keep-alive probes without an answer so far
  std::chrono::milliseconds sinceHeard{0};  ///< since the last acknowledgement or data
};

/// Counts the time in which a peer should acknowledge and is silent. A peer whose program does not read
/// acknowledges all the same, so it is never lost. Time in which nobody looked counts for two intervals at
/// most: after a stall of this machine the answers are still on their way. Pure; one for each connection.
///
/// While the peer's window is closed the system probes it ever more rarely: a peer that stood still for some
/// time and then vanishes is noticed only after as long again.
class LossWatch {
 public:
  using Milliseconds = std::chrono::milliseconds;

  /// A timeout of zero never finds anything lost.
  explicit LossWatch(Milliseconds timeout) : timeout_(timeout) {}

  bool active() const { return timeout_ > Milliseconds::zero(); }
  /// How often isLost() wants to be asked.
  Milliseconds interval() const { return std::max(timeout_ / 5, Milliseconds(1)); }

  bool isLost(const LinkState& link, base::Nanos now) {
    const auto gap = std::chrono::duration_cast<Milliseconds>(std::chrono::nanoseconds(now - lastCheck_));
    lastCheck_ = now;
    const bool silent = awaitsAnswer(link);
    if (!silent) {
      waited_.reset();
    } else if (!waited_) {
      waited_ = Milliseconds::zero();
    } else {
      waited_ = std::min(*waited_ + std::clamp(gap, Milliseconds::zero(), 2 * interval()), link.sinceHeard);
    }
    return active() && waited_ && *waited_ >= timeout_;
  }

 private:
  // Peers answer probes at most twice a second: one that comes sooner after an answer tells nothing.
  static constexpr Milliseconds kAnswerPause{600};

  bool awaitsAnswer(const LinkState& link) {
    if (link.probes == 0) {
      probeCounts_.reset();
    } else if (!probeCounts_) {
      probeCounts_ = link.sinceHeard > kAnswerPause + interval();
    }
    return link.inFlight || link.probes > 1 || probeCounts_.value_or(false);
  }

  Milliseconds timeout_;
  base::Nanos lastCheck_ = 0;
  std::optional<bool> probeCounts_;     // whether the first probe must have an answer
  std::optional<Milliseconds> waited_;  // how long an answer is due
};

}  // namespace hapticd::net
