#include "net/socket_options.h"

#include <fcntl.h>
#include <linux/sockios.h>
#include <linux/tcp.h>  // netinet/tcp.h has a tcp_info without the window
#include <netinet/in.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

#include <algorithm>
#include <limits>

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

void setUnsentLimit(int fd, int bytes) noexcept {
  setOption(fd, IPPROTO_TCP, TCP_NOTSENT_LOWAT, bytes);
}

void setKeepAlive(int fd, std::chrono::seconds interval) noexcept {
  constexpr int kProbes = 3;
  const int seconds = static_cast<int>(interval.count());
  setOption(fd, SOL_SOCKET, SO_KEEPALIVE, seconds > 0 ? 1 : 0);
  if (seconds > 0) {
    setOption(fd, IPPROTO_TCP, TCP_KEEPIDLE, seconds);
    setOption(fd, IPPROTO_TCP, TCP_KEEPINTVL, seconds);
    setOption(fd, IPPROTO_TCP, TCP_KEEPCNT, kProbes);
  }
}

std::optional<LinkState> linkState(int fd) noexcept {
  tcp_info info{};
  info.tcpi_snd_wnd = 1;  // as seen with systems that do not report it
  socklen_t size = sizeof info;
  if (::getsockopt(fd, IPPROTO_TCP, TCP_INFO, &info, &size) != 0) return std::nullopt;
  return LinkState{
      .inFlight = info.tcpi_unacked > 0,
      .probes = info.tcpi_probes,
      .windowClosed = info.tcpi_snd_wnd == 0,
      .retransmissions = info.tcpi_total_retrans,
      .sinceHeard = std::chrono::milliseconds(std::min(info.tcpi_last_ack_recv, info.tcpi_last_data_recv))};
}

PeerEnd peerEnd(int fd) noexcept {
  pollfd request{fd, POLLRDHUP, 0};
  if (::poll(&request, 1, 0) <= 0) return PeerEnd::none;
  if ((request.revents & (POLLERR | POLLHUP)) != 0) return PeerEnd::reset;
  return (request.revents & POLLRDHUP) != 0 ? PeerEnd::closed : PeerEnd::none;
}

bool isReadable(int fd) noexcept {
  pollfd request{fd, POLLIN, 0};
  return ::poll(&request, 1, 0) > 0;
}

// SO_RCVBUF is limited to net.core.rmem_max (208 KiB) and ends the automatic growth. The low-water mark
// enlarges the buffer as a side effect, up to tcp_rmem's maximum, and can be set back.
void widenReceiveBuffer(int fd) noexcept {
  setOption(fd, SOL_SOCKET, SO_RCVLOWAT, std::numeric_limits<int>::max());
  setOption(fd, SOL_SOCKET, SO_RCVLOWAT, 1);
}

std::size_t unacknowledgedBytes(int fd) noexcept {
  int bytes = 0;
  return ::ioctl(fd, SIOCOUTQ, &bytes) == 0 && bytes > 0 ? static_cast<std::size_t>(bytes) : 0;
}

}  // namespace hapticd::net
