// VRPN's default way to connect: we ask by a datagram, the server calls back by TCP.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "net/tcp_listener.h"
#include "net/udp_socket.h"

namespace hapticd::client {

/// Asks a server to call back, again every second, as long as it lives. Made and destroyed in the loop's
/// thread; its callbacks may destroy it.
class ReverseConnection {
 public:
  /// Throws net::Error when no route leads to the server or no socket is left.
  ReverseConnection(net::Loop& loop, const net::Endpoint& server, const net::ConnectionOptions& options,
           std::function<void(net::Connection)> onConnection, std::function<void()> onRefused);

 private:
  void ask();

  net::Endpoint local_;
  net::TcpListener listener_;
  net::UdpSocket socket_;
  std::string request_;
  net::Subscription again_;
};

}  // namespace hapticd::client
