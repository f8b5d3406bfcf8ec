// The state machine of a TCP connection, outgoing or accepted.
#pragma once

#include "net/asio_loop.h"
//
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/steady_timer.hpp>

#include "net/connection_impl.h"
#include "net/loss_watch.h"
#include "net/unix_socket.h"

namespace hapticd::net {

// connecting -> open -> flushing (close() was called) -> draining (our end is shut) -> closed.
// Any state may go to closed directly. Pending operations keep the object alive after its owner is gone.
class TcpConnection final : public Connection::Impl,
                            public LossChecked,
                            public std::enable_shared_from_this<TcpConnection> {
 public:
  using Socket = boost::asio::ip::tcp::socket;
  using ErrorCode = boost::system::error_code;

  TcpConnection(AsioLoop& loop, const ConnectionOptions& options);

  void connect(const Endpoint& peer, std::chrono::milliseconds timeout);
  /// Takes over an accepted socket of this peer; its reading waits for start().
  void adopt(Socket socket, const Endpoint& remote);
  /// The same for a Unix-domain stream socket, which behaves as one of TCP without addresses.
  void adoptLocal(Socket socket);
  void adoptLocal(int fd);

  void start(ConnectionHandlers handlers) override;
  bool sendable() const override {
    return (state_ == State::connecting || state_ == State::open) && failure_.empty();
  }
  void send(std::shared_ptr<const Buffer> buffer, Delivery delivery) override;
  void flush() override;
  void close(std::string reason) override;
  void abort(std::string reason) override;
  void release() noexcept override;
  void setPaused(bool paused) override;
  void setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive) override;
  std::optional<std::chrono::milliseconds> checkLoss(std::uint32_t series) override;

  const Endpoint& local() const override { return local_; }
  const Endpoint& remote() const override { return remote_; }
  ConnectionStatistics statistics() override;
  std::size_t queuedBytes() override { return queue_.bytes(); }
  int nativeHandle() override { return socket_.is_open() ? socket_.native_handle() : -1; }
  std::optional<std::uint32_t> peerUser() noexcept override { return userBehind(nativeHandle()); }

 private:
  enum class State { connecting, open, flushing, draining, closed };

  void becomeOpen();
  void applyOptions();
  void armRead();
  void readable();
  void setBusy(bool busy) noexcept;
  void deliver(std::size_t bytes);
  void peerEnded();
  void armWrite();
  void write();
  void writeFailed(const ErrorCode& error);
  void queueEmptied(bool wasBlocked);
  void armWatch();
  void armPeerCheck();
  void reportPeerGone(std::string reason);
  void armTimer(std::chrono::milliseconds timeout, std::string reason);
  void finish(std::string reason);
  void notifyClosed();
  template <class Callback, class... Arguments>
  void call(Callback ConnectionHandlers::*callback, const Arguments&... arguments);

  AsioLoop& loop_;
  ConnectionOptions options_;
  Socket socket_;
  boost::asio::steady_timer timer_;  // of connect(), then of close()
  boost::asio::steady_timer peerCheckTimer_;
  LossWatch watch_{options_.lossTimeout};
  std::uint32_t watchSeries_ = 0;
  // Shared, so that the captures of a callback outlive a connection that it destroys.
  std::shared_ptr<ConnectionHandlers> handlers_;
  SendQueue queue_;
  Endpoint local_;
  Endpoint remote_;
  State state_ = State::connecting;
  bool readArmed_ = false;
  bool busy_ = false;  // counted in AsioLoop::busyReaders
  bool writeArmed_ = false;
  bool paused_ = false;
  bool peerEnded_ = false;
  bool peerCheckArmed_ = false;
  bool peerGoneReported_ = false;
  bool receiveBufferWide_ = false;
  std::string failure_;  // why nothing can be sent, while received bytes are still being read
  std::string reason_;   // of close(), then of the end
  std::uint64_t bytesIn_ = 0;
  std::uint64_t bytesOut_ = 0;
};

}  // namespace hapticd::net
