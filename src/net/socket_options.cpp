#include "net/socket_options.h"

#include <fcntl.h>
#include <linux/sockios.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

namespace hapticd::net {
namespace {

void setOption(int fd, int level, int name, int value) noexcept {
  ::setsockopt(fd, level, name, &value, sizeof value);
}

}  // namespace

void setCloseOnExec(int fd) noexcept {
  ::fcntl(fd, F_SETFD, FD_CLOEXEC);
}

void setNoDelay(int fd) noexcept {
  setOption(fd, IPPROTO_TCP, TCP_NODELAY, 1);
}

void setSendBuffer(int fd, int bytes) noexcept {
  setOption(fd, SOL_SOCKET, SO_SNDBUF, bytes);
}

void setLossDetection(int fd, std::chrono::milliseconds lossTimeout,
                      std::chrono::seconds keepAlive) noexcept {
  constexpr int kProbes = 3;
  const int interval = static_cast<int>(keepAlive.count());
  setOption(fd, IPPROTO_TCP, TCP_USER_TIMEOUT, static_cast<int>(lossTimeout.count()));
  setOption(fd, SOL_SOCKET, SO_KEEPALIVE, interval > 0 ? 1 : 0);
  if (interval > 0) {
    setOption(fd, IPPROTO_TCP, TCP_KEEPIDLE, interval);
    setOption(fd, IPPROTO_TCP, TCP_KEEPINTVL, interval);
    setOption(fd, IPPROTO_TCP, TCP_KEEPCNT, kProbes);
  }
}

std::size_t unacknowledgedBytes(int fd) noexcept {
  int bytes = 0;
  return ::ioctl(fd, SIOCOUTQ, &bytes) == 0 && bytes > 0 ? static_cast<std::size_t>(bytes) : 0;
}

}  // namespace hapticd::net
