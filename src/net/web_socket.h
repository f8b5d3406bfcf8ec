// A byte stream inside a WebSocket, with everything that a Connection promises.
#pragma once

#include "net/connection_impl.h"
#include "net/loop_impl.h"
#include "net/web_socket_frames.h"

namespace hapticd::net {

// Each buffer leaves as one binary message, so that a low-latency one can still be dropped whole: the queue,
// its limits, the loss of a peer and the pauses are those of the TCP connection underneath.
class WebSocket final : public Connection::Impl, public std::enable_shared_from_this<WebSocket> {
 public:
  /// Takes over a connection on which the greeting is over. `ahead` is what the client sent right behind its
  /// request.
  WebSocket(Loop::Impl& loop, Connection stream, Buffer ahead);

  void start(ConnectionHandlers handlers) override;
  bool sendable() const override { return !closing_ && stream_.isOpen(); }
  void send(std::shared_ptr<const Buffer> buffer, Delivery delivery) override;
  void flush() override { stream_.flush(); }
  void close(std::string reason) override;
  void abort(std::string reason) override { stream_.abort(std::move(reason)); }
  void release() noexcept override;
  void setPaused(bool paused) override;
  void setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive) override {
    stream_.setLossDetection(lossTimeout, keepAlive);
  }

  const Endpoint& local() const override { return stream_.local(); }
  const Endpoint& remote() const override { return stream_.remote(); }
  ConnectionStatistics statistics() override { return stream_.statistics(); }
  int nativeHandle() override { return stream_.nativeHandle(); }

 private:
  void receive(std::span<const std::byte> bytes);
  void sendFrame(Buffer&& frame);
  void end(const WebSocketEnd& end);

  Loop::Impl& loop_;
  Connection stream_;
  Buffer ahead_;
  WebSocketReader reader_;
  // Shared so that a callback that destroys its connection goes on running on living captures.
  std::shared_ptr<ConnectionHandlers> handlers_;
  bool closing_ = false;
};

}  // namespace hapticd::net
