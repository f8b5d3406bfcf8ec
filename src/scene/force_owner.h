// Tells the servo at once that the owner of a force is gone, however busy the scene thread is.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <mutex>

#include "base/time.h"
#include "scene/notice.h"

namespace hapticd::scene {

/// A client as its forces know it. Any thread, lock-free.
class ForceOwner {
 public:
  /// The client's forces must end; the first call counts. Servo clock.
  void leave(base::Nanos now) noexcept {
    base::Nanos here = kHere;
    leftAt_.compare_exchange_strong(here, now, std::memory_order_acq_rel);
  }
  /// The share of its forces that is left: 1 while it is here and for kGrace, in which the scene thread
  /// usually releases them itself, then down to 0 within kRampOut. `releasedAt` is when the scene thread
  /// began to release the force, negative when it has not: a release in time needs no help.
  double share(base::Nanos releasedAt, base::Nanos now) const noexcept {
    const base::Nanos left = leftAt_.load(std::memory_order_acquire);
    if (left == kHere || (releasedAt >= 0 && releasedAt <= left + kGrace)) return 1;
    return std::clamp(1 - base::toSeconds(now - left - kGrace) / base::toSeconds(kRampOut), 0.0, 1.0);
  }

  static constexpr base::Nanos kGrace = 50'000'000;
  static constexpr base::Nanos kRampOut = 200'000'000;

 private:
  static constexpr base::Nanos kHere = std::numeric_limits<base::Nanos>::max();
  std::atomic<base::Nanos> leftAt_{kHere};
};

/// The owners of one scene, by client. Any thread but a servo's.
class ForceOwners {
 public:
  std::shared_ptr<const ForceOwner> of(ClientId client) {
    const std::lock_guard lock(mutex_);
    return entryOf(client).owner;
  }
  /// The client's forces must end, also those of commands that are applied until comeBack().
  void leave(ClientId client, base::Nanos now) {
    const std::lock_guard lock(mutex_);
    Entry& entry = entryOf(client);
    ++entry.leaves;
    entry.owner->leave(now);
  }
  /// The same for a client that is gone: no command of it exerts force any more.
  void leaveForGood(ClientId client, base::Nanos now) {
    const std::lock_guard lock(mutex_);
    Entry& entry = entryOf(client);
    entry.gone = true;
    entry.owner->leave(now);
  }
  /// How often leave() was called for the client.
  std::uint64_t leaves(ClientId client) {
    const std::lock_guard lock(mutex_);
    return entryOf(client).leaves;
  }
  /// Commands of the client that are applied from here on exert force again, unless it is gone or leave() was
  /// called more than `leaves` times.
  void comeBack(ClientId client, std::uint64_t leaves) {
    const std::lock_guard lock(mutex_);
    const auto known = owners_.find(client);
    if (known == owners_.end() || known->second.gone || known->second.leaves != leaves) return;
    known->second.owner = std::make_shared<ForceOwner>();
  }
  /// The last command of the client was applied.
  void forget(ClientId client) {
    const std::lock_guard lock(mutex_);
    owners_.erase(client);
  }

 private:
  struct Entry {
    std::shared_ptr<ForceOwner> owner = std::make_shared<ForceOwner>();
    std::uint64_t leaves = 0;
    bool gone = false;
  };

  Entry& entryOf(ClientId client) { return owners_[client]; }

  std::mutex mutex_;
  std::map<ClientId, Entry> owners_;
};

}  // namespace hapticd::scene
