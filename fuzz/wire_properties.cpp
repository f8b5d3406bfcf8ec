#include "fuzz/wire_properties.h"

#include <cstdio>
#include <cstdlib>
#include <functional>
#include <set>
#include <variant>

#include "wire/codec.h"
#include "wire/cookie.h"
#include "wire/peer.h"
#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::wire {

namespace {

void require(bool holds, const char* what) {
  if (holds) return;
  std::fprintf(stderr, "violated: %s\n", what);
  std::abort();
}

std::vector<std::byte> payloadOf(const Message& message) {
  std::vector<std::byte> bytes(payloadSize(message));
  encodePayload(message, bytes.data());
  return bytes;
}

// What a peer did with its input: digests, because texts would take most of the time.
struct Seen {
  std::size_t events = 0;
  bool refused = false;
  std::vector<std::byte> sent;
  bool operator==(const Seen&) const = default;
};

void mix(std::size_t& digest, std::size_t value) {
  digest = (digest ^ value) * 0x9E3779B97F4A7C15U;
  digest ^= digest >> 32U;
}
void mix(std::size_t& digest, std::string_view text) {
  mix(digest, std::hash<std::string_view>{}(text));
}
void mix(std::size_t& digest, std::int32_t value) {
  mix(digest, static_cast<std::size_t>(static_cast<std::uint32_t>(value)));
}

// Everything that an event has, views included.
struct Digest {
  std::size_t& digest;

  void operator()(const Connected& e) const {
    mix(digest, e.version);
    mix(digest, e.log_mode);
  }
  void operator()(const SenderDescribed& e) const {
    mix(digest, e.id.value);
    mix(digest, e.name);
  }
  void operator()(const TypeDescribed& e) const {
    mix(digest, e.id.value);
    mix(digest, e.name);
    mix(digest, static_cast<std::size_t>(e.kind));
  }
  void operator()(const MessageReceived& e) const {
    mix(digest, static_cast<std::size_t>(e.kind));
    mix(digest, e.type.value);
    mix(digest, e.sender.value);
    mix(digest, e.local_sender.value);
    mix(digest, e.typeName);
    mix(digest, e.senderName);
    mix(digest, std::size_t{e.time.seconds} << 32U | e.time.microseconds);
    mix(digest, asText(e.payload));
  }
  void operator()(const UdpDescribed& e) const {
    mix(digest, e.address.host);
    mix(digest, std::size_t{e.address.port});
  }
  void operator()(const LogRequested& e) const {
    mix(digest, e.request.mode);
    mix(digest, e.request.inName);
    mix(digest, e.request.outName);
  }
  void operator()(const Ignored& e) const {
    mix(digest, e.reason);
    mix(digest, e.value);
  }
  void operator()(const ProtocolError& e) const { mix(digest, e.reason); }
};

Seen converse(const LocalNames& names, const PeerOptions& options, ByteView bytes, std::size_t piece) {
  Seen seen;
  Peer endpoint(names, options);
  const auto sink = [&](const Event& event) {
    mix(seen.events, event.index());
    std::visit(Digest{seen.events}, event);
    if (std::holds_alternative<ProtocolError>(event)) seen.refused = true;
    if (std::holds_alternative<UdpDescribed>(event)) endpoint.useDatagrams();
    if (const auto* message = std::get_if<MessageReceived>(&event)) {
      if (message->kind == kindOf<Ping>) endpoint.send(message->time, LocalSender{0}, Pong{});
    }
  };
  for (ByteView rest = bytes; !rest.empty(); rest = rest.subspan(std::min(piece, rest.size()))) {
    endpoint.feed(Time{1, 2}, rest.first(std::min(piece, rest.size())), sink);
  }
  endpoint.feedDatagram(bytes, sink);
  endpoint.takeStream(seen.sent);
  return seen;
}

// Announces all messages of the table, which takes longer than most inputs: made once.
const LocalNames& fuzzedNames() {
  static const LocalNames names = [] {
    LocalNames all;
    all.addSender("Phantom");
    return all;
  }();
  return names;
}

}  // namespace

void checkPayload(MessageKind kind, ByteView payload) {
  const Result<Message> message = decode(kind, payload);
  if (!message) return require(!message.error().empty(), "a refusal has a reason");
  const std::vector<std::byte> once = payloadOf(*message);
  require(once.size() <= payload.size(), "nothing is read behind the payload");
  const Result<Message> again = decode(kind, once);
  require(static_cast<bool>(again), "what we encode decodes");
  require(payloadOf(*again) == once, "encoding is stable");
}

void checkRequest(ByteView bytes) {
  const Result<UdpRequest> request = parseUdpRequest(bytes);
  if (!request) return require(!request.error().empty(), "a refusal has a reason");
  const std::string text = formatUdpRequest(*request);
  const Result<UdpRequest> again = parseUdpRequest(asBytes(text));
  require(again && again->host == request->host && again->port == request->port, "a request survives");
}

void checkSystemPayloads(ByteView bytes) {
  if (bytes.size() >= kCookieBytes) (void)decodeCookie(bytes.first(kCookieBytes));
  (void)decodeDescription(bytes);
  (void)decodeUdpDescription(1, bytes);
  (void)decodeLogDescription(3, bytes);
}

void checkFrames(ByteView bytes) {
  // Recorded streams start with a cookie; skipping it lets their frames be found.
  const bool cookie = asText(bytes).starts_with("vrpn") && bytes.size() >= kCookieBytes;
  FrameReader reader(cookie ? bytes.subspan(kCookieBytes) : bytes);
  std::size_t used = cookie ? kCookieBytes : 0;
  for (FrameView frame; reader.next(frame); used += frame.size) {
    const auto type = static_cast<std::uint32_t>(frame.header.type);
    checkPayload(MessageKind{static_cast<std::uint8_t>(type % kMessageKinds)}, frame.payload);
  }
  require(used + reader.rest().size() == bytes.size(), "frames leave no gap");
}

void checkCodec(ByteView bytes) {
  const auto asEveryKind = [](ByteView payload) {
    for (std::size_t i = 0; i < kMessageKinds; ++i)
      checkPayload(MessageKind{static_cast<std::uint8_t>(i)}, payload);
  };
  asEveryKind(bytes);
  checkRequest(bytes);
  checkSystemPayloads(bytes);
  checkFrames(bytes);
  const bool cookie = asText(bytes).starts_with("vrpn") && bytes.size() >= kCookieBytes;
  FrameReader reader(cookie ? bytes.subspan(kCookieBytes) : bytes);
  for (FrameView frame; reader.next(frame);) asEveryKind(frame.payload);
}

void checkEndpoint(ByteView bytes) {
  const LocalNames& names = fuzzedNames();
  PeerOptions options;
  if (bytes.size() % 2 == 0) options.udp = UdpAddress{"127.0.0.1", 4000};
  const std::size_t piece = 1 + (bytes.empty() ? 0 : static_cast<std::size_t>(bytes.back()) % 61);

  const Seen whole = converse(names, options, bytes, bytes.size());
  const Seen pieces = converse(names, options, bytes, piece);
  require(whole == pieces, "cuts change neither what is seen nor what is sent");

  // Most inputs get the same answers; each is checked once.
  static std::set<std::size_t> accepted;
  if (!accepted.insert(std::hash<std::string_view>{}(asText(whole.sent)) + options.udp.has_value()).second)
    return;
  require(!converse(names, options, whole.sent, whole.sent.size()).refused, "our own bytes are accepted");
}

}  // namespace hapticd::wire
