#include "net/local_socket.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

#include "net/loop_impl.h"

namespace hapticd::net {

namespace fs = std::filesystem;

namespace {

constexpr const char* kServiceFolder = "/run/hapticd";  // only root can make it

[[noreturn]] void fail(const fs::path& path, int error) {
  throw Error("cannot use the Unix socket " + path.string() + ": " + std::system_category().message(error));
}

sockaddr_un addressOf(const fs::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  static_assert(kLongestSocketPath < sizeof address.sun_path);  // and the zero behind it
  if (path.native().size() > kLongestSocketPath) fail(path, ENAMETOOLONG);
  std::memcpy(address.sun_path, path.c_str(), path.native().size());
  return address;
}

int openSocket(const fs::path& path) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) fail(path, errno);
  return fd;
}

// 0, or the reason.
int connectTo(int fd, const fs::path& path) {
  const sockaddr_un address = addressOf(path);
  return ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ? 0 : errno;
}

std::optional<std::uint32_t> ownerOf(const fs::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return std::nullopt;
  return status.st_uid;
}

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

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int fd() const { return fd_; }
  int release() { return std::exchange(fd_, -1); }

 private:
  int fd_;
};

}  // namespace

std::optional<std::uint32_t> peerUser(const Connection& connection) noexcept {
  const int fd = connection.nativeHandle();
  int domain = 0;
  socklen_t size = sizeof domain;
  if (fd < 0 || ::getsockopt(fd, SOL_SOCKET, SO_DOMAIN, &domain, &size) != 0 || domain != AF_UNIX)
    return std::nullopt;
  ucred peer{};
  size = sizeof peer;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return std::nullopt;
  return peer.uid;
}

LocalListener::LocalListener(Loop& loop, fs::path path, std::function<void(Connection)> onAccept,
                             const ConnectionOptions& options)
    : path_(std::move(path)) {
  constexpr int kBacklog = 256;
  if (!loop.impl().hasLocalSockets()) throw Error("this network has no Unix sockets");
  if (::mkdir(path_.parent_path().c_str(), 0700) != 0 && errno != EEXIST) fail(path_.parent_path(), errno);
  // Whoever owns the folder can put another server in this one's place.
  const auto owner = ownerOf(path_.parent_path());
  if (owner && *owner != geteuid() && *owner != 0) fail(path_.parent_path(), EPERM);
  Descriptor descriptor(openSocket(path_));
  const sockaddr_un address = addressOf(path_);
  const auto bind = [&] {
    return ::bind(descriptor.fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  };
  if (!bind()) {
    if (errno != EADDRINUSE) fail(path_, errno);
    struct stat there {};
    if (::lstat(path_.c_str(), &there) == 0 && !S_ISSOCK(there.st_mode))
      throw Error(path_.string() +
                  " exists and is no socket: choose another path by socket in the configuration");
    const Descriptor probe(openSocket(path_));
    if (connectTo(probe.fd(), path_) != ECONNREFUSED) fail(path_, EADDRINUSE);
    ::unlink(path_.c_str());  // of a server that was killed
    if (!bind()) fail(path_, errno);
  }
  ::chmod(path_.c_str(), 0666);
  if (::listen(descriptor.fd(), kBacklog) != 0) fail(path_, errno);
  impl_ = loop.impl().listenLocal(descriptor.release(), path_, std::move(onAccept), options);
}

LocalListener::~LocalListener() {
  impl_->close();
  ::unlink(path_.c_str());
}

Connection connectLocal(Loop& loop, const fs::path& path, const ConnectionOptions& options) {
  if (!loop.impl().hasLocalSockets()) throw Error("this network has no Unix sockets");
  const int fd = openSocket(path);
  if (const int error = connectTo(fd, path); error != 0) {
    ::close(fd);
    fail(path, error);
  }
  return Connection(loop.impl().adopt(fd, options));
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
  std::vector<fs::path> candidates{defaultSocketPath(server), fs::path(kServiceFolder) / name,
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
    if (isTrusted(candidate, anyUser && geteuid() == 0)) return candidate;
  }
  return std::nullopt;
}

}  // namespace hapticd::net
