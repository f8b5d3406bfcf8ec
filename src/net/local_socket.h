// Unix-domain stream sockets: connections within this machine whose peer the kernel names.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "net/connection.h"
#include "net/endpoint.h"
#include "net/tcp_listener.h"
#include "net/unix_socket.h"

namespace hapticd::net {

/// Accepts connections at a path of the file system; the destructor removes the socket. Every local user who
/// may enter the folder can connect. Without a file descriptor left it does as TcpListener.
class LocalListener {
 public:
  /// Creates the last folder of the path (mode 0700) when it is missing, and replaces a socket that nobody
  /// listens at. Throws Error.
  LocalListener(Loop& loop, std::filesystem::path path, std::function<void(Connection)> onAccept,
                const ConnectionOptions& options = {});
  ~LocalListener();
  LocalListener(const LocalListener&) = delete;
  LocalListener& operator=(const LocalListener&) = delete;

  const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
  std::shared_ptr<TcpListener::Impl> impl_;
};

/// A connection to a server at this path, open at once. Throws Error.
Connection connectLocal(Loop& loop, const std::filesystem::path& path, const ConnectionOptions& options = {});

/// Where the server that listens here has its Unix socket unless configured otherwise: hapticd/PORT.sock in
/// $RUNTIME_DIRECTORY (without hapticd/), $XDG_RUNTIME_DIR, /run (root) or, in a folder of its own, /tmp. Of
/// a server that does not listen on 127.0.0.1 the name is ADDRESS-PORT.sock: others, a tunnel for example,
/// may have the port there.
std::filesystem::path defaultSocketPath(const Endpoint& listening);
/// The socket of a server of this user that listens on that address, or of the system's service; nothing when
/// there is none, or when somebody else could have put it there. Passes over what servers left that were
/// killed. With `anyUser`, root also finds those of all users, whom it then trusts.
std::optional<std::filesystem::path> findServerSocket(const Endpoint& server, bool anyUser = false);

}  // namespace hapticd::net
