// The interface behind Connection: implemented by TCP, by a WebSocket on top of it, and by simulated
// networks.
#pragma once

#include "net/connection.h"

namespace hapticd::net {

/// Connection documents each call. Lives on the heap: pending operations may outlive the owner.
class Connection::Impl {
 public:
  virtual ~Impl() = default;

  virtual void start(ConnectionHandlers handlers) = 0;
  virtual bool sendable() const = 0;
  virtual void send(std::shared_ptr<const Buffer> buffer, Delivery delivery) = 0;
  virtual void flush() = 0;
  virtual void close(std::string reason) = 0;
  virtual void abort(std::string reason) = 0;
  /// The owner is gone: no callback after this.
  virtual void release() noexcept = 0;
  virtual void setPaused(bool paused) = 0;
  virtual void setLossDetection(std::chrono::milliseconds lossTimeout, std::chrono::seconds keepAlive) = 0;

  virtual const Endpoint& local() const = 0;
  virtual const Endpoint& remote() const = 0;
  virtual ConnectionStatistics statistics() = 0;
  virtual std::size_t queuedBytes() { return statistics().queuedBytes; }
  virtual int nativeHandle() = 0;
  virtual std::optional<std::uint32_t> peerUser() noexcept { return std::nullopt; }
};

}  // namespace hapticd::net
