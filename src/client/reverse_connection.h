// VRPN's default way to connect: the client asks by a datagram, the server opens the TCP connection.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "net/tcp_listener.h"
#include "net/udp_socket.h"

namespace hapticd::client {

/// Asks a server for a connection every second until it is destroyed. Thread: that of the loop. Its callbacks
/// may destroy it.
class ReverseConnection {
 public:
  /// Throws net::Error when there is no route to the server or no socket.
  ReverseConnection(net::Loop& loop, const net::Endpoint& server, const net::ConnectionOptions& options,
                    std::function<void(net::Connection)> onConnection, std::function<void()> onRefused);

 private:
  void request();

  net::Endpoint local_;
  net::TcpListener listener_;
  net::UdpSocket socket_;
  std::string message_;
  net::Subscription timer_;
};

}  // namespace hapticd::client
