#include "server/session/message_backlog.h"

#include <cstring>

namespace hapticd::server {
namespace {

struct Header {
  wire::MessageKind kind;
  wire::LocalSender sender;
  wire::Time time;
  base::Nanos received;
  std::size_t payload;
};

}  // namespace

void MessageBacklog::push(const wire::MessageReceived& message, base::Nanos received) {
  const Header header{message.kind, message.local_sender, message.time, received, message.payload.size()};
  // Compact when more than half is consumed: amortised constant cost per byte.
  if (begin_ > bytes_.size() / 2) {
    bytes_.erase(bytes_.begin(), bytes_.begin() + static_cast<std::ptrdiff_t>(begin_));
    begin_ = 0;
  }
  const std::size_t at = bytes_.size();
  bytes_.resize(at + sizeof header + message.payload.size());
  std::memcpy(bytes_.data() + at, &header, sizeof header);
  if (!message.payload.empty())
    std::memcpy(bytes_.data() + at + sizeof header, message.payload.data(), message.payload.size());
}

MessageBacklog::Entry MessageBacklog::pop() {
  Header header;
  std::memcpy(&header, bytes_.data() + begin_, sizeof header);
  Entry entry;
  entry.message.kind = header.kind;
  entry.message.local_sender = header.sender;
  entry.message.time = header.time;
  entry.message.payload = wire::ByteView(bytes_).subspan(begin_ + sizeof header, header.payload);
  entry.received = header.received;
  begin_ += sizeof header + header.payload;
  return entry;
}

}  // namespace hapticd::server
