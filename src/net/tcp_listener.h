// Accepts TCP connections.
#pragma once

#include <functional>
#include <memory>

#include "net/connection.h"

namespace hapticd::net {

/// Listens from construction to destruction and hands each new connection, not yet started, to its callback.
/// While the process has no file descriptor left, it reports that to the loop's error handler once a second,
/// and new connections wait.
class TcpListener {
 public:
  class Impl;

  /// Port 0 lets the system choose one, see local(). Throws Error, which names the address, why, and a
  /// remedy: another choice for `option`.
  TcpListener(Loop& loop, const Endpoint& local, std::function<void(Connection)> onAccept,
              const ConnectionOptions& options = {}, const char* option = "--listen");
  ~TcpListener();
  TcpListener(const TcpListener&) = delete;
  TcpListener& operator=(const TcpListener&) = delete;

  /// Where it listens, with the real port.
  const Endpoint& local() const noexcept;

 private:
  std::shared_ptr<Impl> impl_;
};

}  // namespace hapticd::net
