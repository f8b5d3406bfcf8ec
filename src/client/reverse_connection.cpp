#include "client/reverse_connection.h"

#include <chrono>
#include <utility>

#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::client {

ReverseConnection::ReverseConnection(net::Loop& loop, const net::Endpoint& server,
                                     std::function<net::Endpoint()> serverNow,
                                     const net::ConnectionOptions& options,
                                     std::function<void(net::Connection)> onConnection,
                                     std::function<void()> onRefused)
    : loop_(loop),
      server_(server),
      options_(options),
      onConnection_(std::move(onConnection)),
      onRefused_(std::move(onRefused)) {
  open(net::localAddressTowards(server_.addressText()));
  // Repeat the request: a datagram may be lost, and busy servers ignore some.
  timer_ = loop_.every(std::chrono::seconds(1), [this, serverNow = std::move(serverNow)] {
    if (const net::Endpoint now = serverNow(); now != server_) {
      server_ = now;
      address_ = 0;  // the socket is connected to the former one
    }
    request();
  });
  request();
}

void ReverseConnection::open(std::uint32_t address) {
  address_ = 0;  // until both are open
  const net::Endpoint local{address, 0};
  listener_.emplace(loop_, local, onConnection_, options_);
  socket_.emplace(loop_, local);
  socket_->connect(server_);
  socket_->start({.onDatagram = {}, .onRefused = onRefused_});
  message_ = wire::formatUdpRequest({local.addressText(), listener_->local().port});
  address_ = address;
}

// A machine that changes its network has another address: the server cannot call it at the former one.
void ReverseConnection::request() {
  try {
    if (const auto now = net::localAddressTowards(server_.addressText()); now != address_) open(now);
    socket_->send(wire::asBytes(message_));
  } catch (const net::Error&) {
    // No way to the server at this time.
  }
}

}  // namespace hapticd::client
