// VRPN's mode udp: a client asks by datagram, and the server connects to it.
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "net/connection.h"
#include "net/loop.h"
#include "net/udp_socket.h"
#include "server/session/throttled_log.h"

namespace hapticd::server {

/// Listens for requests and connects to those who sent them. Net thread.
class ReverseConnections {
 public:
  /// A connection to a client, and a socket for its datagrams.
  using Accept = std::function<void(net::Connection connection, std::unique_ptr<net::UdpSocket> udp)>;

  /// `allowedHosts`: hosts that a request may name besides its source address. `allowsPlaintext`: whether
  /// packets for an address may travel without encryption. Throws net::Error when the port is taken.
  ReverseConnections(net::Loop& loop, const net::Endpoint& local, const net::ConnectionOptions& options,
                     std::vector<std::string> allowedHosts,
                     std::function<bool(std::uint32_t address)> allowsPlaintext, ThrottledLog& log,
                     Accept accept);
  ~ReverseConnections();
  ReverseConnections(const ReverseConnections&) = delete;
  ReverseConnections& operator=(const ReverseConnections&) = delete;

 private:
  struct Pending;

  void onRequest(std::span<const std::byte> datagram, const net::Endpoint& from);
  void connectTo(const net::Endpoint& client, const std::string& asked);
  void onConnected(Pending& pending);
  void forget(const Pending& pending);

  net::Loop& loop_;
  net::ConnectionOptions options_;
  std::vector<std::string> allowedHosts_;
  std::function<bool(std::uint32_t)> allowsPlaintext_;
  ThrottledLog& log_;
  Accept accept_;
  std::vector<std::unique_ptr<Pending>> pending_;
  net::UdpSocket requests_;
  std::uint16_t port_;
};

}  // namespace hapticd::server
