#include "net/endpoint.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <memory>
#include <system_error>

namespace hapticd::net {
namespace {

sockaddr_in toSocketAddress(const Endpoint& endpoint) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr.s_addr = htonl(endpoint.address);
  result.sin_port = htons(endpoint.port);
  return result;
}

}  // namespace

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

std::uint32_t resolve(const std::string& host) {
  addrinfo hints{};
  hints.ai_family = AF_INET;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  const int error = ::getaddrinfo(host.c_str(), nullptr, &hints, &found);
  if (error != 0) {
    const std::string why = error == EAI_SYSTEM ? std::system_category().message(errno) : gai_strerror(error);
    throw Error("cannot find host '" + host + "': " + why);
  }
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> list(found, &::freeaddrinfo);
  return ntohl(reinterpret_cast<const sockaddr_in*>(list->ai_addr)->sin_addr.s_addr);
}

std::uint32_t localAddressTowards(const std::string& host) {
  // Connecting a datagram socket only asks the routing table, so any port does.
  const Endpoint peer{resolve(host), 9};
  const sockaddr_in remote = toSocketAddress(peer);
  sockaddr_in local{};
  socklen_t size = sizeof local;
  const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const bool found = fd >= 0 &&
                     ::connect(fd, reinterpret_cast<const sockaddr*>(&remote), sizeof remote) == 0 &&
                     ::getsockname(fd, reinterpret_cast<sockaddr*>(&local), &size) == 0;
  const int error = errno;
  if (fd >= 0) {
    ::close(fd);
  }
  if (!found) {
    throw Error("no route to " + host + " (" + peer.addressText() +
                "): " + std::system_category().message(error));
  }
  return ntohl(local.sin_addr.s_addr);
}

}  // namespace hapticd::net
