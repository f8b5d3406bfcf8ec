// What an event loop does behind Loop, and the sockets that live in it: AsioLoop in production, a simulated
// one in tests.
#pragma once

#include <exception>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "net/connection_impl.h"
#include "net/endpoint.h"
#include "net/loop.h"
#include "net/tcp_listener.h"
#include "net/udp_socket.h"

namespace hapticd::net {

/// Runs the function; the text of the exception that left it, if one did.
template <class Function>
std::optional<std::string> errorOf(Function&& function) {
  try {
    function();
    return std::nullopt;
  } catch (const std::exception& error) {
    return error.what();
  } catch (...) {
    return "an exception of unknown type";
  }
}

/// See Loop for what each call means.
class Loop::Impl {
 public:
  virtual ~Impl() = default;

  virtual void run() = 0;
  virtual void runFor(Duration duration) = 0;
  virtual std::size_t runOnce(Duration timeout) = 0;
  virtual void stop() = 0;
  virtual void post(std::function<void()> function) = 0;
  virtual std::shared_ptr<Subscription::State> after(Duration delay, std::function<void()> function) = 0;
  /// The period is positive.
  virtual std::shared_ptr<Subscription::State> every(Duration period, std::function<void()> function) = 0;
  virtual std::shared_ptr<Subscription::State> watchFd(int fd, std::function<void()> function) = 0;

  virtual std::shared_ptr<Connection::Impl> connect(const Endpoint& peer, std::chrono::milliseconds timeout,
                                                    const ConnectionOptions& options) = 0;
  virtual std::shared_ptr<TcpListener::Impl> listen(const Endpoint& local,
                                                    std::function<void(Connection)> onAccept,
                                                    const ConnectionOptions& options, const char* option) = 0;
  virtual std::shared_ptr<UdpSocket::Impl> bind(const Endpoint& local) = 0;
  /// See LocalListener and connectLocal().
  virtual std::shared_ptr<TcpListener::Impl> listenLocal(const std::filesystem::path& path,
                                                         std::function<void(Connection)> onAccept,
                                                         const ConnectionOptions& options) = 0;
  virtual std::shared_ptr<Connection::Impl> connectLocal(const std::filesystem::path& path,
                                                         const ConnectionOptions& options) = 0;

  /// Hands a text to the error handler.
  void report(std::string_view text) noexcept;
  /// Runs a callback that belongs to no connection.
  template <class Function>
  void guard(Function&& function) {
    if (const auto error = errorOf(std::forward<Function>(function))) {
      report(*error);
    }
  }

  std::function<void(std::string_view)> onError;
  bool running = false;
};

/// Marks the loop as running for as long as it lives; throws std::logic_error when it is running already.
class RunScope {
 public:
  explicit RunScope(Loop::Impl& loop);
  ~RunScope() { loop_.running = false; }
  RunScope(const RunScope&) = delete;
  RunScope& operator=(const RunScope&) = delete;

 private:
  Loop::Impl& loop_;
};

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

/// What every kind of listener does behind TcpListener.
class TcpListener::Impl {
 public:
  virtual ~Impl() = default;
  /// No callback after this.
  virtual void close() noexcept = 0;
  virtual const Endpoint& local() const = 0;
};

/// What every kind of datagram socket does behind UdpSocket.
class UdpSocket::Impl {
 public:
  virtual ~Impl() = default;
  virtual void start(UdpHandlers handlers) = 0;
  virtual void connect(const Endpoint& peer) = 0;
  virtual bool send(std::span<const std::byte> bytes) = 0;
  virtual bool sendTo(std::span<const std::byte> bytes, const Endpoint& to) = 0;
  virtual std::size_t sendBatch(std::span<const Datagram> datagrams) = 0;
  /// No callback after this.
  virtual void close() noexcept = 0;
  virtual const Endpoint& local() const = 0;
  virtual const UdpStatistics& statistics() const = 0;
};

/// Why a socket of the given kind ("TCP", "UDP") could not be bound (an errno), with the remedy: another
/// choice for `option`.
std::string bindErrorText(const char* kind, const Endpoint& local, int error,
                          const std::string& option = "--listen");

}  // namespace hapticd::net
