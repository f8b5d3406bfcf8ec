// Ending callbacks.
#pragma once

#include <memory>
#include <utility>

#include "hapticd/export.h"

namespace hapticd {

namespace detail {
class CallbackEntry;
}

/// Refers to one callback of a Client. Discarding it leaves the callback in place for the life of the client:
/// destruction ends nothing. Use ScopedSubscription where the callback must not outlive something. Copies
/// refer to the same callback. To be used in the thread of the client.
class HAPTICD_EXPORT Subscription {
 public:
  /// Refers to no callback.
  Subscription() noexcept = default;
  explicit Subscription(std::weak_ptr<detail::CallbackEntry> entry) noexcept : entry_(std::move(entry)) {}

  /// The callback is not called again, and its function object is destroyed: now, or at its return when it is
  /// running. Does nothing when it has ended before or the client is gone.
  void end() noexcept;
  /// Whether the callback can still be called.
  bool active() const noexcept;

 private:
  std::weak_ptr<detail::CallbackEntry> entry_;
};

/// Ends the callback when it is destroyed:
///   hapticd::ScopedSubscription force = client.onForce([this](const hapticd::ForceReport& r) { show(r); });
class HAPTICD_EXPORT ScopedSubscription {
 public:
  ScopedSubscription() noexcept = default;
  ScopedSubscription(
      Subscription subscription) noexcept  // NOLINT(google-explicit-constructor): see the example
      : subscription_(std::move(subscription)) {}
  ~ScopedSubscription() { subscription_.end(); }
  ScopedSubscription(const ScopedSubscription&) = delete;
  ScopedSubscription& operator=(const ScopedSubscription&) = delete;
  ScopedSubscription(ScopedSubscription&& other) noexcept : subscription_(other.release()) {}
  ScopedSubscription& operator=(ScopedSubscription&& other) noexcept {
    if (this != &other) {
      subscription_.end();
      subscription_ = other.release();
    }
    return *this;
  }

  /// Ends the callback now.
  void end() noexcept { subscription_.end(); }
  bool active() const noexcept { return subscription_.active(); }
  /// Gives the callback up without ending it.
  Subscription release() noexcept { return std::exchange(subscription_, Subscription()); }

 private:
  Subscription subscription_;
};

}  // namespace hapticd
