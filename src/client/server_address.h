// How VRPN names a device: NAME@host, NAME@host:port, NAME@tcp://host:port.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace hapticd::client {

inline constexpr std::uint16_t kDefaultPort = 3883;

/// Where a server is and which of VRPN's two ways leads there.
struct ServerAddress {
  std::string host;
  std::uint16_t port = kDefaultPort;
  bool tcp_only =
      false;  ///< one TCP connection from us; otherwise the server calls back and datagrams are used

  /// "host:port".
  std::string text() const { return host + ':' + std::to_string(port); }
};

struct DeviceAddress {
  std::string device;
  ServerAddress server;
};

/// Reads what follows the @; throws std::invalid_argument that quotes anything else.
ServerAddress parseServer(std::string_view text);
/// Reads a whole name; throws std::invalid_argument that quotes anything else.
DeviceAddress parseDevice(std::string_view text);

}  // namespace hapticd::client
