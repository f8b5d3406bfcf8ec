#include "wire/udp_request.h"

#include <charconv>

#include "wire/text.h"

namespace hapticd::wire {

namespace {
constexpr int kLowestPort = 1024;
constexpr int kHighestPort = 65535;
}  // namespace

Result<UdpRequest> parseUdpRequest(ByteView datagram) {
  std::string_view text = asText(datagram);
  text = text.substr(0, text.find('\0'));
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos) {
    return Error{"connection request " + inQuotes(text) + " is not \"host port\""};
  }
  const std::string_view host = text.substr(0, space);
  const std::string_view digits = text.substr(space + 1);
  if (!isHost(host)) {
    return Error{"connection request " + inQuotes(text) + ": host " + inQuotes(host) +
                 " is not letters, digits and dots"};
  }
  int port = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (status != std::errc{} || end != digits.data() + digits.size() || port < kLowestPort ||
      port > kHighestPort) {
    return Error{"connection request " + inQuotes(text) + ": port " + inQuotes(digits) +
                 " is not 1024 to 65535"};
  }
  return UdpRequest{std::string(host), static_cast<std::uint16_t>(port)};
}

std::string formatUdpRequest(const UdpRequest& request) {
  return request.host + ' ' + std::to_string(request.port) + '\0';
}

}  // namespace hapticd::wire
