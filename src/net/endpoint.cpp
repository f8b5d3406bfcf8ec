#include "net/endpoint.h"

#include <arpa/inet.h>

#include <charconv>
#include <system_error>

namespace hapticd::net {

std::string Endpoint::addressText() const {
  return std::to_string(address >> 24) + '.' + std::to_string(address >> 16 & 255) + '.' +
         std::to_string(address >> 8 & 255) + '.' + std::to_string(address & 255);
}

std::string Endpoint::text() const {
  return addressText() + ':' + std::to_string(port);
}

Endpoint Endpoint::parse(std::string_view text, std::uint16_t defaultPort) {
  const std::size_t colon = text.find(':');
  const std::string host(text.substr(0, colon));
  in_addr address{};
  bool valid = ::inet_pton(AF_INET, host.c_str(), &address) == 1;
  Endpoint result{ntohl(address.s_addr), defaultPort};
  if (colon != std::string_view::npos) {
    const std::string_view digits = text.substr(colon + 1);
    const char* end = digits.data() + digits.size();
    const auto [stop, error] = std::from_chars(digits.data(), end, result.port);
    valid = valid && error == std::errc{} && stop == end;
  }
  if (!valid) {
    throw Error("'" + std::string(text) + "' is not an IPv4 ADDRESS:PORT such as 127.0.0.1:3883");
  }
  return result;
}

}  // namespace hapticd::net
