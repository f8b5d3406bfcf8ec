// Connections in memory: handshakes, routing, and what ends or survives bad input.
#include "wire/peer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "wire/cookie.h"
#include "wire/event_text.h"
#include "wire/recording.h"

namespace hapticd::wire {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

constexpr Time kNow{100, 200};

// An endpoint, the names it announces, and what it saw.
struct Side {
  explicit Side(PeerOptions options = {}) : endpoint(names, std::move(options)) {}

  void feed(ByteView bytes) { endpoint.feed(kNow, bytes, sink()); }
  void feedDatagram(ByteView bytes) { endpoint.feedDatagram(bytes, sink()); }
  Bytes takeStream() {
    Bytes bytes;
    endpoint.takeStream(bytes);
    return bytes;
  }
  std::vector<Bytes> takeDatagrams() {
    std::vector<Bytes> all;
    endpoint.takeDatagrams([&](ByteView datagram) { all.emplace_back(datagram.begin(), datagram.end()); });
    return all;
  }
  std::function<void(const Event&)> sink() {
    return [this](const Event& event) {
      const std::string text = eventText(event);
      if (text.starts_with("type ")) ++types_described;
      if (!text.starts_with("type ")) seen.push_back(text.substr(0, text.find(" at 100.")));
      if (const auto* message = std::get_if<MessageReceived>(&event)) last = decodeLast(*message);
    };
  }
  static std::optional<Message> decodeLast(const MessageReceived& message) {
    Result<Message> decoded = decode(message.kind, message.payload);
    if (!decoded) return std::nullopt;
    return *std::move(decoded);
  }

  LocalNames names;
  Peer endpoint;
  std::vector<std::string> seen;
  std::size_t types_described = 0;
  std::optional<Message> last;
};

// Carries bytes both ways until nobody has anything to say.
void exchange(Side& a, Side& b) {
  for (Bytes to_b = a.takeStream(), to_a = b.takeStream(); !to_a.empty() || !to_b.empty();
       to_b = a.takeStream(), to_a = b.takeStream()) {
    b.feed(to_b);
    a.feed(to_a);
  }
}

// A side whose handshake is done with a peer that sends raw frames.
struct Stranger {
  explicit Stranger(PeerOptions options = {}) : side(std::move(options)) {
    side.feed(encodeCookie(0));
    side.seen.clear();
  }
  void says(std::int32_t sender, std::int32_t type, ByteView payload) {
    FrameEncoder encoder;
    encoder.addRaw(kNow, sender, type, payload);
    side.feed(encoder.bytes());
  }
  Side side;
};

TEST(Handshake, TcpOnlyDescribesNamesToBothSides) {
  Side server;
  Side client;
  server.names.addSender("Phantom");
  client.names.addSender("Phantom");
  client.names.addSender("Other");
  EXPECT_FALSE(server.endpoint.connected());
  exchange(server, client);
  EXPECT_TRUE(server.endpoint.connected());
  EXPECT_THAT(server.seen,
              ElementsAre("connected 07.38 log 0", "sender 0 \"Phantom\"", "sender 1 \"Other\""));
  EXPECT_THAT(client.seen, ElementsAre("connected 07.38 log 0", "sender 0 \"Phantom\""));
  EXPECT_EQ(server.types_described, kMessageKinds);
  EXPECT_EQ(client.types_described, kMessageKinds);
}

TEST(Handshake, WithUdpDescribesSocketsBeforeNames) {
  Side server({UdpAddress{"10.0.0.1", 5001}, {}});
  Side client({UdpAddress{"10.0.0.2", 5002}, LogRequest{2, "", "out.vrpn"}});
  server.names.addSender("Phantom");
  exchange(server, client);
  EXPECT_THAT(server.seen,
              ElementsAre("connected 07.38 log 2", "log 2 \"\" \"out.vrpn\"", "udp 10.0.0.2 5002"));
  EXPECT_THAT(client.seen, ElementsAre("connected 07.38 log 0", "udp 10.0.0.1 5001", "sender 0 \"Phantom\""));
}

TEST(Handshake, SendsNothingButTheCookieBeforeThePeersCookie) {
  Side side;
  side.names.addSender("Phantom");
  EXPECT_FALSE(side.endpoint.send(kNow, LocalSender{0}, Pong{}));
  EXPECT_FALSE(side.endpoint.sendFrames(kNow, Bytes(24), Reliability::kReliable));
  EXPECT_FALSE(side.endpoint.announce(kNow));
  EXPECT_EQ(side.takeStream().size(), kCookieBytes);
  side.feed(ByteView(encodeCookie(0)).first(23));
  EXPECT_TRUE(side.takeStream().empty());
}

TEST(Handshake, WithAnotherVersionFails) {
  Side side;
  side.feed(asBytes(std::string_view("vrpn: ver. 08.00  0\0\0\0\0\0 more", 29)));
  EXPECT_TRUE(side.endpoint.failed());
  EXPECT_THAT(side.seen, ElementsAre(StartsWith("error: peer opened with \"vrpn: ver. 08.00")));
  EXPECT_EQ(side.takeStream().size(), kCookieBytes) << "no descriptions for a stranger";
  side.feed(encodeCookie(0));
  EXPECT_EQ(side.seen.size(), 1U) << "no event follows an error";
}

TEST(Messages, ArriveWithTheirNamesAndTime) {
  Side server;
  Side client;
  server.names.addSender("Spare");
  server.names.addSender("Phantom");
  client.names.addSender("Phantom");
  exchange(server, client);
  server.seen.clear();
  EXPECT_TRUE(client.endpoint.send(kNow, LocalSender{0}, SetVertex{1, 2, {3, 4, 5}}));
  EXPECT_TRUE(client.endpoint.send(kNow, LocalSender{0}, Message(StopEffect{7})));
  exchange(server, client);
  EXPECT_THAT(server.seen, ElementsAre("message vrpn_ForceDevice setVertex from Phantom kind " +
                                           std::to_string(static_cast<int>(kindOf<SetVertex>)) + " local 1",
                                       HasSubstr("stopEffect")));
  EXPECT_EQ(server.last->as<StopEffect>()->index, 7);
}

TEST(Messages, OfLaterNamesFollowTheirDescription) {
  Side server;
  Side client;
  exchange(server, client);
  const LocalSender late = server.names.addSender("Late");
  const LocalType own = server.names.addType("my own type");
  EXPECT_TRUE(server.endpoint.sendRaw(kNow, late, own, asBytes("hello"), Reliability::kReliable));
  exchange(server, client);
  EXPECT_THAT(client.seen, ElementsAre("connected 07.38 log 0", "sender 0 \"Late\"",
                                       "message my own type from Late kind 255 local -1"));
  client.names.addSender("Late");
  server.endpoint.send(kNow, late, Pong{});
  exchange(server, client);
  EXPECT_THAT(client.seen.back(), HasSubstr("local 0")) << "a sender of ours that came after the peer's";
}

TEST(Messages, LowLatencyOnesGoByDatagramOnceThereIsALink) {
  Side server({UdpAddress{"10.0.0.1", 5001}, {}});
  Side client({UdpAddress{"10.0.0.2", 5002}, {}});
  const LocalSender device = server.names.addSender("Phantom");
  exchange(server, client);
  server.endpoint.send(kNow, device, Dop{1});
  EXPECT_EQ(server.takeStream().size(), 32U);
  EXPECT_TRUE(server.takeDatagrams().empty());

  server.endpoint.useDatagrams();
  server.endpoint.send(kNow, device, Dop{2});
  server.endpoint.send(kNow, device, ButtonChange{0, 1});
  server.endpoint.send(kNow, device, Dop{0}, Reliability::kReliable);
  const Bytes stream = server.takeStream();
  EXPECT_EQ(stream.size(), 64U);
  const std::vector<Bytes> datagrams = server.takeDatagrams();
  ASSERT_EQ(datagrams.size(), 1U);
  EXPECT_EQ(loadHeader(datagrams[0].data()).sequence, 0U) << "datagrams count for themselves";
  EXPECT_EQ(loadHeader(stream.data()).sequence + 1, loadHeader(stream.data() + 32).sequence);
  EXPECT_TRUE(server.takeDatagrams().empty());

  client.feedDatagram(datagrams[0]);
  EXPECT_EQ(client.last->as<Dop>()->depth, 2);
}

TEST(Messages, TooBigForADatagramGoByTcp) {
  Side server;
  Side client;
  const LocalSender device = server.names.addSender("Phantom");
  exchange(server, client);
  server.endpoint.useDatagrams();
  server.endpoint.send(kNow, device, AnalogChannels{{std::vector<double>(128)}});
  server.endpoint.send(kNow, device, CustomEffect{0, {std::vector<float>(400)}}, Reliability::kLowLatency);
  EXPECT_EQ(server.takeStream().size(), kHeaderBytes + 8 + 1600);
  const auto datagrams = server.takeDatagrams();
  ASSERT_EQ(datagrams.size(), 1U);
  EXPECT_EQ(datagrams[0].size(), kHeaderBytes + 8 + 1024);
}

TEST(Messages, EncodedOnceServeEveryClient) {
  LocalNames names;
  const LocalSender device = names.addSender("Phantom");
  Peer by_tcp(names);
  Peer by_udp(names, {UdpAddress{"127.0.0.1", 5000}, {}});
  Side first;
  Side second({UdpAddress{"127.0.0.1", 5001}, {}});
  for (auto [endpoint, client] : {std::pair{&by_tcp, &first}, std::pair{&by_udp, &second}}) {
    endpoint->feed(kNow, client->takeStream(), [](const Event&) {});
    Bytes bytes;
    endpoint->takeStream(bytes);
    client->feed(bytes);
  }
  by_udp.useDatagrams();

  FrameEncoder reports;
  reports.add(kNow, device, Force{{1, 2, 3}});
  reports.add(kNow, device, IsTouching{1});
  EXPECT_TRUE(by_tcp.sendFrames(kNow, reports.bytes(), Reliability::kLowLatency));
  EXPECT_TRUE(by_udp.sendFrames(kNow, reports.bytes(), Reliability::kLowLatency));

  Bytes stream;
  by_tcp.takeStream(stream);
  EXPECT_EQ(stream, Bytes(reports.bytes().begin(), reports.bytes().end()));
  first.feed(stream);
  by_udp.takeStream(stream);
  EXPECT_TRUE(stream.empty());
  by_udp.takeDatagrams([&](ByteView datagram) { second.feedDatagram(datagram); });
  for (const Side* client : {&first, &second}) {
    EXPECT_THAT(client->seen, Contains(HasSubstr("Force from Phantom")));
    EXPECT_EQ(client->last->as<IsTouching>()->touching, 1);
  }
}

TEST(Names, CountTheirMemory) {
  Side side;
  side.feed(encodeCookie(0));
  EXPECT_EQ(side.endpoint.namesBytes(), 0U);
  constexpr std::size_t kNameLength = 90;
  const auto describe = [&](std::int32_t id, std::size_t length) {
    FrameEncoder frames;
    frames.addRaw(kNow, id, kTypeDescription, encodeDescription(std::string(length, 'x')));
    frames.addRaw(kNow, id, kSenderDescription, encodeDescription(std::string(length, 'x')));
    side.feed(frames.bytes());
  };
  for (std::int32_t id = 0; id < kMaxNames; ++id) describe(id, kNameLength);
  const std::size_t all = side.endpoint.namesBytes();
  EXPECT_GE(all, 2 * std::size_t{kMaxNames} * (kNameLength + sizeof(std::string)));
  EXPECT_LE(all, 4 * std::size_t{kMaxNames} * (kNameLength + sizeof(std::string)));
  for (std::int32_t id = 0; id < kMaxNames; ++id) describe(id, kNameLength);
  EXPECT_EQ(side.endpoint.namesBytes(), all) << "they replace the others";
}

TEST(Messages, OfTypesOrSendersNotDescribedAreIgnored) {
  Stranger peer;
  peer.says(0, 5, {});
  peer.says(0, kTypeDescription, encodeDescription("vrpn_Base ping_message"));
  peer.says(3, 0, {});
  EXPECT_THAT(peer.side.seen, ElementsAre("ignored: message of a type that was not described 5",
                                          "ignored: message of a sender that was not described 3"));
  EXPECT_FALSE(peer.side.endpoint.failed());
}

TEST(Descriptions, OfUnknownNamesAreKeptAndNotAnnouncedBack) {
  Stranger peer;
  peer.side.takeStream();
  peer.says(7, kTypeDescription, encodeDescription("somebody's own type"));
  peer.says(1, kSenderDescription, encodeDescription(std::string(95, 'n')));
  peer.says(1, 7, asBytes("payload"));
  EXPECT_EQ(peer.side.types_described, 1U);
  EXPECT_THAT(peer.side.seen.back(), StartsWith("message somebody's own type from nnnn"));
  EXPECT_TRUE(peer.side.takeStream().empty());
}

TEST(Descriptions, SaidAgainReplaceTheName) {
  Stranger peer;
  peer.says(0, kSenderDescription, encodeDescription("A"));
  peer.says(0, kTypeDescription, encodeDescription("vrpn_Base ping_message"));
  peer.says(0, kTypeDescription, encodeDescription("vrpn_Base pong_message"));
  peer.says(0, 0, {});
  EXPECT_THAT(peer.side.seen.back(), StartsWith("message vrpn_Base pong_message"));
}

TEST(Descriptions, BeyondTheLimitsEndTheConnection) {
  for (const std::int32_t type : {kSenderDescription, kTypeDescription}) {
    for (const std::int32_t number : {-1, 2000, 0x7fffffff}) {
      Stranger peer;
      peer.says(number, type, encodeDescription("name"));
      EXPECT_THAT(peer.side.seen, ElementsAre("error: description of number " + std::to_string(number) +
                                              ", expected 0 to 1999"));
      EXPECT_TRUE(peer.side.endpoint.failed());
    }
    Stranger peer;
    peer.says(1999, type, encodeDescription("name"));
    EXPECT_FALSE(peer.side.endpoint.failed());
    peer.says(1998, type, encodeDescription(std::string(96, 'n')));
    EXPECT_EQ(peer.side.seen.back(), "error: description of 101 bytes, expected 5 to 100");
  }
}

TEST(Descriptions, WhoseLengthLiesEndTheConnection) {
  for (const std::int32_t length : {-1, 0, 6, 0x7fffffff}) {
    Bytes payload = encodeDescription("name");
    storeBig(payload.data(), length);
    Stranger peer;
    peer.says(0, kSenderDescription, payload);
    EXPECT_EQ(peer.side.seen.back(),
              "error: description says its name has " + std::to_string(length) + " bytes, it has 5");
  }
  Stranger peer;
  peer.says(0, kSenderDescription, Bytes(4));
  EXPECT_TRUE(peer.side.endpoint.failed());
}

TEST(SystemMessages, UnknownOnesAreIgnoredDownToALimit) {
  Stranger peer;
  peer.says(0, -5, {});
  peer.says(0, -1999, Bytes(10));
  EXPECT_THAT(peer.side.seen,
              ElementsAre("ignored: unknown system message -5", "ignored: unknown system message -1999"));
  peer.says(0, -2000, {});
  EXPECT_EQ(peer.side.seen.back(), "error: message of type -2000, the lowest is -1999");
  EXPECT_TRUE(peer.side.endpoint.failed());
  EXPECT_FALSE(peer.side.endpoint.send(kNow, LocalSender{0}, Pong{}));
}

TEST(SystemMessages, UdpDescriptionsAreIgnoredOnTcpOnlyConnections) {
  Stranger peer;
  peer.says(5000, kUdpDescription, encodeUdpDescription({"127.0.0.1", 5000}));
  EXPECT_THAT(peer.side.seen, ElementsAre("ignored: UDP description on a TCP-only connection 5000"));
}

TEST(SystemMessages, BadUdpAndLogDescriptionsEndTheConnection) {
  const PeerOptions udp{UdpAddress{"127.0.0.1", 4000}, {}};
  for (const std::int32_t port : {0, -1, 65536}) {
    Stranger peer(udp);
    peer.says(port, kUdpDescription, encodeUdpDescription({"127.0.0.1", 1}));
    EXPECT_EQ(peer.side.seen.back(),
              "error: UDP description: port " + std::to_string(port) + " is not 1 to 65535");
  }
  Stranger host(udp);
  host.says(5000, kUdpDescription, encodeUdpDescription({"evil host", 1}));
  EXPECT_THAT(host.side.seen.back(), StartsWith("error: UDP description: host \"evil host\""));

  Bytes log = encodeLogDescription({1, "in", "out"});
  Stranger good;
  good.says(1, kLogDescription, log);
  EXPECT_EQ(good.side.seen.back(), "log 1 \"in\" \"out\"");
  storeBig<std::int32_t>(log.data(), 4);
  Stranger bad;
  bad.says(1, kLogDescription, log);
  EXPECT_EQ(bad.side.seen.back(), "error: log description of 15 bytes cannot hold names of 4 and 3");
}

TEST(Frames, OfImpossibleLengthEndTheConnectionBeforeAnythingIsStored) {
  Stranger peer;
  Bytes header(4);
  storeBig<std::uint32_t>(header.data(), 0x40000000);
  peer.side.feed(header);
  EXPECT_THAT(peer.side.seen, ElementsAre("error: frame length 1073741824 is outside 24 to 64024"));
}

TEST(Datagrams, ThatAreDamagedOrForgedEndNothing) {
  Stranger peer;
  peer.says(0, kSenderDescription, encodeDescription("A"));
  peer.says(0, kTypeDescription, encodeDescription("vrpn_ForceDevice Effect"));
  peer.side.seen.clear();
  FrameEncoder encoder;
  encoder.addRaw(kNow, 0, 0, Bytes(104));
  encoder.addRaw(kNow, 1, kTypeDescription, encodeDescription("forged"));
  encoder.addRaw(kNow, 0, 0, Bytes(104));
  peer.side.feedDatagram(encoder.bytes().first(encoder.bytes().size() - 1));
  EXPECT_THAT(peer.side.seen, ElementsAre(StartsWith("message vrpn_ForceDevice Effect from A"),
                                          "ignored: system message in a datagram -2",
                                          "ignored: damaged datagram, bytes left 127"));
  EXPECT_FALSE(peer.side.endpoint.failed());

  Side early;
  early.feedDatagram(encoder.bytes());
  EXPECT_THAT(early.seen, ElementsAre(StartsWith("ignored: datagram outside a connection")));
}

TEST(LocalNameTables, KeepNumbersAndLimits) {
  LocalNames names;
  EXPECT_EQ(names.addSender("A"), names.addSender("A"));
  EXPECT_EQ(names.addType("vrpn_ForceDevice setVertex"), kLocalType<SetVertex>);
  EXPECT_EQ(names.findSender("A"), LocalSender{0});
  EXPECT_EQ(names.findSender("B"), std::nullopt);
  EXPECT_THROW(names.addSender(""), std::invalid_argument);
  EXPECT_THROW(names.addSender(std::string(96, 'x')), std::invalid_argument);
  EXPECT_THROW(names.addSender(std::string_view("a\0b", 3)), std::invalid_argument);
  for (int i = 1; i < kMaxNames; ++i) names.addSender("sender " + std::to_string(i));
  EXPECT_THROW(names.addSender("one more"), std::length_error);
  EXPECT_EQ(names.addSender("A"), LocalSender{0}) << "known names still have their number";
}

}  // namespace
}  // namespace hapticd::wire
