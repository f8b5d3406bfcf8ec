// VRPN's default way to connect: the client asks by a datagram, the server opens the TCP connection.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "net/tcp_listener.h"
#include "net/udp_socket.h"

namespace hapticd::client {

/// Asks a server for a connection every second until it is destroyed, at the address that the server has at
/// that time and from the one that this machine has. Thread: that of the loop. Its callbacks may destroy it.
class ReverseConnection {
 public:
  /// Throws net::Error when there is no route to the server or no socket.
  ReverseConnection(net::Loop& loop, const net::Endpoint& server, std::function<net::Endpoint()> serverNow,
                    const net::ConnectionOptions& options, std::function<void(net::Connection)> onConnection,
                    std::function<void()> onRefused);

 private:
  void open(std::uint32_t address);
  void request();

  net::Loop& loop_;
  net::Endpoint server_;
  const net::ConnectionOptions options_;
  const std::function<void(net::Connection)> onConnection_;
  const std::function<void()> onRefused_;
  std::uint32_t address_ = 0;  // of this machine; 0: nothing is open
  std::optional<net::TcpListener> listener_;
  std::optional<net::UdpSocket> socket_;
  std::string message_;
  net::Subscription timer_;
};

}  // namespace hapticd::client
