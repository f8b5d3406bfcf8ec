// The frames of a WebSocket (RFC 6455) as a server reads and writes them: pure, no socket.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "net/send_queue.h"

namespace hapticd::net {

enum class WebSocketOpcode : std::uint8_t {
  continuation = 0,
  text = 1,
  binary = 2,
  close = 8,
  ping = 9,
  pong = 10,
};

/// Status codes of a close frame that are used here.
inline constexpr std::uint16_t kWebSocketNormal = 1000;
inline constexpr std::uint16_t kWebSocketProtocolError = 1002;
inline constexpr std::uint16_t kWebSocketUnsupported = 1003;
inline constexpr std::uint16_t kWebSocketTooBig = 1009;
inline constexpr std::uint16_t kWebSocketNoStatus =
    1005;  ///< never on the wire: a close frame without a code

/// How the peer ended the connection, or the protocol error found.
struct WebSocketEnd {
  std::uint16_t code = kWebSocketNormal;
  std::string text;
  bool isError = false;  ///< found by us; `code` is then the one to send
};

/// The content of one read.
struct WebSocketInput {
  Buffer data;                      ///< payload of binary messages, in order, without their boundaries
  std::vector<Buffer> texts;        ///< whole messages, in order
  std::vector<Buffer> pings;        ///< each requires a pong with the same payload
  std::optional<WebSocketEnd> end;  ///< nothing after it is read
};

/// What the messages of a WebSocket carry.
enum class WebSocketContent {
  bytes,  ///< a byte stream in binary messages of any size; their boundaries mean nothing
  texts,  ///< one text per message, up to kLongestText; peers may mark it as binary
};

/// Parses the bytes of a client, in pieces of any size. A byte stream is passed on as it arrives, and the
/// reader buffers only a header and a control frame; of texts it buffers one message. Whether a text is UTF-8
/// is for its reader to check.
class WebSocketReader {
 public:
  static constexpr std::size_t kLongestText = std::size_t{64} * 1024;

  explicit WebSocketReader(WebSocketContent content = WebSocketContent::bytes) : content_(content) {}

  void feed(std::span<const std::byte> bytes, WebSocketInput& out);

 private:
  static constexpr std::size_t kLongestControl = 125;
  static constexpr std::size_t kLongestHeader = 14;

  std::size_t takeHeader(std::span<const std::byte> bytes, WebSocketInput& out);
  std::size_t takePayload(std::span<const std::byte> bytes, WebSocketInput& out);
  std::size_t headerSize() const;
  void checkStart(WebSocketInput& out);
  void beginFrame(WebSocketInput& out);
  void endFrame(WebSocketInput& out);
  void closingFrame(WebSocketInput& out);
  Buffer& payload(WebSocketInput& out);
  void fail(WebSocketInput& out, std::uint16_t code, std::string text);
  bool isControl() const { return static_cast<std::uint8_t>(opcode_) >= 8; }

  WebSocketContent content_;
  std::array<std::uint8_t, kLongestHeader> header_{};
  std::size_t headerHave_ = 0;
  bool inPayload_ = false;
  WebSocketOpcode opcode_ = WebSocketOpcode::binary;
  bool final_ = true;
  bool inMessage_ = false;  // inside a fragmented message
  bool over_ = false;
  std::uint64_t length_ = 0;
  std::uint64_t taken_ = 0;
  std::array<std::uint8_t, 4> mask_{};
  Buffer control_;
  Buffer text_;  // the message so far
};

/// One whole, unmasked frame with this payload.
Buffer webSocketFrame(WebSocketOpcode opcode, std::span<const std::byte> payload);
/// A close frame; the reason is truncated to what fits.
Buffer webSocketClose(std::uint16_t code, std::string_view reason);

/// Sec-WebSocket-Accept for the key of a request.
std::string webSocketAccept(std::string_view key);

}  // namespace hapticd::net
