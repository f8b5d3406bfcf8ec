#include "client/reverse_connection.h"

#include <chrono>

#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::client {

ReverseConnection::ReverseConnection(net::Loop& loop, const net::Endpoint& server, const net::ConnectionOptions& options,
                   std::function<void(net::Connection)> onConnection, std::function<void()> onRefused)
    : local_{net::localAddressTowards(server.addressText()), 0},
      listener_(loop, local_, std::move(onConnection), options),
      socket_(loop, local_),
      request_(wire::formatUdpRequest({local_.addressText(), listener_.local().port})) {
  socket_.connect(server);
  socket_.start({.onDatagram = {}, .onRefused = std::move(onRefused)});
  // Servers that are busy with another client throw requests away.
  again_ = loop.every(std::chrono::seconds(1), [this] { ask(); });
  ask();
}

void ReverseConnection::ask() {
  socket_.send(wire::asBytes(request_));
}

}  // namespace hapticd::client
