#include "net/local_socket.h"

#include <unistd.h>

#include <cstdlib>
#include <system_error>
#include <utility>
#include <vector>

#include "net/loop_impl.h"

namespace hapticd::net {

namespace fs = std::filesystem;

namespace {

constexpr const char* kServiceFolder = "/run/hapticd";  // only root can make it

// Whether the socket exists, and its folder belongs to this user or to the system; the latter's services run
// as other users.
bool isTrusted(const fs::path& socket, bool anyUser) {
  if (!ownerOf(socket)) return false;
  const auto folder = ownerOf(socket.parent_path());
  if (!folder) return false;
  return anyUser || *folder == geteuid() || socket.parent_path() == kServiceFolder;
}

std::string socketName(const Endpoint& listening) {
  const bool here = listening.address == kAnyAddress || listening.address == kLoopbackAddress;
  return (here ? "" : listening.addressText() + "-") + std::to_string(listening.port) + ".sock";
}

fs::path temporaryFolder(std::uint32_t user) {
  return "/tmp/hapticd-" + std::to_string(user);
}

}  // namespace

LocalListener::LocalListener(Loop& loop, fs::path path, std::function<void(Connection)> onAccept,
                             const ConnectionOptions& options)
    : path_(std::move(path)), impl_(loop.impl().listenLocal(path_, std::move(onAccept), options)) {}

LocalListener::~LocalListener() {
  impl_->close();
}

Connection connectLocal(Loop& loop, const fs::path& path, const ConnectionOptions& options) {
  return Connection(loop.impl().connectLocal(path, options));
}

fs::path defaultSocketPath(const Endpoint& listening) {
  const std::string name = socketName(listening);
  const char* service = secure_getenv("RUNTIME_DIRECTORY");
  if (service != nullptr && *service == '/') return fs::path(service) / name;
  const char* runtime = secure_getenv("XDG_RUNTIME_DIR");
  if (runtime != nullptr && *runtime == '/') return fs::path(runtime) / "hapticd" / name;
  if (geteuid() == 0) return fs::path(kServiceFolder) / name;
  return temporaryFolder(geteuid()) / name;
}

std::optional<fs::path> findServerSocket(const Endpoint& server, bool anyUser) {
  const std::string name = socketName(server);
  // The server may have been started with another environment: in a desktop session, or outside of it.
  std::vector<fs::path> candidates{defaultSocketPath(server), fs::path(kServiceFolder) / name,
                                   fs::path("/run/user") / std::to_string(geteuid()) / "hapticd" / name,
                                   temporaryFolder(geteuid()) / name};
  if (anyUser && geteuid() == 0) {
    std::error_code none;
    for (const auto& user : fs::directory_iterator("/run/user", none))
      candidates.push_back(user.path() / "hapticd" / name);
    for (const auto& entry : fs::directory_iterator("/tmp", none)) {
      if (entry.path().filename().native().starts_with("hapticd-")) candidates.push_back(entry.path() / name);
    }
  }
  for (const fs::path& candidate : candidates) {
    if (isTrusted(candidate, anyUser && geteuid() == 0) && !isAbandoned(candidate)) return candidate;
  }
  return std::nullopt;
}

}  // namespace hapticd::net
