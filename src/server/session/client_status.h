// The state of a client at one moment, as plain values for the viewer and the metrics.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace hapticd::server {

struct ClientStatus {
  std::uint32_t id = 0;
  std::string address;
  std::string mode;                  ///< tcp, udp, web, local
  std::string role;                  ///< observer, operator, owner
  std::vector<std::string> devices;  ///< names of the subscribed devices
  double connected_s = 0;
  double rate_Hz = 0;  ///< chosen report rate
  std::uint64_t bytesIn = 0;
  std::uint64_t bytesOut = 0;
  std::uint64_t dropped = 0;           ///< batches of reports not sent: the client or the server was behind
  std::uint64_t ignoredDatagrams = 0;  ///< to its port, but not from it, or without a message that counts
  std::size_t queuedBytes = 0;
  std::size_t unacknowledgedBytes = 0;
  bool commands = false;  ///< its role permits commands
};

}  // namespace hapticd::server
