// Listening with Asio.
#pragma once

#include "net/asio_loop.h"

namespace hapticd::net {

/// See TcpListener.
std::shared_ptr<TcpListener::Impl> listenWithAsio(AsioLoop& loop, const Endpoint& local,
                                                  std::function<void(Connection)> onAccept,
                                                  const ConnectionOptions& options, const char* option);
/// See Loop::Impl::listenLocal().
std::shared_ptr<TcpListener::Impl> listenLocallyWithAsio(AsioLoop& loop, const std::filesystem::path& path,
                                                         std::function<void(Connection)> onAccept,
                                                         const ConnectionOptions& options);

}  // namespace hapticd::net
