#include "net/web_socket.h"

namespace hapticd::net {

WebSocket::WebSocket(Loop::Impl& loop, Connection stream, Buffer ahead, WebSocketContent content)
    : loop_(loop),
      stream_(std::move(stream)),
      ahead_(std::move(ahead)),
      content_(content),
      reader_(content) {}

void WebSocket::start(ConnectionHandlers callbacks) {
  handlers_ = std::make_shared<ConnectionHandlers>(std::move(callbacks));
  const std::weak_ptr<WebSocket> weak = weak_from_this();
  stream_.start({.onConnected = {},
                 .onBytes =
                     [weak](std::span<const std::byte> bytes) {
                       if (const auto self = weak.lock()) self->receive(bytes);
                     },
                 .onDrained =
                     [handlers = handlers_] {
                       if (handlers->onDrained) handlers->onDrained();
                     },
                 .onPeerGone =
                     [handlers = handlers_](const std::string& reason) {
                       if (handlers->onPeerGone) handlers->onPeerGone(reason);
                     },
                 .onClosed =
                     [handlers = handlers_](const std::string& reason) {
                       if (handlers->onClosed) handlers->onClosed(reason);
                     }});
  if (ahead_.empty()) return;
  loop_.post([weak] {
    const auto self = weak.lock();
    if (self && self->handlers_) self->receive({});
  });
}

void WebSocket::receive(std::span<const std::byte> bytes) {
  WebSocketInput in;
  reader_.feed(std::exchange(ahead_, {}), in);
  if (!in.end) reader_.feed(bytes, in);
  for (const Buffer& ping : in.pings) sendFrame(webSocketFrame(WebSocketOpcode::pong, ping));
  if (!in.pings.empty()) flush();
  const auto handlers = handlers_;
  if (!in.data.empty() && handlers && handlers->onBytes) handlers->onBytes(in.data);
  for (const Buffer& text : in.texts) {
    if (handlers_ && !closing_ && handlers->onBytes) handlers->onBytes(text);
  }
  if (in.end && handlers_) end(*in.end);
}

// Answers the peer's close frame with the same code; a close of ours names the error.
void WebSocket::end(const WebSocketEnd& end) {
  if (!sendable()) return;
  closing_ = true;
  const bool coded = end.code != kWebSocketNoStatus;
  sendFrame(coded ? webSocketClose(end.code, end.isError ? end.text : "")
                  : webSocketFrame(WebSocketOpcode::close, {}));
  stream_.close(end.isError ? "WebSocket error: " + end.text : "closed by the peer");
}

void WebSocket::send(std::shared_ptr<const Buffer> buffer, Delivery delivery) {
  if (!sendable() || !buffer || buffer->empty()) return;
  const auto opcode = content_ == WebSocketContent::texts ? WebSocketOpcode::text : WebSocketOpcode::binary;
  stream_.send(std::make_shared<const Buffer>(webSocketFrame(opcode, *buffer)), delivery);
}

void WebSocket::sendFrame(Buffer&& frame) {
  stream_.send(std::make_shared<const Buffer>(std::move(frame)));
}

void WebSocket::close(std::string reason) {
  if (sendable()) {
    closing_ = true;
    sendFrame(webSocketClose(kWebSocketNormal, reason));
  }
  stream_.close(std::move(reason));
}

void WebSocket::release() noexcept {
  handlers_.reset();
  stream_ = Connection();
}

void WebSocket::setPaused(bool paused) {
  if (paused) {
    stream_.pauseReading();
  } else {
    stream_.resumeReading();
  }
}

}  // namespace hapticd::net
