// The datagram with which a client asks the server for a reverse connection by TCP: "host port" and a NUL.
#pragma once

#include <cstdint>
#include <string>

#include "wire/bytes.h"
#include "wire/result.h"

namespace hapticd::wire {

/// Where the client listens for the server's TCP connection.
struct UdpRequest {
  std::string host;  ///< letters, digits and dots only
  std::uint16_t port = 0;
};

/// Reads a request datagram; ports below 1024 and other characters in the host are errors that quote them.
Result<UdpRequest> parseUdpRequest(ByteView datagram);

/// The datagram for this request, NUL included.
std::string formatUdpRequest(const UdpRequest& request);

}  // namespace hapticd::wire
