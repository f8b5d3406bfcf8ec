// Peers on the loopback that are not ours, and waits that are bounded and end with the event.
#pragma once

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

#include <chrono>
#include <cstddef>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "net/connection.h"
#include "net/loop.h"
#include "net/tcp_listener.h"

namespace hapticd::net {

inline const Endpoint kAnyPort{kLoopbackAddress, 0};

/// Handles events until the condition holds; false after a time that only a hang can take.
inline bool pumpUntil(Loop& loop, const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) {
      return false;
    }
    loop.runOnce(std::chrono::milliseconds(100));
  }
  return true;
}

inline std::span<const std::byte> bytesOf(std::string_view text) {
  return std::as_bytes(std::span(text.data(), text.size()));
}

inline std::string textOf(std::span<const std::byte> bytes) {
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

inline std::shared_ptr<const Buffer> bufferOf(std::string_view text) {
  const auto bytes = bytesOf(text);
  return std::make_shared<const Buffer>(bytes.begin(), bytes.end());
}

/// While it lives, the process can open no descriptor. Not under sanitizers: UBSan opens a pipe to look at an
/// object, and takes its failure for a bad object.
class NoDescriptors {
 public:
  NoDescriptors() {
    if (::getrlimit(RLIMIT_NOFILE, &before_) != 0) throw std::runtime_error("getrlimit");
    const int lowestFree = ::dup(0);
    ::close(lowestFree);
    const rlimit none{static_cast<rlim_t>(lowestFree), before_.rlim_max};
    if (::setrlimit(RLIMIT_NOFILE, &none) != 0) throw std::runtime_error("setrlimit");
  }
  ~NoDescriptors() { ::setrlimit(RLIMIT_NOFILE, &before_); }
  NoDescriptors(const NoDescriptors&) = delete;
  NoDescriptors& operator=(const NoDescriptors&) = delete;

 private:
  rlimit before_{};
};

/// A plain blocking socket, with a time limit on each read that only a hang reaches.
class RawSocket {
 public:
  explicit RawSocket(int type = SOCK_STREAM) : RawSocket(Taken{}, ::socket(AF_INET, type, 0)) {}
  RawSocket(RawSocket&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  ~RawSocket() { close(); }

  static RawSocket connected(const Endpoint& peer, int receiveBufferBytes = 0) {
    RawSocket socket;
    if (receiveBufferBytes > 0) {
      ::setsockopt(socket.fd_, SOL_SOCKET, SO_RCVBUF, &receiveBufferBytes, sizeof receiveBufferBytes);
    }
    socket.connect(peer);
    return socket;
  }

  /// From another address of this machine, 127.0.0.`last`.
  static RawSocket connectedFrom(int last, const Endpoint& peer, int type = SOCK_STREAM) {
    RawSocket socket(type);
    const sockaddr_in own = socketAddress({kLoopbackAddress - 1 + static_cast<std::uint32_t>(last), 0});
    if (::bind(socket.fd_, reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0)
      throw std::runtime_error(std::string("bind: ") + std::strerror(errno));
    socket.connect(peer);
    return socket;
  }

  static RawSocket accepted(const RawSocket& listener) {
    return RawSocket(Taken{}, ::accept(listener.fd_, nullptr, nullptr));
  }

  Endpoint bindToAnyPort() {
    sockaddr_in address = socketAddress(kAnyPort);
    socklen_t size = sizeof address;
    if (::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
        ::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &size) != 0) {
      throw std::runtime_error(std::string("bind: ") + std::strerror(errno));
    }
    return {kLoopbackAddress, ntohs(address.sin_port)};
  }

  bool send(std::string_view text) {
    return ::send(fd_, text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
  }

  /// Exactly `size` bytes, or what came before the end.
  std::string receive(std::size_t size) {
    std::string text(size, '\0');
    std::size_t have = 0;
    while (have < size) {
      const ssize_t got = ::recv(fd_, text.data() + have, size - have, 0);
      if (got <= 0) {
        break;
      }
      have += static_cast<std::size_t>(got);
    }
    text.resize(have);
    return text;
  }

  /// What is there, after waiting for it; nothing at the end.
  std::string receiveSome() {
    std::string text(4096, '\0');
    const ssize_t got = ::recv(fd_, text.data(), text.size(), 0);
    text.resize(got > 0 ? static_cast<std::size_t>(got) : 0);
    return text;
  }

  void shutdownSend() { ::shutdown(fd_, SHUT_WR); }
  void reset() {
    const linger now{1, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_LINGER, &now, sizeof now);
    close();
  }
  void close() {
    if (fd_ >= 0) {
      ::close(std::exchange(fd_, -1));
    }
  }
  int fd() const { return fd_; }

  static sockaddr_in socketAddress(const Endpoint& endpoint) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(endpoint.address);
    address.sin_port = htons(endpoint.port);
    return address;
  }

 private:
  void connect(const Endpoint& peer) const {
    const sockaddr_in address = socketAddress(peer);
    if (::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0)
      throw std::runtime_error(std::string("connect: ") + std::strerror(errno));
  }

  struct Taken {};
  RawSocket(Taken, int fd) : fd_(fd) {
    const timeval limit{30, 0};
    ::setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
  }

  int fd_;
};

/// A listener that keeps what it accepts, with what each connection received and why it ended.
struct Server {
  struct Session {
    Connection connection;
    std::string received;
    std::string closed;
  };

  explicit Server(Loop& eventLoop, const ConnectionOptions& options = {}, bool echo = false)
      : loop(eventLoop),
        listener(
            eventLoop, kAnyPort, [this, echo](Connection c) { accept(std::move(c), echo); }, options) {}

  void accept(Connection connection, bool echo) {
    Session* session = sessions.emplace_back(std::make_unique<Session>()).get();
    session->connection = std::move(connection);
    session->connection.start(
        {.onConnected = {},
         .onBytes =
             [session, echo](std::span<const std::byte> bytes) {
               session->received += textOf(bytes);
               if (echo) {
                 session->connection.send(bytes);
                 session->connection.flush();
               }
             },
         .onDrained = {},
         .onClosed = [session](const std::string& reason) { session->closed = reason; }});
  }

  /// Connects a raw peer and waits for its session.
  RawSocket join(int receiveBufferBytes = 0) {
    const std::size_t before = sessions.size();
    RawSocket peer = RawSocket::connected(listener.local(), receiveBufferBytes);
    if (!pumpUntil(loop, [&] { return sessions.size() > before; })) {
      throw std::runtime_error("the listener accepted nothing");
    }
    return peer;
  }
  Session& last() { return *sessions.back(); }

  Loop& loop;
  std::vector<std::unique_ptr<Session>> sessions;
  TcpListener listener;
};

}  // namespace hapticd::net
