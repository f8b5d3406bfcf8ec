#include "net/asio_loop.h"

#include <fcntl.h>
#include <unistd.h>

#include "net/asio_listener.h"
#include "net/asio_udp_socket.h"
#include "net/tcp_connection.h"
#include "net/unix_socket.h"
//
#include <boost/asio/posix/stream_descriptor.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>
#include <cerrno>

#include "base/world.h"

namespace hapticd::net {

namespace asio = boost::asio;
using boost::system::error_code;

namespace {

class TimerState final : public Subscription::State {
 public:
  TimerState(AsioLoop& loop, std::function<void()> function, Loop::Duration period)
      : State(loop, std::move(function)), timer_(loop.context), period_(period) {}

  void startAfter(Loop::Duration delay) {
    timer_.expires_after(delay);
    wait();
  }

  void cancel() noexcept override {
    State::cancel();
    loop_.guard([this] { timer_.cancel(); });
  }

 private:
  void wait() {
    timer_.async_wait([this, self = shared_from_this()](const error_code&) { expired(); });
  }

  void expired() {
    if (!active_) {
      return;
    }
    if (period_ > Loop::Duration::zero()) {
      const auto next = timer_.expiry() + period_;
      if (next > asio::steady_timer::time_point(std::chrono::nanoseconds(base::now()))) {
        timer_.expires_at(next);
        wait();
      } else {
        startAfter(period_);
      }
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
  WatchState(AsioLoop& loop, std::function<void()> function, int fd)
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

/// A stopped context must be restarted before it runs again.
class ContextRun {
 public:
  explicit ContextRun(AsioLoop& loop) : scope_(loop), loop_(loop) {}
  ~ContextRun() {
    if (loop_.context.stopped()) {
      loop_.context.restart();
    }
  }
  ContextRun(const ContextRun&) = delete;
  ContextRun& operator=(const ContextRun&) = delete;

 private:
  RunScope scope_;
  AsioLoop& loop_;
};

}  // namespace

void AsioLoop::run() {
  const ContextRun scope(*this);
  while (!context.stopped()) {
    guard([this] { context.run(); });
  }
}

void AsioLoop::runFor(Loop::Duration duration) {
  const ContextRun scope(*this);
  const base::Nanos end = base::now() + duration.count();
  do {
    guard([&] { context.run_for(std::chrono::nanoseconds(end - base::now())); });
  } while (!context.stopped() && base::now() < end);
}

std::size_t AsioLoop::runOnce(Loop::Duration timeout) {
  // A peer that sends without pause would keep the loop ready for ever.
  constexpr std::size_t kMostEvents = 1024;
  const ContextRun scope(*this);
  std::size_t count = 0;
  guard([&] {
    count = timeout > Loop::Duration::zero() ? context.run_one_for(timeout) : context.poll_one();
    while (count > 0 && count < kMostEvents && context.poll_one() > 0) {
      ++count;
    }
  });
  return count;
}

void AsioLoop::stop() {
  context.stop();
}

void AsioLoop::post(std::function<void()> function) {
  const std::lock_guard lock(mutex_);
  posted_.push_back(std::move(function));
  if (!std::exchange(posting_, true)) asio::post(context, [this] { callPosted(); });
}

// Asio calls all that was posted before it looks at the sockets again.
void AsioLoop::callPosted() {
  constexpr base::Nanos kSlice = 200'000;
  const base::Nanos end = base::now() + kSlice;
  for (;;) {
    std::function<void()> function;
    {
      const std::lock_guard lock(mutex_);
      if (posted_.empty()) {
        posting_ = false;
        return;
      }
      if (base::now() >= end || context.stopped()) {
        asio::post(context, [this] { callPosted(); });
        return;
      }
      function = std::move(posted_.front());
      posted_.pop_front();
    }
    guard(function);
  }
}

std::shared_ptr<Subscription::State> AsioLoop::after(Loop::Duration delay, std::function<void()> function) {
  auto state = std::make_shared<TimerState>(*this, std::move(function), Loop::Duration::zero());
  state->startAfter(delay);
  return state;
}

std::shared_ptr<Subscription::State> AsioLoop::every(Loop::Duration period, std::function<void()> function) {
  auto state = std::make_shared<TimerState>(*this, std::move(function), period);
  state->startAfter(period);
  return state;
}

std::shared_ptr<Subscription::State> AsioLoop::watchFd(int fd, std::function<void()> function) {
  auto state = std::make_shared<WatchState>(*this, std::move(function), fd);
  state->arm();
  return state;
}

std::shared_ptr<Connection::Impl> AsioLoop::connect(const Endpoint& peer, std::chrono::milliseconds timeout,
                                                    const ConnectionOptions& options) {
  auto connection = std::make_shared<TcpConnection>(*this, options);
  connection->connect(peer, timeout);
  return connection;
}

std::shared_ptr<TcpListener::Impl> AsioLoop::listen(const Endpoint& local,
                                                    std::function<void(Connection)> onAccept,
                                                    const ConnectionOptions& options, const char* option) {
  return listenWithAsio(*this, local, std::move(onAccept), options, option);
}

std::shared_ptr<TcpListener::Impl> AsioLoop::listenLocal(const std::filesystem::path& path,
                                                         std::function<void(Connection)> onAccept,
                                                         const ConnectionOptions& options) {
  return listenLocallyWithAsio(*this, path, std::move(onAccept), options);
}

std::shared_ptr<Connection::Impl> AsioLoop::connectLocal(const std::filesystem::path& path,
                                                         const ConnectionOptions& options) {
  const int fd = connectTo(path);
  auto connection = std::make_shared<TcpConnection>(*this, options);
  connection->adoptLocal(fd);
  return connection;
}

std::shared_ptr<UdpSocket::Impl> AsioLoop::bind(const Endpoint& local) {
  return bindWithAsio(*this, local);
}

}  // namespace hapticd::net
