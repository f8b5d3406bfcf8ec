#include "net/network.h"

#include <arpa/inet.h>
#include <netdb.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <memory>
#include <system_error>

#include "net/asio_loop.h"
#include "net/endpoint.h"

namespace hapticd::net {
namespace {

sockaddr_in toSocketAddress(const Endpoint& endpoint) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr.s_addr = htonl(endpoint.address);
  result.sin_port = htons(endpoint.port);
  return result;
}

class SystemNetwork final : public Network {
 public:
  std::unique_ptr<Loop::Impl> makeLoop() override { return std::make_unique<AsioLoop>(); }
  std::uint32_t resolve(const std::string& host) override;
  std::uint32_t localAddressTowards(const std::string& host) override;
};

std::uint32_t SystemNetwork::resolve(const std::string& host) {
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

std::uint32_t SystemNetwork::localAddressTowards(const std::string& host) {
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

std::atomic<Network*> replaced{nullptr};

}  // namespace

Network& network() noexcept {
  static auto& machine = *new SystemNetwork;  // never destroyed: static objects may still use it
  Network* const other = replaced.load(std::memory_order_acquire);
  return other != nullptr ? *other : machine;
}

ScopedNetwork::ScopedNetwork(Network& network) noexcept {
  replaced.store(&network, std::memory_order_release);
}

ScopedNetwork::~ScopedNetwork() {
  replaced.store(nullptr, std::memory_order_release);
}

std::uint32_t resolve(const std::string& host) {
  return network().resolve(host);
}

std::uint32_t localAddressTowards(const std::string& host) {
  return network().localAddressTowards(host);
}

}  // namespace hapticd::net
