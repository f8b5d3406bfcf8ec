// Detects a lost peer from the system's record of its acknowledgements.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <optional>

#include "base/time.h"

namespace hapticd::net {

/// The state of a connection as the system reports it (TCP_INFO).
struct LinkState {
  bool inFlight = false;                    ///< sent bytes that the peer has not acknowledged
  int probes = 0;                           ///< window or keep-alive probes without an answer so far
  bool windowClosed = false;                ///< the peer takes no bytes at present
  std::uint32_t retransmissions = 0;        ///< since the start of the connection
  std::chrono::milliseconds sinceHeard{0};  ///< since the last acknowledgement or data
};

/// Measures how long an acknowledgement has been due. A peer whose program does not read still acknowledges,
/// so it is never lost. Time between two checks counts for two intervals at most: after a stall of this
/// machine the answers are still in its queues. Pure; one for each connection.
///
/// While the peer's window is closed the system probes it at growing intervals, so a peer that does not read
/// for some time and then vanishes is noticed only after about the same time. A peer without memory can close
/// its window below bytes in flight: it discards them and answers, and their retransmissions are the probes.
class LossWatch {
 public:
  using Milliseconds = std::chrono::milliseconds;

  /// With a timeout of zero no peer is ever lost.
  explicit LossWatch(Milliseconds timeout) : timeout_(timeout) {}

  bool active() const { return timeout_ > Milliseconds::zero(); }
  /// Interval at which to call isLost().
  Milliseconds interval() const { return std::max(timeout_ / 5, Milliseconds(1)); }

  bool isLost(LinkState link, base::Nanos now) {
    const auto gap = std::chrono::duration_cast<Milliseconds>(std::chrono::nanoseconds(now - lastCheck_));
    lastCheck_ = now;
    countProbesInFlight(link, gap);
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
  // Peers answer probes at most twice per second, so silence after an earlier probe means nothing.
  static constexpr Milliseconds kAnswerPause{600};

  void countProbesInFlight(LinkState& link, Milliseconds gap) {
    const bool probing = link.inFlight && link.windowClosed;
    if (!probing || link.sinceHeard <= gap) answered_ = link.retransmissions;
    if (!probing) return;
    link.inFlight = false;
    link.probes += static_cast<int>(link.retransmissions - answered_);
  }

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
  std::uint32_t answered_ = 0;          // retransmissions at the last answer
  std::optional<bool> probeCounts_;     // whether the first probe requires an answer
  std::optional<Milliseconds> waited_;  // time since an answer became due
};

}  // namespace hapticd::net
