#include "bench/sockets.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "bench/scenes.h"
#include "wire/cookie.h"
#include "wire/peer.h"

namespace hapticd::bench {
namespace {

[[noreturn]] void fail(const char* what) {
  throw std::system_error(errno, std::generic_category(), what);
}

sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  address.sin_port = htons(port);
  return address;
}

void noDelay(int fd) {
  const int on = 1;
  setsockopt(fd, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
}

// An endpoint that believes its peer has greeted it, so that what it says can be kept as bytes.
class Speaker {
 public:
  Speaker() : sender_(names_.addSender("Phantom")), endpoint_(names_) {
    endpoint_.feed({}, wire::encodeCookie(0), [](const wire::Event&) {});
  }
  template <class M>
  void say(const M& message) {
    endpoint_.send({}, sender_, message);
  }
  std::vector<std::byte> bytes() {
    std::vector<std::byte> out;
    endpoint_.takeStream(out);
    return out;
  }

 private:
  wire::LocalNames names_;
  wire::LocalSender sender_;
  wire::Peer endpoint_;
};

}  // namespace

Socket::~Socket() {
  close();
}
Socket::Socket(Socket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
Socket& Socket::operator=(Socket&& other) noexcept {
  std::swap(fd_, other.fd_);
  return *this;
}

void Socket::close() noexcept {
  if (fd_ >= 0) ::close(std::exchange(fd_, -1));
}

Socket Socket::connect(std::uint16_t port, int receiveBuffer_bytes) {
  Socket socket(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
  if (socket.fd_ < 0) fail("socket");
  noDelay(socket.fd_);
  if (receiveBuffer_bytes > 0)
    setsockopt(socket.fd_, SOL_SOCKET, SO_RCVBUF, &receiveBuffer_bytes, sizeof receiveBuffer_bytes);
  const sockaddr_in address = loopback(port);
  if (::connect(socket.fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    fail("connect");
  return socket;
}

Socket Socket::connectDatagrams(std::uint16_t port) {
  Socket socket(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  if (socket.fd_ < 0) fail("socket");
  const sockaddr_in address = loopback(port);
  if (::connect(socket.fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
    fail("connect");
  return socket;
}

void Socket::sendAll(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t sent = ::send(fd_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (sent < 0 && errno == EINTR) continue;
    if (sent < 0) fail("send");
    bytes = bytes.subspan(static_cast<std::size_t>(sent));
  }
}

std::size_t Socket::receive(std::span<std::byte> into) {
  for (;;) {
    const ssize_t got = ::recv(fd_, into.data(), into.size(), 0);
    if (got >= 0) return static_cast<std::size_t>(got);
    if (errno == ECONNRESET) return 0;
    if (errno != EINTR) fail("receive");
  }
}

bool Socket::receiveAll(std::span<std::byte> into) {
  while (!into.empty()) {
    const std::size_t got = receive(into);
    if (got == 0) return false;
    into = into.subspan(got);
  }
  return true;
}

Listener::Listener() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address = loopback(0);
  if (::bind(socket_.fd(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) fail("bind");
  if (::listen(socket_.fd(), 4096) != 0) fail("listen");
  socklen_t size = sizeof address;
  getsockname(socket_.fd(), reinterpret_cast<sockaddr*>(&address), &size);
  port_ = ntohs(address.sin_port);
}

Socket Listener::accept() {
  Socket socket(::accept4(socket_.fd(), nullptr, nullptr, SOCK_CLOEXEC));
  if (socket.fd() < 0) fail("accept");
  noDelay(socket.fd());
  return socket;
}

std::vector<std::byte> greeting(std::uint32_t kinds, double rate_Hz) {
  Speaker speaker;
  if (kinds != 0) speaker.say(wire::Subscribe{kinds, rate_Hz});
  return speaker.bytes();
}

std::vector<std::byte> vertexMessages(std::size_t count) {
  Speaker speaker;
  const geometry::TriangleMesh mesh = makeBumpyBall(count / 3);
  for (std::size_t i = 0; i < count; ++i) {
    const geometry::Triangle& triangle = mesh.triangles[i / 3 % mesh.triangles.size()];
    const Vec3f& p = mesh.vertices[triangle[i % 3]];
    speaker.say(wire::SetVertex{0, static_cast<std::int32_t>(i), {p.x(), p.y(), p.z()}});
  }
  return speaker.bytes();
}

}  // namespace hapticd::bench
