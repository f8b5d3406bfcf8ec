// How VRPN names a device: NAME@host, NAME@host:port, NAME@tcp://host:port; and NAME@unix:/path.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace hapticd::client {

inline constexpr std::uint16_t kDefaultPort = 3883;

/// Address of a server, and which of VRPN's two ways to connect.
struct ServerAddress {
  std::string host;
  std::uint16_t port = kDefaultPort;
  /// One TCP connection from the client; otherwise a reverse connection with datagrams.
  bool tcpOnly = false;

  /// Path of a Unix socket on this machine, instead of host and port; empty: none.
  std::string socket;

  /// "host:port" or "unix:/path".
  std::string text() const { return socket.empty() ? host + ':' + std::to_string(port) : "unix:" + socket; }
};

struct DeviceAddress {
  std::string device;
  ServerAddress server;
};

/// Reads the part behind the @. Throws std::invalid_argument that quotes the text.
ServerAddress parseServer(std::string_view text);
/// Reads a whole name. Throws std::invalid_argument that quotes the text.
DeviceAddress parseDevice(std::string_view text);

}  // namespace hapticd::client
