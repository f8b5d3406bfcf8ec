#include "net/loop.h"

#include <fcntl.h>
#include <unistd.h>

#include "net/loop_impl.h"
//
#include <boost/asio/error.hpp>
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>
#include <cstdio>
#include <stdexcept>

namespace hapticd::net {

namespace asio = boost::asio;
using boost::system::error_code;

class Subscription::State : public std::enable_shared_from_this<State> {
 public:
  State(Loop::Impl& loop, std::function<void()> function) : loop_(loop), function_(std::move(function)) {}
  virtual ~State() = default;

  virtual void cancel() noexcept { active_ = false; }
  bool active() const noexcept { return active_; }

 protected:
  void call() { loop_.guard(function_); }

  Loop::Impl& loop_;
  bool active_ = true;

 private:
  std::function<void()> function_;
};

namespace {

class TimerState final : public Subscription::State {
 public:
  TimerState(Loop::Impl& loop, std::function<void()> function, Loop::Duration period)
      : State(loop, std::move(function)), timer_(loop.context), period_(period) {}

  void startAt(std::chrono::steady_clock::time_point when) {
    timer_.expires_at(when);
    timer_.async_wait([this, self = shared_from_this()](const error_code&) { expired(); });
  }

  void cancel() noexcept override {
    State::cancel();
    loop_.guard([this] { timer_.cancel(); });
  }

 private:
  void expired() {
    if (!active_) {
      return;
    }
    if (period_ > Loop::Duration::zero()) {
      const auto now = std::chrono::steady_clock::now();
      const auto next = timer_.expiry() + period_;
      startAt(next > now ? next : now + period_);
    } else {
      active_ = false;
    }
    call();
  }

  asio::steady_timer timer_;
  Loop::Duration period_;
};

class WatchState final : public Subscription::State {
 public:
  // A duplicate is watched, so that the caller may close its own descriptor at any time.
  WatchState(Loop::Impl& loop, std::function<void()> function, int fd)
      : State(loop, std::move(function)), descriptor_(loop.context) {
    const int duplicate = ::fcntl(fd, F_DUPFD_CLOEXEC, 0);
    error_code error(duplicate < 0 ? errno : 0, boost::system::system_category());
    if (!error) {
      descriptor_.assign(duplicate, error);
    }
    if (error) {
      ::close(duplicate);
      throw Error("cannot watch file descriptor " + std::to_string(fd) + ": " + error.message());
    }
  }

  // Waiting again re-examines the descriptor, which is what makes an edge-triggered reactor level-triggered.
  void arm() {
    descriptor_.async_wait(asio::posix::descriptor_base::wait_read,
                           [this, self = shared_from_this()](const error_code& error) { ready(error); });
  }

  void cancel() noexcept override {
    State::cancel();
    error_code ignored;
    descriptor_.close(ignored);
  }

 private:
  void ready(const error_code& error) {
    if (active_ && error) {
      cancel();
      loop_.report("cannot watch a file descriptor: " + error.message());
    }
    if (active_) {
      call();
    }
    if (active_) {
      arm();
    }
  }

  asio::posix::stream_descriptor descriptor_;
};

/// Marks the loop as running for as long as it lives; the read buffer is shared, so runs must not nest.
class RunScope {
 public:
  explicit RunScope(Loop::Impl& loop) : loop_(loop) {
    if (loop_.running) {
      throw std::logic_error("a net::Loop cannot be run from inside one of its own callbacks");
    }
    loop_.running = true;
  }
  ~RunScope() {
    loop_.running = false;
    if (loop_.context.stopped()) {
      loop_.context.restart();
    }
  }
  RunScope(const RunScope&) = delete;
  RunScope& operator=(const RunScope&) = delete;

 private:
  Loop::Impl& loop_;
};

}  // namespace

Subscription::Subscription(std::shared_ptr<State> state) noexcept : state_(std::move(state)) {}

Subscription& Subscription::operator=(Subscription&& other) noexcept {
  if (this != &other) {
    cancel();
    state_ = std::move(other.state_);
  }
  return *this;
}

Subscription::~Subscription() {
  cancel();
}

void Subscription::cancel() noexcept {
  if (const auto state = std::move(state_)) {
    state->cancel();
  }
}

bool Subscription::active() const noexcept {
  return state_ && state_->active();
}

void Loop::Impl::report(std::string_view text) noexcept {
  try {
    if (onError) {
      onError(text);
      return;
    }
  } catch (...) {
    // The text below is then all that can be done.
  }
  std::fprintf(stderr, "net: %.*s\n", static_cast<int>(text.size()), text.data());
}

Loop::Loop() {
  if (const auto error = errorOf([this] { impl_ = std::make_unique<Impl>(); })) {
    throw Error("cannot start an event loop: " + *error);
  }
}

Loop::~Loop() = default;

void Loop::run() {
  const RunScope scope(*impl_);
  while (!impl_->context.stopped()) {
    impl_->guard([this] { impl_->context.run(); });
  }
}

void Loop::runFor(Duration duration) {
  const RunScope scope(*impl_);
  const auto end = std::chrono::steady_clock::now() + duration;
  do {
    impl_->guard([&] { impl_->context.run_until(end); });
  } while (!impl_->context.stopped() && std::chrono::steady_clock::now() < end);
}

std::size_t Loop::runOnce(Duration timeout) {
  // A peer that sends without pause would keep the loop ready for ever.
  constexpr std::size_t kMostEvents = 1024;
  const RunScope scope(*impl_);
  std::size_t count = 0;
  impl_->guard([&] {
    count = timeout > Duration::zero() ? impl_->context.run_one_for(timeout) : impl_->context.poll_one();
    while (count > 0 && count < kMostEvents && impl_->context.poll_one() > 0) {
      ++count;
    }
  });
  return count;
}

void Loop::stop() {
  impl_->context.stop();
}

void Loop::post(std::function<void()> function) {
  asio::post(impl_->context, [loop = impl_.get(), f = std::move(function)] { loop->guard(f); });
}

Subscription Loop::after(Duration delay, std::function<void()> function) {
  auto state = std::make_shared<TimerState>(*impl_, std::move(function), Duration::zero());
  state->startAt(std::chrono::steady_clock::now() + delay);
  return Subscription(std::move(state));
}

Subscription Loop::every(Duration period, std::function<void()> function) {
  if (period <= Duration::zero()) {
    throw std::invalid_argument("the period of a timer must be positive");
  }
  auto state = std::make_shared<TimerState>(*impl_, std::move(function), period);
  state->startAt(std::chrono::steady_clock::now() + period);
  return Subscription(std::move(state));
}

Subscription Loop::watchFd(int fd, std::function<void()> function) {
  auto state = std::make_shared<WatchState>(*impl_, std::move(function), fd);
  state->arm();
  return Subscription(std::move(state));
}

void Loop::setErrorHandler(std::function<void(std::string_view)> handler) {
  impl_->onError = std::move(handler);
}

std::uint64_t drainEventFd(int fd) noexcept {
  std::uint64_t value = 0;
  return ::read(fd, &value, sizeof value) == sizeof value ? value : 0;
}

std::string bindErrorText(const char* kind, const Endpoint& local, const error_code& error,
                          const std::string& option) {
  const std::string port = std::to_string(local.port);
  std::string why = error.message();
  if (error == asio::error::address_in_use) {
    why = "port " + port + " is in use by another program: choose another with " + option;
  } else if (error == boost::system::errc::address_not_available) {
    why = local.addressText() + " is not an address of this machine: choose one with " + option +
          " (0.0.0.0 for all)";
  } else if (error == asio::error::access_denied) {
    why = "port " + port + " needs privileges: choose one above 1023 with " + option;
  }
  return std::string("cannot listen on ") + kind + ' ' + local.text() + ": " + why;
}

}  // namespace hapticd::net
