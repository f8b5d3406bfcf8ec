// Frames as a browser sends them, right and wrong.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

namespace hapticd::net {

/// A masked frame. `first` is the whole first byte: 0x82 is a binary message in one piece.
inline std::string clientFrame(std::uint8_t first, std::string_view payload) {
  constexpr std::array<std::uint8_t, 4> kMask{0x37, 0xfa, 0x21, 0x3d};
  const std::size_t size = payload.size();
  const int lengthBytes = size < 126 ? 0 : size < 65536 ? 2 : 8;
  std::string frame;
  frame += static_cast<char>(first);
  frame += static_cast<char>(0x80 | (lengthBytes == 0 ? size : lengthBytes == 2 ? 126 : 127));
  for (int i = lengthBytes - 1; i >= 0; --i) frame += static_cast<char>(size >> (8 * i) & 0xff);
  for (const std::uint8_t byte : kMask) frame += static_cast<char>(byte);
  for (std::size_t i = 0; i < size; ++i) {
    frame += static_cast<char>(static_cast<std::uint8_t>(payload[i]) ^ kMask[i % 4]);
  }
  return frame;
}

inline constexpr std::uint8_t kBinary = 0x82;
inline constexpr std::uint8_t kBinaryBegin = 0x02;
inline constexpr std::uint8_t kMore = 0x00;
inline constexpr std::uint8_t kLast = 0x80;
inline constexpr std::uint8_t kPing = 0x89;
inline constexpr std::uint8_t kPong = 0x8a;
inline constexpr std::uint8_t kClose = 0x88;

/// A greeting with the key of RFC 6455, whose answer is known.
inline std::string upgradeRequest(const std::string& path, const std::string& moreHeaders = "") {
  return "GET " + path +
         " HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: keep-alive, Upgrade\r\n"
         "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n" +
         moreHeaders + "\r\n";
}
inline constexpr std::string_view kUpgradeAnswer =
    "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
    "Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n\r\n";

}  // namespace hapticd::net
