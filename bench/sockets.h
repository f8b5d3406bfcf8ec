// Plain blocking TCP, for the yardsticks and for clients that misbehave.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace hapticd::bench {

/// A socket that closes itself. Everything throws std::system_error.
class Socket {
 public:
  Socket() = default;
  explicit Socket(int descriptor) noexcept : fd_(descriptor) {}
  ~Socket();
  Socket(Socket&& other) noexcept;
  Socket& operator=(Socket&& other) noexcept;

  /// To 127.0.0.1, without Nagle's delay. A small receive buffer makes a slow reader slow sooner.
  static Socket connect(std::uint16_t port, int receiveBuffer_bytes = 0);
  /// A datagram socket that sends to this port of 127.0.0.1.
  static Socket connectDatagrams(std::uint16_t port);

  int fd() const noexcept { return fd_; }
  void sendAll(std::span<const std::byte> bytes);
  /// At least one byte; 0 when the peer has closed.
  std::size_t receive(std::span<std::byte> into);
  /// False when the peer closed before all of it came.
  bool receiveAll(std::span<std::byte> into);
  void close() noexcept;

 private:
  int fd_ = -1;
};

class Listener {
 public:
  Listener();
  std::uint16_t port() const noexcept { return port_; }
  Socket accept();

 private:
  Socket socket_;
  std::uint16_t port_ = 0;
};

/// A client of the server as bytes: the greeting and the descriptions that make `Phantom` report, then the
/// choice of reports (bits of wire::ReportKinds; 0 leaves the default) at this rate.
std::vector<std::byte> greeting(std::uint32_t kinds = 0, double rate_Hz = 0);
/// The greeting and `setObjectVertex` for corners 0 … count-1 of object 0, one message each.
std::vector<std::byte> vertexMessages(std::size_t count);

}  // namespace hapticd::bench
