#include "wire/peer.h"

#include <algorithm>
#include <array>
#include <cstring>

#include "wire/cookie.h"
#include "wire/text.h"

namespace hapticd::wire {

namespace {

template <class Entry>
const Entry* described(const std::vector<Entry>& table, std::int32_t id) noexcept {
  if (id < 0 || id >= std::ssize(table) || !table[static_cast<std::size_t>(id)].described) return nullptr;
  return &table[static_cast<std::size_t>(id)];
}

// Not twice as large at each growth: very many peers may describe very many names.
template <class Entry>
Entry& entryFor(std::vector<Entry>& table, std::int32_t id) {
  const auto index = static_cast<std::size_t>(id);
  if (index >= table.size()) {
    if (index >= table.capacity()) table.reserve(std::min<std::size_t>(kMaxNames, index + 1 + index / 4));
    table.resize(index + 1);
  }
  return table[index];
}

template <class Entry>
std::size_t bytesOf(const std::vector<Entry>& table) {
  return table.capacity() * sizeof(Entry);
}

// What a string has in addition to its object.
std::size_t bytesOf(const std::string& text) {
  return text.capacity() > std::string().capacity() ? text.capacity() + 1 : 0;
}

// As encodeDescription(), without its allocation: a new connection describes every message of the table.
void addDescription(FrameEncoder& out, Time now, std::size_t id, std::int32_t type, std::string_view name) {
  std::array<std::byte, sizeof(std::int32_t) + kMaxNameBytes + 1> payload{};
  storeBig(payload.data(), static_cast<std::int32_t>(name.size() + 1));
  std::memcpy(payload.data() + sizeof(std::int32_t), name.data(), std::min(name.size(), kMaxNameBytes));
  out.addRaw(now, static_cast<std::int32_t>(id), type,
             ByteView(payload).first(sizeof(std::int32_t) + name.size() + 1));
}

}  // namespace

Peer::Peer(const LocalNames& names, PeerOptions options) : names_(&names), options_(std::move(options)) {
  stream_.append(encodeCookie(options_.log ? options_.log->mode : 0));
}

void Peer::feedStream(Time now, ByteView bytes, EventSink sink) {
  announce(now);
  // Complete units are handled in place; only one that was cut is assembled in partial_.
  while (!failed()) {
    if (partial_.empty()) {
      const std::size_t need = unitBytes(bytes);
      if (bytes.size() < need) {
        partial_.assign(bytes.begin(), bytes.end());
        return;
      }
      handleUnit(now, bytes.first(need), sink);
      bytes = bytes.subspan(need);
    } else if (const std::size_t need = unitBytes(partial_); partial_.size() < need) {
      const ByteView more = bytes.first(std::min(bytes.size(), need - partial_.size()));
      if (more.empty()) return;
      partial_.insert(partial_.end(), more.begin(), more.end());
      bytes = bytes.subspan(more.size());
    } else {
      handleUnit(now, partial_, sink);
      partial_.clear();
    }
  }
}

// Size of the cookie or frame that starts with these bytes, as far as they show it; for an invalid length
// only the bytes of the length.
std::size_t Peer::unitBytes(ByteView start) const noexcept {
  if (state_ == State::kAwaitingCookie) return kCookieBytes;
  constexpr std::size_t kLengthBytes = sizeof(std::uint32_t);
  if (start.size() < kLengthBytes) return kLengthBytes;
  FrameView frame;
  if (readFrame(start, frame) == FrameStatus::kInvalid) return kLengthBytes;
  return padded(loadBig<std::uint32_t>(start.data()));
}

void Peer::handleUnit(Time now, ByteView bytes, EventSink sink) {
  if (state_ == State::kAwaitingCookie) return handleCookie(now, bytes, sink);
  FrameView frame;
  if (readFrame(bytes, frame) != FrameStatus::kComplete) return fail(invalidFrame(bytes), sink);
  if (frame.header.type >= 0) return handleMessage(frame, sink);
  handleSystem(frame, sink);
}

void Peer::handleCookie(Time now, ByteView bytes, EventSink sink) {
  const Result<Cookie> cookie = decodeCookie(bytes);
  if (!cookie) return fail(cookie.error(), sink);
  state_ = State::kConnected;
  if (options_.log)
    stream_.addRaw(now, options_.log->mode, kLogDescription, encodeLogDescription(*options_.log));
  if (options_.udp)
    stream_.addRaw(now, options_.udp->port, kUdpDescription, encodeUdpDescription(*options_.udp));
  announce(now);
  sink(Connected{cookie->version, cookie->log_mode});
}

void Peer::handleSystem(const FrameView& frame, EventSink sink) {
  const FrameHeader& header = frame.header;
  if (header.type <= kFirstForbiddenType) {
    return fail("message of type " + std::to_string(header.type) + ", the lowest is " +
                    std::to_string(kFirstForbiddenType + 1),
                sink);
  }
  switch (header.type) {
    case kSenderDescription:
    case kTypeDescription:
      return handleDescription(frame, sink);
    case kUdpDescription: {
      if (!options_.udp) return sink(Ignored{"UDP description on a TCP-only connection", header.sender});
      const Result<UdpAddress> address = decodeUdpDescription(header.sender, frame.payload);
      if (!address) return fail(address.error(), sink);
      return sink(UdpDescribed{*address});
    }
    case kLogDescription: {
      const Result<LogRequest> request = decodeLogDescription(header.sender, frame.payload);
      if (!request) return fail(request.error(), sink);
      return sink(LogRequested{*request});
    }
    default:
      return sink(Ignored{"unknown system message", header.type});
  }
}

void Peer::handleDescription(const FrameView& frame, EventSink sink) {
  const std::int32_t id = frame.header.sender;
  if (id < 0 || id >= kMaxNames) {
    return fail(
        "description of number " + std::to_string(id) + ", expected 0 to " + std::to_string(kMaxNames - 1),
        sink);
  }
  const Result<std::string_view> name = decodeDescription(frame.payload);
  if (!name) return fail(name.error(), sink);
  const auto counted = [this](auto& table, auto& entry, auto&& described, std::size_t before) {
    namesBytes_ -= before + bytesOf(entry.name);
    entry = std::move(described);
    namesBytes_ += bytesOf(table) + bytesOf(entry.name);
  };
  if (frame.header.type == kSenderDescription) {
    const std::size_t before = bytesOf(senders_);
    SenderEntry& entry = entryFor(senders_, id);
    counted(senders_, entry,
            SenderEntry{std::string(*name), names_->findSender(*name).value_or(LocalSender{}), true}, before);
    sink(SenderDescribed{{id}, entry.name});
  } else {
    const std::size_t before = bytesOf(types_);
    TypeEntry& entry = entryFor(types_, id);
    counted(types_, entry, TypeEntry{std::string(*name), kindNamed(*name), true}, before);
    sink(TypeDescribed{{id}, entry.name, entry.kind});
  }
}

void Peer::handleMessage(const FrameView& frame, EventSink sink) const {
  const FrameHeader& header = frame.header;
  const TypeEntry* type = described(types_, header.type);
  if (!type) return sink(Ignored{"message of a type that was not described", header.type});
  const SenderEntry* sender = described(senders_, header.sender);
  if (!sender) return sink(Ignored{"message of a sender that was not described", header.sender});
  sink(MessageReceived{type->kind,
                       {header.type},
                       {header.sender},
                       sender->local,
                       type->name,
                       sender->name,
                       header.time,
                       frame.payload});
}

void Peer::feedPacket(ByteView datagram, EventSink sink) {
  if (!connected())
    return sink(Ignored{"datagram outside a connection", static_cast<std::int32_t>(datagram.size())});
  FrameReader reader(datagram);
  for (FrameView frame; reader.next(frame);) {
    if (frame.header.type < 0) {
      sink(Ignored{"system message in a datagram", frame.header.type});
    } else {
      handleMessage(frame, sink);
    }
  }
  if (!reader.rest().empty()) {
    sink(Ignored{"damaged datagram, bytes left", static_cast<std::int32_t>(reader.rest().size())});
  }
}

void Peer::fail(const std::string& reason, EventSink sink) {
  state_ = State::kFailed;
  sink(ProtocolError{reason});
}

bool Peer::announce(Time now) {
  if (!connected()) return false;
  const auto& senders = names_->senders();
  if (announcedSenders_ < senders.size()) {
    for (; announcedSenders_ < senders.size(); ++announcedSenders_) {
      addDescription(stream_, now, announcedSenders_, kSenderDescription, senders[announcedSenders_]);
    }
    for (SenderEntry& entry : senders_) {
      if (entry.described) entry.local = names_->findSender(entry.name).value_or(LocalSender{});
    }
  }
  const auto& types = names_->types();
  for (; announcedTypes_ < types.size(); ++announcedTypes_) {
    addDescription(stream_, now, announcedTypes_, kTypeDescription, types[announcedTypes_]);
  }
  return true;
}

FrameEncoder& Peer::route(Reliability reliability, std::size_t frame_bytes) noexcept {
  const bool fits = padded(frame_bytes) <= kMaxDatagramBytes;
  return useDatagrams_ && fits && reliability == Reliability::kLowLatency ? datagrams_ : stream_;
}

bool Peer::send(Time time, LocalSender sender, const Message& message, Reliability reliability) {
  if (!announce(time)) return false;
  route(reliability, kHeaderBytes + payloadSize(message)).add(time, sender, message);
  return true;
}

bool Peer::sendRaw(Time time, LocalSender sender, LocalType type, ByteView payload, Reliability reliability) {
  if (!announce(time)) return false;
  route(reliability, kHeaderBytes + payload.size()).addRaw(time, sender.value, type.value, payload);
  return true;
}

bool Peer::sendFrames(Time now, ByteView frames, Reliability reliability) {
  if (!announce(now)) return false;
  if (!useDatagrams_ || reliability == Reliability::kReliable) {
    stream_.append(frames);
    return true;
  }
  FrameReader reader(frames);
  std::size_t start = 0;
  for (FrameView frame; reader.next(frame); start += frame.size) {
    route(reliability, frame.size).append(frames.subspan(start, frame.size));
  }
  return true;
}

}  // namespace hapticd::wire
