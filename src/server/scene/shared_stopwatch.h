// The time that the builders of one scene take, measured once for all of them.
#pragma once

#include <cstddef>
#include <vector>

#include "base/time.h"
#include "base/world.h"

namespace hapticd::server {

using base::Nanos;

/// What to build, and for how long to pause after it, follows from readings of a stopwatch. The first builder
/// of a round takes them and the others get the same, so that all decide alike: a recording describes the
/// scene by one of them. Scene thread.
class SharedStopwatch {
 public:
  /// Each of them builds the same in turn.
  explicit SharedStopwatch(std::size_t builders) : builders_(static_cast<Nanos>(builders)) {}

  void beginRound() noexcept { shared_.clear(); }
  /// The next builder of the round reads from the beginning.
  void beginBuilder() noexcept {
    next_ = 0;
    given_.clear();
  }
  /// For SceneConfig::stopwatch: runs as fast as all builders work together.
  Nanos read() {
    if (next_ == shared_.size()) {
      const Nanos now = base::now();
      const Nanos started = shared_.empty() ? now : shared_.front();
      shared_.push_back(started + builders_ * (now - started));
    }
    return given_.emplace_back(shared_[next_++]);
  }
  /// For SceneConfig::clock.
  Nanos readClock() { return given_.emplace_back(base::now()); }
  /// All readings of the present builder, in their order: the recording has them.
  const std::vector<Nanos>& given() const noexcept { return given_; }

 private:
  const Nanos builders_;
  std::vector<Nanos> shared_;
  std::size_t next_ = 0;
  std::vector<Nanos> given_;
};

}  // namespace hapticd::server
