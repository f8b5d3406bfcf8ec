// The event loop under every socket of this room.
//
// One thread drives a Loop and everything made with it: sockets and timers have no locks of their own, and
// their callbacks run only from inside run(), runFor() or runOnce(). Only post() and stop() may be called
// from other threads. A Loop outlives everything made with it. An exception that leaves a callback ends the
// connection it belongs to, or goes to the error handler; it never leaves the loop.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string_view>

namespace hapticd::net {

/// Owns a timer or watch; destroying the handle, even in its own callback, cancels it.
class Subscription {
 public:
  class State;

  Subscription() noexcept = default;
  explicit Subscription(std::shared_ptr<State> state) noexcept;
  Subscription(Subscription&& other) noexcept = default;
  Subscription& operator=(Subscription&& other) noexcept;
  ~Subscription();

  /// No callback after this returns; harmless when nothing is active.
  void cancel() noexcept;
  /// Whether a callback may still come.
  bool active() const noexcept;

 private:
  std::shared_ptr<State> state_;
};

class Loop {
 public:
  using Duration = std::chrono::nanoseconds;

  /// A loop of network(). Throws Error when the system has no file descriptor left.
  Loop();
  ~Loop();
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;

  /// Handles events in the calling thread until stop(); returns at once after an earlier stop().
  void run();
  /// Handles events for the whole duration (or until stop()), sleeping in between.
  void runFor(Duration duration);
  /// Waits up to the timeout for a first event, handles it and those ready by then (a bounded number), and
  /// returns their number. A zero timeout polls.
  std::size_t runOnce(Duration timeout);
  /// Makes the current or next run return. From any thread.
  void stop();

  /// Runs the function in the loop's thread, in the order of the calls. From any thread.
  void post(std::function<void()> function);

  /// Calls the function once after the delay.
  [[nodiscard]] Subscription after(Duration delay, std::function<void()> function);
  /// Calls the function each period without drift; periods missed by a late loop are skipped.
  [[nodiscard]] Subscription every(Duration period, std::function<void()> function);
  /// Calls the function repeatedly while the descriptor is readable; the function reads what is there (see
  /// drainEventFd). The caller keeps the descriptor; nothing is allocated per wake. Throws
  /// Error for descriptors that cannot be polled.
  [[nodiscard]] Subscription watchFd(int fd, std::function<void()> function);

  /// Receives the text of exceptions that belong to no connection, in the loop's thread; until it is set,
  /// they go to standard error.
  void setErrorHandler(std::function<void(std::string_view)> handler);

  /// What a Network implements; for this room only.
  class Impl;
  Impl& impl() noexcept { return *impl_; }

 private:
  std::unique_ptr<Impl> impl_;
};

/// Reads an eventfd made with EFD_NONBLOCK back to zero and returns its value (0: nothing was posted).
std::uint64_t drainEventFd(int fd) noexcept;

}  // namespace hapticd::net
