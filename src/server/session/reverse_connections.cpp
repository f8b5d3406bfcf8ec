#include "server/session/reverse_connections.h"

#include <algorithm>
#include <chrono>

#include "server/session/identity.h"
#include "wire/udp_request.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t kMostPending = 64;
constexpr std::size_t kMostOfOne = kMostPending / 4;

}  // namespace

struct ReverseConnections::Pending {
  std::string asked;  // by which source
  net::Endpoint client;
  net::Connection connection;
};

ReverseConnections::ReverseConnections(net::Loop& loop, const net::Endpoint& local,
                                       const net::ConnectionOptions& options,
                                       std::vector<std::string> allowedHosts,
                                       std::function<bool(std::uint32_t)> allowsPlaintext, ThrottledLog& log,
                                       Accept accept)
    : loop_(loop),
      options_(options),
      allowedHosts_(std::move(allowedHosts)),
      allowsPlaintext_(std::move(allowsPlaintext)),
      log_(log),
      accept_(std::move(accept)),
      requests_(loop, local),
      port_(local.port) {
  requests_.start(
      {.onDatagram = [this](auto bytes, const auto& from) { onRequest(bytes, from); }, .onRefused = {}});
}

ReverseConnections::~ReverseConnections() = default;

void ReverseConnections::onRequest(std::span<const std::byte> datagram, const net::Endpoint& from) {
  const auto request = wire::parseUdpRequest(datagram);
  if (!request) {
    log_.warn("datagram from " + from.text() + " is not a connection request: " + request.error());
    return;
  }
  net::Endpoint client;
  try {
    client = net::Endpoint::parse(request->host, request->port);
  } catch (const net::Error& error) {
    log_.warn("connection request from " + from.text() + " refused: " + error.what());
    return;
  }
  // A forged request must not make this server connect to third parties.
  const bool sameHost =
      client.address == from.address || (net::isLoopback(client.address) && net::isLoopback(from.address));
  const bool allowed =
      std::find(allowedHosts_.begin(), allowedHosts_.end(), request->host) != allowedHosts_.end();
  if (!sameHost && !allowed) {
    log_.warnOfLasting("connection request from " + from.addressText() + " names another host, " +
                       client.text() + ": refused; allow it with callback_hosts");
    return;
  }
  if (!allowed && !allowsPlaintext_(client.address)) {
    log_.warnOfLasting("connection request from " + from.addressText() +
                       " refused: datagrams cannot be encrypted; use 'hapticd tunnel' on that machine, "
                       "trusted_networks or insecure");
    return;
  }
  connectTo(client, sourceOf(from.addressText()));
}

void ReverseConnections::connectTo(const net::Endpoint& client, const std::string& asked) {
  // Clients repeat their request until the server connects.
  for (const auto& pending : pending_) {
    if (pending->client == client) return;
  }
  // Those that answer nobody must leave room for others.
  const std::string called = sourceOf(client.addressText());
  const auto ofOne = [&](const auto& pending) {
    return pending->asked == asked || sourceOf(pending->client.addressText()) == called;
  };
  if (std::count_if(pending_.begin(), pending_.end(), ofOne) >= std::ptrdiff_t{kMostOfOne}) {
    log_.warn("connection request to " + client.text() + " ignored: " + std::to_string(kMostOfOne) +
              " others of its address are pending");
    return;
  }
  if (pending_.size() >= kMostPending) {
    log_.warn("connection request to " + client.text() + " ignored: " + std::to_string(kMostPending) +
              " others are pending");
    return;
  }
  Pending& pending = *pending_.emplace_back(std::make_unique<Pending>());
  pending.asked = asked;
  pending.client = client;
  pending.connection = net::Connection::connect(loop_, client, 2s, options_);
  pending.connection.start({.onConnected = [this, &pending] { onConnected(pending); },
                            .onBytes = {},
                            .onDrained = {},
                            .onClosed =
                                [this, &pending](const std::string& reason) {
                                  log_.warn("reverse connection to " + pending.client.text() +
                                            " failed: " + reason);
                                  forget(pending);
                                }});
}

void ReverseConnections::onConnected(Pending& pending) {
  net::Connection connection = std::move(pending.connection);
  forget(pending);
  const net::Endpoint remote = connection.remote();
  net::Endpoint local = connection.local();
  // All of 127.0.0.0/8 is this machine; any other address of its own is its source address, too. Of a port at
  // which nobody listens, the kernel may choose the same as the source, and the connection meets itself.
  const bool itself = remote.address == local.address && remote.port == local.port;
  if (itself ||
      (remote.port == port_ && (net::isLoopback(remote.address) || remote.address == local.address))) {
    log_.warn("connection request names this server itself: refused");
    return;
  }
  local.port = 0;
  std::unique_ptr<net::UdpSocket> datagrams;
  try {
    datagrams = std::make_unique<net::UdpSocket>(loop_, local);
  } catch (const net::Error& error) {
    // No descriptor is left. The connection ends, and the client asks again.
    log_.warn("reverse connection to " + remote.text() + " failed: " + error.what());
    return;
  }
  accept_(std::move(connection), std::move(datagrams));
}

void ReverseConnections::forget(const Pending& pending) {
  std::erase_if(pending_, [&](const auto& entry) { return entry.get() == &pending; });
}

}  // namespace hapticd::server
