// A WebSocket with the contract of Connection: a byte stream, or texts.
#pragma once

#include "net/connection_impl.h"
#include "net/loop_impl.h"
#include "net/web_socket_frames.h"

namespace hapticd::net {

// Each buffer is sent as one message, so that a low-latency one can still be dropped as a whole; each text
// arrives in an onBytes of its own. The queue, its limits, loss detection and pauses are those of the TCP
// connection underneath.
class WebSocket final : public Connection::Impl, public std::enable_shared_from_this<WebSocket> {
 public:
  /// Takes over a connection after the handshake. `ahead` holds the bytes that the client sent directly after
  /// its request.
  WebSocket(Loop::Impl& loop, Connection stream, Buffer ahead, WebSocketContent content);

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
  std::size_t queuedBytes() override { return stream_.queuedBytes(); }
  int nativeHandle() override { return stream_.nativeHandle(); }

 private:
  void receive(std::span<const std::byte> bytes);
  void sendFrame(Buffer&& frame);
  void end(const WebSocketEnd& end);

  Loop::Impl& loop_;
  Connection stream_;
  Buffer ahead_;
  const WebSocketContent content_;
  WebSocketReader reader_;
  // Shared, so that the captures of a callback outlive a connection that it destroys.
  std::shared_ptr<ConnectionHandlers> handlers_;
  bool closing_ = false;
};

}  // namespace hapticd::net
