#include "net/unix_socket.h"

#include <fcntl.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <system_error>
#include <utility>

#include "net/endpoint.h"

namespace hapticd::net {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail(const fs::path& path, int error) {
  throw Error("cannot use the Unix socket " + path.string() + ": " + std::system_category().message(error));
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

sockaddr_un addressOf(const fs::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  static_assert(kLongestSocketPath < sizeof address.sun_path);  // and the zero behind it
  if (path.native().size() > kLongestSocketPath) fail(path, ENAMETOOLONG);
  std::memcpy(address.sun_path, path.c_str(), path.native().size());
  return address;
}

Descriptor openSocket(const fs::path& path) {
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) fail(path, errno);
  return Descriptor(fd);
}

// 0, or the reason.
int connect(int fd, const fs::path& path) {
  const sockaddr_un address = addressOf(path);
  return ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ? 0 : errno;
}

}  // namespace

std::optional<std::uint32_t> ownerOf(const fs::path& path) {
  struct stat status {};
  if (::lstat(path.c_str(), &status) != 0) return std::nullopt;
  return status.st_uid;
}

std::optional<std::uint32_t> userBehind(int fd) noexcept {
  int domain = 0;
  socklen_t size = sizeof domain;
  if (fd < 0 || ::getsockopt(fd, SOL_SOCKET, SO_DOMAIN, &domain, &size) != 0 || domain != AF_UNIX)
    return std::nullopt;
  ucred peer{};
  size = sizeof peer;
  if (::getsockopt(fd, SOL_SOCKET, SO_PEERCRED, &peer, &size) != 0) return std::nullopt;
  return peer.uid;
}

int listenAt(const fs::path& path) {
  constexpr int kBacklog = 256;
  if (::mkdir(path.parent_path().c_str(), 0700) != 0 && errno != EEXIST) fail(path.parent_path(), errno);
  // Whoever owns the folder can put another server in this one's place.
  const auto owner = ownerOf(path.parent_path());
  if (owner && *owner != geteuid() && *owner != 0) fail(path.parent_path(), EPERM);
  Descriptor descriptor = openSocket(path);
  const sockaddr_un address = addressOf(path);
  const auto bind = [&] {
    return ::bind(descriptor.fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  };
  if (!bind()) {
    if (errno != EADDRINUSE) fail(path, errno);
    struct stat there {};
    if (::lstat(path.c_str(), &there) == 0 && !S_ISSOCK(there.st_mode))
      throw Error(path.string() + " exists and is no socket");
    if (!isAbandoned(path)) fail(path, EADDRINUSE);
    ::unlink(path.c_str());
    if (!bind()) fail(path, errno);
  }
  ::chmod(path.c_str(), 0666);
  if (::listen(descriptor.fd(), kBacklog) != 0) fail(path, errno);
  return descriptor.release();
}

bool isAbandoned(const fs::path& path) {
  const Descriptor probe = openSocket(path);
  return connect(probe.fd(), path) == ECONNREFUSED;
}

int connectTo(const fs::path& path) {
  Descriptor descriptor = openSocket(path);
  if (const int error = connect(descriptor.fd(), path); error != 0) fail(path, error);
  return descriptor.release();
}

}  // namespace hapticd::net
