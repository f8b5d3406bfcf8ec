// Listening with Asio.
#pragma once

#include "net/asio_loop.h"

namespace hapticd::net {

/// See TcpListener.
std::shared_ptr<TcpListener::Impl> listenWithAsio(AsioLoop& loop, const Endpoint& local,
                                                  std::function<void(Connection)> onAccept,
                                                  const ConnectionOptions& options, const char* option);

}  // namespace hapticd::net
