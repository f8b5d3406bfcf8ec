#include "fuzz/wire_properties.h"

#include <cstdio>
#include <cstdlib>

#include "wire/codec.h"
#include "wire/cookie.h"
#include "wire/event_text.h"
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

void checkPayload(ByteView payload) {
  for (std::size_t i = 0; i < kMessageKinds; ++i) {
    const MessageKind as{static_cast<std::uint8_t>(i)};
    const Result<Message> message = decode(as, payload);
    if (!message) {
      require(!message.error().empty(), "a refusal has a reason");
      continue;
    }
    const std::vector<std::byte> once = payloadOf(*message);
    require(once.size() <= payload.size(), "nothing is read behind the payload");
    const Result<Message> again = decode(as, once);
    require(static_cast<bool>(again), "what we encode decodes");
    require(payloadOf(*again) == once, "encoding is stable");
  }
}

void checkRequest(ByteView bytes) {
  const Result<UdpRequest> request = parseUdpRequest(bytes);
  if (!request) return;
  const std::string text = formatUdpRequest(*request);
  const Result<UdpRequest> again = parseUdpRequest(asBytes(text));
  require(again && again->host == request->host && again->port == request->port, "a request survives");
}

struct Seen {
  std::string events;
  std::vector<std::byte> sent;
};

Seen converse(const LocalNames& names, const PeerOptions& options, ByteView bytes, std::size_t piece) {
  Seen seen;
  Peer endpoint(names, options);
  const auto sink = [&](const Event& event) {
    seen.events += eventText(event) + '\n';
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

}  // namespace

void checkCodec(ByteView bytes) {
  checkPayload(bytes);
  checkRequest(bytes);
  if (bytes.size() >= kCookieBytes) (void)decodeCookie(bytes.first(kCookieBytes));
  (void)decodeDescription(bytes);
  (void)decodeUdpDescription(1, bytes);
  (void)decodeLogDescription(3, bytes);

  // Recorded streams start with a cookie; skipping it lets their frames be found.
  const bool cookie = asText(bytes).starts_with("vrpn") && bytes.size() >= kCookieBytes;
  FrameReader reader(cookie ? bytes.subspan(kCookieBytes) : bytes);
  std::size_t used = cookie ? kCookieBytes : 0;
  for (FrameView frame; reader.next(frame); used += frame.size) checkPayload(frame.payload);
  require(used + reader.rest().size() == bytes.size(), "frames leave no gap");
}

void checkEndpoint(ByteView bytes) {
  LocalNames names;
  names.addSender("Phantom");
  PeerOptions options;
  if (bytes.size() % 2 == 0) options.udp = UdpAddress{"127.0.0.1", 4000};
  const std::size_t piece = 1 + (bytes.empty() ? 0 : static_cast<std::size_t>(bytes.back()) % 61);

  const Seen whole = converse(names, options, bytes, bytes.size());
  const Seen pieces = converse(names, options, bytes, piece);
  require(whole.events == pieces.events, "cuts do not change what is seen");
  require(whole.sent == pieces.sent, "cuts do not change what is sent");

  const Seen answer = converse(names, options, whole.sent, whole.sent.size());
  require(answer.events.find("error: ") == std::string::npos, "our own bytes are accepted");
}

}  // namespace hapticd::wire
