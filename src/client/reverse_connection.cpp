#include "client/reverse_connection.h"

#include <chrono>

#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::client {

ReverseConnection::ReverseConnection(net::Loop& loop, const net::Endpoint& server,
                                     const net::ConnectionOptions& options,
                                     std::function<void(net::Connection)> onConnection,
                                     std::function<void()> onRefused)
    : local_{net::localAddressTowards(server.addressText()), 0},
      listener_(loop, local_, std::move(onConnection), options),
      socket_(loop, local_),
      message_(wire::formatUdpRequest({local_.addressText(), listener_.local().port})) {
  socket_.connect(server);
  socket_.start({.onDatagram = {}, .onRefused = std::move(onRefused)});
  // Repeat the request: a datagram may be lost, and busy servers ignore some.
  timer_ = loop.every(std::chrono::seconds(1), [this] { request(); });
  request();
}

void ReverseConnection::request() {
  socket_.send(wire::asBytes(message_));
}

}  // namespace hapticd::client
