// Datagrams with Asio.
#pragma once

#include "net/asio_loop.h"

namespace hapticd::net {

/// See UdpSocket.
std::shared_ptr<UdpSocket::Impl> bindWithAsio(AsioLoop& loop, const Endpoint& local);

}  // namespace hapticd::net
