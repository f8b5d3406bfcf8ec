#include "net/web_socket_frames.h"

#include <algorithm>
#include <utility>

#include "net/sha1.h"

namespace hapticd::net {
namespace {

// What RFC 6455, 7.4 lets a peer send.
bool mayBeSent(std::uint16_t code) {
  return (code >= 1000 && code <= 1014 && code != 1004 && code != 1005 && code != 1006) ||
         (code >= 3000 && code <= 4999);
}

}  // namespace

void WebSocketReader::feed(std::span<const std::byte> bytes, WebSocketInput& out) {
  while (!bytes.empty() && !over_) {
    bytes = bytes.subspan(inPayload_ ? takePayload(bytes, out) : takeHeader(bytes, out));
  }
}

std::size_t WebSocketReader::headerSize() const {
  constexpr std::size_t kStart = 2;
  constexpr std::size_t kMask = 4;
  if (headerHave_ < kStart) return kStart;
  const std::uint8_t length = header_[1] & 0x7f;
  return kStart + (length == 127 ? 8 : length == 126 ? 2 : 0) + kMask;
}

std::size_t WebSocketReader::takeHeader(std::span<const std::byte> bytes, WebSocketInput& out) {
  const std::size_t count = std::min(bytes.size(), headerSize() - headerHave_);
  for (std::size_t i = 0; i < count; ++i) header_[headerHave_ + i] = static_cast<std::uint8_t>(bytes[i]);
  const bool startWasThere = headerHave_ >= 2;
  headerHave_ += count;
  if (!startWasThere && headerHave_ == 2) checkStart(out);
  if (!over_ && headerHave_ == headerSize()) beginFrame(out);
  return count;
}

void WebSocketReader::checkStart(WebSocketInput& out) {
  opcode_ = static_cast<WebSocketOpcode>(header_[0] & 0x0f);
  final_ = (header_[0] & 0x80) != 0;
  const auto wrong = [&](const char* text) { fail(out, kWebSocketProtocolError, text); };
  if ((header_[0] & 0x70) != 0) return wrong("a frame has reserved bits set");
  if ((header_[1] & 0x80) == 0) return wrong("a frame is not masked");
  switch (opcode_) {
    case WebSocketOpcode::continuation:
      if (!inMessage_) wrong("a message goes on that was not begun");
      return;
    case WebSocketOpcode::text:
      if (content_ == WebSocketContent::bytes)
        return fail(out, kWebSocketUnsupported, "a text message: only binary ones are understood here");
      if (inMessage_) wrong("a message begins inside another");
      return;
    case WebSocketOpcode::binary:
      if (inMessage_) wrong("a message begins inside another");
      return;
    case WebSocketOpcode::close:
    case WebSocketOpcode::ping:
    case WebSocketOpcode::pong:
      if (!final_ || (header_[1] & 0x7f) > kLongestControl) wrong("a control frame is too long or in pieces");
      return;
  }
  wrong("a frame of an unknown kind");
}

void WebSocketReader::beginFrame(WebSocketInput& out) {
  const std::size_t lengthBytes = headerHave_ - 6;
  length_ = header_[1] & 0x7f;
  if (lengthBytes > 0) {
    length_ = 0;
    for (std::size_t i = 0; i < lengthBytes; ++i) length_ = length_ << 8 | header_[2 + i];
    const std::uint64_t least = lengthBytes == 2 ? 126 : 65536;
    if (length_ < least || length_ >> 63 != 0) {
      return fail(out, kWebSocketProtocolError, "the length of a frame is not in its shortest form");
    }
  }
  std::copy_n(header_.begin() + static_cast<std::ptrdiff_t>(2 + lengthBytes), 4, mask_.begin());
  if (!isControl() && content_ == WebSocketContent::texts && length_ > kLongestText - text_.size()) {
    return fail(out, kWebSocketTooBig, "a message is longer than " + std::to_string(kLongestText) + " bytes");
  }
  headerHave_ = 0;
  taken_ = 0;
  control_.clear();
  inPayload_ = true;
  if (length_ == 0) endFrame(out);
}

std::size_t WebSocketReader::takePayload(std::span<const std::byte> bytes, WebSocketInput& out) {
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), length_ - taken_));
  Buffer& into = payload(out);
  into.reserve(into.size() + count);
  for (std::size_t i = 0; i < count; ++i) {
    into.push_back(bytes[i] ^ static_cast<std::byte>(mask_[(taken_ + i) % 4]));
  }
  taken_ += count;
  if (taken_ == length_) endFrame(out);
  return count;
}

Buffer& WebSocketReader::payload(WebSocketInput& out) {
  if (isControl()) return control_;
  return content_ == WebSocketContent::texts ? text_ : out.data;
}

void WebSocketReader::endFrame(WebSocketInput& out) {
  inPayload_ = false;
  if (!isControl()) {
    inMessage_ = !final_;
    if (final_ && content_ == WebSocketContent::texts) out.texts.push_back(std::exchange(text_, {}));
  } else if (opcode_ == WebSocketOpcode::ping) {
    out.pings.push_back(control_);
  } else if (opcode_ == WebSocketOpcode::close) {
    closingFrame(out);
  }
}

void WebSocketReader::closingFrame(WebSocketInput& out) {
  if (control_.empty()) {
    over_ = true;
    out.end = WebSocketEnd{kWebSocketNoStatus, "", false};
    return;
  }
  if (control_.size() == 1) return fail(out, kWebSocketProtocolError, "a closing frame with half a code");
  const auto code = static_cast<std::uint16_t>(static_cast<unsigned>(control_[0]) << 8 |
                                               static_cast<unsigned>(control_[1]));
  if (!mayBeSent(code)) {
    return fail(out, kWebSocketProtocolError, "a closing frame with the code " + std::to_string(code));
  }
  over_ = true;
  std::string text;
  for (std::size_t i = 2; i < control_.size(); ++i) text += static_cast<char>(control_[i]);
  out.end = WebSocketEnd{code, std::move(text), false};
}

void WebSocketReader::fail(WebSocketInput& out, std::uint16_t code, std::string text) {
  over_ = true;
  out.end = WebSocketEnd{code, std::move(text), true};
}

Buffer webSocketFrame(WebSocketOpcode opcode, std::span<const std::byte> payload) {
  const std::uint64_t size = payload.size();
  const int lengthBytes = size < 126 ? 0 : size < 65536 ? 2 : 8;
  Buffer frame;
  frame.reserve(2 + static_cast<std::size_t>(lengthBytes) + payload.size());
  frame.push_back(static_cast<std::byte>(0x80 | static_cast<unsigned>(opcode)));
  frame.push_back(static_cast<std::byte>(lengthBytes == 0 ? size : lengthBytes == 2 ? 126 : 127));
  for (int i = lengthBytes - 1; i >= 0; --i) frame.push_back(static_cast<std::byte>(size >> (8 * i) & 0xff));
  frame.insert(frame.end(), payload.begin(), payload.end());
  return frame;
}

Buffer webSocketClose(std::uint16_t code, std::string_view reason) {
  constexpr std::size_t kLongestReason = 123;
  constexpr std::string_view kCut = "...";
  std::string cut;
  if (reason.size() > kLongestReason) {
    std::size_t size = kLongestReason - kCut.size();
    const auto continues = [](char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; };
    while (size > 0 && continues(reason[size])) --size;  // no character is cut in two
    reason = cut.append(reason, 0, size).append(kCut);
  }
  Buffer payload{static_cast<std::byte>(code >> 8), static_cast<std::byte>(code & 0xff)};
  const auto bytes = std::as_bytes(std::span(reason.data(), reason.size()));
  payload.insert(payload.end(), bytes.begin(), bytes.end());
  return webSocketFrame(WebSocketOpcode::close, payload);
}

std::string webSocketAccept(std::string_view key) {
  return base64(sha1(std::string(key) + "258EAFA5-E914-47DA-95CA-C5AB0DC85B11"));
}

}  // namespace hapticd::net
