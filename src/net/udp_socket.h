// Datagrams: received by callback, sent immediately or dropped.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>

#include "net/endpoint.h"
#include "net/loop.h"

namespace hapticd::net {

/// Callbacks of a socket; any may be empty.
struct UdpHandlers {
  /// A datagram was received (valid during the call only).
  std::function<void(std::span<const std::byte>, const Endpoint& from)> onDatagram;
  /// The connected peer's machine answered that no socket is bound there; this socket stays usable.
  std::function<void()> onRefused;
};

/// Counts since the socket was made.
struct UdpStatistics {
  std::uint64_t datagramsIn = 0;
  std::uint64_t bytesIn = 0;
  std::uint64_t datagramsOut = 0;
  std::uint64_t bytesOut = 0;
  std::uint64_t dropped = 0;  ///< not sent: the system's buffer was full, or it refused the datagram
  std::uint64_t refused = 0;  ///< answers that no socket is bound at the connected peer
};

/// A datagram to send with sendBatch().
struct Datagram {
  std::span<const std::byte> bytes;
  Endpoint to;
};

/// A non-blocking UDP socket; destroying it closes it, also in its own callback.
class UdpSocket {
 public:
  class Impl;

  /// Port 0 lets the system choose one, see local(). Throws Error, which names the address, why, and a
  /// remedy.
  UdpSocket(Loop& loop, const Endpoint& local);
  ~UdpSocket();
  UdpSocket(const UdpSocket&) = delete;
  UdpSocket& operator=(const UdpSocket&) = delete;

  /// Sets the callbacks and starts receiving.
  void start(UdpHandlers handlers);
  /// Fixes the peer: send() sends there, and only its datagrams are received. Throws Error when there is no
  /// route.
  void connect(const Endpoint& peer);

  /// Sends one datagram to the connected peer; false when it was dropped. Never blocks.
  bool send(std::span<const std::byte> bytes);
  /// Sends one datagram; false when it was dropped. Never blocks.
  bool sendTo(std::span<const std::byte> bytes, const Endpoint& to);
  /// Sends many datagrams in few system calls and returns how many were not dropped. Never blocks.
  std::size_t sendBatch(std::span<const Datagram> datagrams);

  /// Where it is bound, with the real port.
  const Endpoint& local() const noexcept;
  const UdpStatistics& statistics() const noexcept;

 private:
  std::shared_ptr<Impl> impl_;
};

}  // namespace hapticd::net
