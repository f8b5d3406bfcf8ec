// A client at one moment, as plain values: for the page and for metrics.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace hapticd::server {

struct ClientStatus {
  std::uint32_t id = 0;
  std::string address;
  std::string mode;                  ///< tcp, udp, web
  std::vector<std::string> devices;  ///< names it listens to
  double connected_s = 0;
  double rate_Hz = 0;  ///< of the reports it chose
  std::uint64_t bytesIn = 0;
  std::uint64_t bytesOut = 0;
  std::uint64_t dropped = 0;  ///< low-latency buffers and datagrams it never got
  std::size_t queuedBytes = 0;
  std::size_t unacknowledgedBytes = 0;
  bool commands = false;  ///< may change a scene
};

}  // namespace hapticd::server
