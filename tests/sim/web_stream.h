// A page's end of the web port's VRPN stream: its greeting, and the frames of the server (RFC 6455).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace hapticd::sim {

inline std::string webGreeting(const std::string& host) {
  return "GET /vrpn HTTP/1.1\r\nHost: " + host + "\r\nOrigin: http://" + host +
         "\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
         "Sec-WebSocket-Version: 13\r\n\r\n";
}

class WebStream {
 public:
  /// What the frames carry that are complete now. Throws std::runtime_error for what no server may send.
  std::vector<std::byte> take(std::span<const std::byte> bytes) {
    input_.append(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    std::vector<std::byte> payload;
    if (!greeted_ && !takeAnswer()) return payload;
    while (takeFrame(payload)) {
    }
    return payload;
  }

 private:
  bool takeAnswer() {
    const std::size_t end = input_.find("\r\n\r\n");
    if (end == std::string::npos) return false;
    const std::string answer = input_.substr(0, end + 2);
    if (!answer.starts_with("HTTP/1.1 101 ") ||
        answer.find("\r\nSec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n") == std::string::npos)
      throw std::runtime_error("the web port answers '" + answer.substr(0, answer.find('\r')) + "'");
    input_.erase(0, end + 4);
    greeted_ = true;
    return true;
  }

  bool takeFrame(std::vector<std::byte>& payload) {
    const auto at = [&](std::size_t i) { return static_cast<std::uint8_t>(input_[i]); };
    if (input_.size() < 2) return false;
    const int lengthBytes = at(1) < 126 ? 0 : at(1) == 126 ? 2 : 8;
    const std::size_t header = 2 + static_cast<std::size_t>(lengthBytes);
    if (input_.size() < header) return false;
    std::uint64_t size = lengthBytes == 0 ? at(1) : 0;
    for (int i = 0; i < lengthBytes; ++i) size = size << 8 | at(2 + static_cast<std::size_t>(i));
    if (input_.size() < header + size) return false;
    constexpr std::uint8_t kBinary = 0x82;
    constexpr std::uint8_t kClose = 0x88;
    if (at(0) != kBinary && at(0) != kClose)
      throw std::runtime_error("the web port sends a frame that begins with " + std::to_string(at(0)));
    if (at(0) == kBinary) {
      const auto bytes = std::as_bytes(std::span(input_)).subspan(header, size);
      payload.insert(payload.end(), bytes.begin(), bytes.end());
    }
    input_.erase(0, header + size);
    return true;
  }

  std::string input_;
  bool greeted_ = false;
};

}  // namespace hapticd::sim
