// The event loop on Boost.Asio and the sockets of the operating system. Asio is visible to src/net alone.
#pragma once

#include <utility>  // before Asio: Boost 1.74 uses std::exchange without including it
//
#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/address_v4.hpp>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>

#include "net/loop_impl.h"
#include "net/loss_checks.h"

namespace hapticd::net {

class AsioLoop final : public Loop::Impl {
 public:
  static constexpr std::size_t kReadBufferBytes = std::size_t{64} * 1024;
  static constexpr std::size_t kSmallestRead = std::size_t{4} * 1024;

  void run() override;
  void runFor(Loop::Duration duration) override;
  std::size_t runOnce(Loop::Duration timeout) override;
  void stop() override;
  void post(std::function<void()> function) override;
  std::shared_ptr<Subscription::State> after(Loop::Duration delay, std::function<void()> function) override;
  std::shared_ptr<Subscription::State> every(Loop::Duration period, std::function<void()> function) override;
  std::shared_ptr<Subscription::State> watchFd(int fd, std::function<void()> function) override;
  std::shared_ptr<Connection::Impl> connect(const Endpoint& peer, std::chrono::milliseconds timeout,
                                            const ConnectionOptions& options) override;
  std::shared_ptr<TcpListener::Impl> listen(const Endpoint& local, std::function<void(Connection)> onAccept,
                                            const ConnectionOptions& options, const char* option) override;
  std::shared_ptr<UdpSocket::Impl> bind(const Endpoint& local) override;
  std::shared_ptr<TcpListener::Impl> listenLocal(const std::filesystem::path& path,
                                                 std::function<void(Connection)> onAccept,
                                                 const ConnectionOptions& options) override;
  std::shared_ptr<Connection::Impl> connectLocal(const std::filesystem::path& path,
                                                 const ConnectionOptions& options) override;

  /// How much one connection may read in its turn: the connections that send faster than they are read share
  /// the buffer, so that a short message waits for about one buffer, however many of them there are.
  std::size_t readShare() const noexcept {
    return std::max(kSmallestRead, kReadBufferBytes / std::max<std::size_t>(1, busyReaders));
  }
  std::size_t busyReaders = 0;  // connections whose last read left something behind
  // One buffer for all sockets: each read is consumed before the next, so memory does not grow with clients.
  std::unique_ptr<std::byte[]> readBuffer = std::make_unique_for_overwrite<std::byte[]>(kReadBufferBytes);
  boost::asio::io_context context{1};  // one thread runs it; posting from others stays safe
  boost::asio::executor_work_guard<boost::asio::io_context::executor_type> work{context.get_executor()};
  LossChecks lossChecks{context};

 private:
  void callPosted();

  std::mutex mutex_;  // of the rest
  std::deque<std::function<void()>> posted_;
  bool posting_ = false;  // callPosted() is due
};

template <class AsioEndpoint>
AsioEndpoint toAsio(const Endpoint& endpoint) {
  return AsioEndpoint(boost::asio::ip::address_v4(endpoint.address), endpoint.port);
}

template <class AsioEndpoint>
Endpoint fromAsio(const AsioEndpoint& endpoint) {
  return {endpoint.address().is_v4() ? endpoint.address().to_v4().to_uint() : 0, endpoint.port()};
}

}  // namespace hapticd::net
