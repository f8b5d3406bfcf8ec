#include "net/loop.h"

#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <stdexcept>
#include <system_error>

#include "net/loop_impl.h"
#include "net/network.h"

namespace hapticd::net {

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

RunScope::RunScope(Loop::Impl& loop) : loop_(loop) {
  if (loop_.running) {
    throw std::logic_error("a net::Loop cannot be run from inside one of its own callbacks");
  }
  loop_.running = true;
}

Loop::Loop() {
  if (const auto error = errorOf([this] { impl_ = network().makeLoop(); })) {
    throw Error("cannot start an event loop: " + *error);
  }
}

Loop::~Loop() = default;

void Loop::run() {
  impl_->run();
}

void Loop::runFor(Duration duration) {
  impl_->runFor(duration);
}

std::size_t Loop::runOnce(Duration timeout) {
  return impl_->runOnce(timeout);
}

void Loop::stop() {
  impl_->stop();
}

void Loop::post(std::function<void()> function) {
  impl_->post(std::move(function));
}

Subscription Loop::after(Duration delay, std::function<void()> function) {
  return Subscription(impl_->after(delay, std::move(function)));
}

Subscription Loop::every(Duration period, std::function<void()> function) {
  if (period <= Duration::zero()) {
    throw std::invalid_argument("the period of a timer must be positive");
  }
  return Subscription(impl_->every(period, std::move(function)));
}

Subscription Loop::watchFd(int fd, std::function<void()> function) {
  return Subscription(impl_->watchFd(fd, std::move(function)));
}

void Loop::setErrorHandler(std::function<void(std::string_view)> handler) {
  impl_->onError = std::move(handler);
}

std::uint64_t drainEventFd(int fd) noexcept {
  std::uint64_t value = 0;
  return ::read(fd, &value, sizeof value) == sizeof value ? value : 0;
}

std::string bindErrorText(const char* kind, const Endpoint& local, int error, const std::string& option) {
  const std::string port = std::to_string(local.port);
  std::string why = std::system_category().message(error);
  if (error == EADDRINUSE) {
    why = "port " + port + " is in use by another program: choose another with " + option;
  } else if (error == EADDRNOTAVAIL) {
    why = local.addressText() + " is not an address of this machine: choose one with " + option +
          " (0.0.0.0 for all)";
  } else if (error == EACCES) {
    why = "port " + port + " needs privileges: choose one above 1023 with " + option;
  }
  return std::string("cannot listen on ") + kind + ' ' + local.text() + ": " + why;
}

}  // namespace hapticd::net
