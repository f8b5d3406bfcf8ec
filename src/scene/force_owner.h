// Tells the servo at once that the owner of a force is gone, however busy the scene thread is.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

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
  /// When it left; empty while it is here.
  std::optional<base::Nanos> leftAt() const noexcept {
    const base::Nanos left = leftAt_.load(std::memory_order_acquire);
    return left == kHere ? std::nullopt : std::optional(left);
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
  /// Learns of a client before any servo can see that it left; no time: its commands exert force again.
  /// Called under a lock: it must not call back.
  using Listener = std::function<void(ClientId, std::optional<base::Nanos> left)>;

  std::shared_ptr<const ForceOwner> of(ClientId client) {
    const std::lock_guard lock(mutex_);
    return entryOf(client).owner;
  }
  /// Calls `listener` for the clients that left and still own forces, and for each that leaves or comes back
  /// from now on. Null: nobody.
  void watch(Listener listener) {
    const std::lock_guard lock(mutex_);
    listener_ = std::move(listener);
    if (!listener_) return;
    for (const auto& [client, entry] : owners_) {
      if (const auto left = entry.owner->leftAt()) listener_(client, left);
    }
  }
  /// The client's forces must end, also those of commands that are applied until comeBack().
  void leave(ClientId client, base::Nanos now) {
    const std::lock_guard lock(mutex_);
    ++entryOf(client).leaves;
    endForces(client, now);
  }
  /// The same for a client that is gone: no command of it exerts force any more.
  void leaveForGood(ClientId client, base::Nanos now) {
    const std::lock_guard lock(mutex_);
    entryOf(client).gone = true;
    endForces(client, now);
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
    if (listener_) listener_(client, std::nullopt);
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
  void endForces(ClientId client, base::Nanos now) {
    if (listener_) listener_(client, now);
    entryOf(client).owner->leave(now);
  }

  std::mutex mutex_;
  Listener listener_;
  std::map<ClientId, Entry> owners_;
};

}  // namespace hapticd::scene
