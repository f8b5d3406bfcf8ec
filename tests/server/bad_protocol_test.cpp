// Peers that violate the protocol or abuse it.
#include <ifaddrs.h>
#include <netinet/in.h>

#include <filesystem>

#include "bad_input.h"
#include "wire/cookie.h"
#include "wire/frame_encoder.h"
#include "wire/system.h"

namespace hapticd::test {
namespace {

using wire::ByteView;
using Bytes = std::vector<std::byte>;

class BadProtocol : public BadInput {
 protected:
  using Speech = ScriptedPeer::Speech;

  // A peer that sends only these bytes.
  std::unique_ptr<ScriptedPeer> sendBytes(ByteView bytes) {
    auto peer =
        std::make_unique<ScriptedPeer>(server_.address(), "Phantom", ScriptedPeer::Mode::tcp, Speech::raw);
    peer->sendBytes(bytes);
    return peer;
  }
  std::unique_ptr<ScriptedPeer> sendBytes(std::string_view text) {
    return sendBytes(std::as_bytes(std::span(text)));
  }
  // Whether a peer that sends these bytes is disconnected, with this reason in the log.
  testing::AssertionResult isClosed(std::string_view text, const std::string& reason) {
    const auto peer = sendBytes(text);
    if (!peer->untilClosed()) return testing::AssertionFailure() << "not closed";
    if (!untilLogged(reason))
      return testing::AssertionFailure() << "no '" << reason << "' in\n" << log_.text();
    return testing::AssertionSuccess();
  }
  // A datagram to the port for connection requests.
  void request(const std::string& text) {
    net::Loop loop;
    net::UdpSocket socket(loop, {net::kLoopbackAddress, 0});
    socket.sendTo(std::as_bytes(std::span(text.c_str(), text.size() + 1)), server_.address());
  }
};

std::string cookie(std::string_view version, char log = '0') {
  std::string text = "vrpn: ver. " + std::string(version) + "  " + log;
  text.resize(wire::kCookieBytes, '\0');
  return text;
}

// --- lengths

template <class M>
void wrongLengths(std::vector<std::pair<wire::MessageKind, std::size_t>>& cases) {
  if (M::kInfo.direction == wire::Direction::kToClient) return;
  if (wire::kPayloadSize < M >> 0) cases.emplace_back(wire::kindOf<M>, wire::kPayloadSize<M> - 1);
  if (!wire::kIsCounted<M>) cases.emplace_back(wire::kindOf<M>, wire::kPayloadSize<M> + 1);
}

auto allWrongLengths() {
  std::vector<std::pair<wire::MessageKind, std::size_t>> cases;
  wire::forEachMessage(wire::AllMessages{}, [&]<class M>() { wrongLengths<M>(cases); });
  return cases;
}

TEST_F(BadProtocol, AWrongLengthEndsTheConnectionAndIsLogged) {
  const auto cases = allWrongLengths();
  ASSERT_GT(cases.size(), 100U);
  for (const auto& [kind, size] : cases) {
    const std::string name(wire::info(kind).name);
    ScriptedPeer peer(server_.address());
    ASSERT_TRUE(peer.untilConnected());
    peer.sendPayload(kind, Bytes(size));
    ASSERT_TRUE(peer.untilClosed()) << name << " of " << size << " bytes";
    ASSERT_TRUE(untilLogged("malformed message: " + name + ": payload of " + std::to_string(size)))
        << log_.text();
  }
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, ACountThatDoesNotFitEndsTheConnection) {
  for (const std::uint32_t count : {2U, 0x7FFFFFFFU, 0xFFFFFFFFU}) {
    ScriptedPeer peer(server_.address());
    ASSERT_TRUE(peer.untilConnected());
    Bytes payload(12);  // effect 0, and space for one parameter
    wire::storeBig(payload.data() + 4, count);
    peer.sendPayload(wire::kindOf<wire::CustomEffect>, payload);
    ASSERT_TRUE(peer.untilClosed()) << count;
  }
  EXPECT_TRUE(untilLogged("malformed message: vrpn_ForceDevice Custom Effect: parameters"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, AnInvalidFrameEndsTheConnection) {
  for (const std::uint32_t length : {0U, 23U, 65'000U, 0xFFFFFFFFU}) {
    ScriptedPeer peer(server_.address());
    ASSERT_TRUE(peer.untilConnected());
    Bytes frame(wire::kHeaderBytes);
    wire::storeBig(frame.data(), length);
    peer.sendBytes(frame);
    ASSERT_TRUE(peer.untilClosed()) << length;
    EXPECT_TRUE(untilLogged(std::to_string(length))) << log_.text();
  }
  EXPECT_TRUE(isIntact());
}

// --- names

TEST_F(BadProtocol, NamesWithoutANulEndAtTheirField) {
  wire::SetHapticProperty property{0, {}, 1};
  property.property.bytes.fill('x');
  bad_.send(property);
  EXPECT_TRUE(gotText("setHapticProperty object 0, 'xxxxxxxxxxxxxxxxxxxx': unknown property"));
  wire::Effect effect;
  effect.type.bytes.fill('y');
  bad_.send(effect);
  EXPECT_TRUE(gotText("setEffect 0, 'yyyyyyyyyyyyyyyyyyyy': refused: unknown type"));
  Bytes text(1032, std::byte{'z'});
  std::fill_n(text.begin(), 8, std::byte{0});
  bad_.sendPayload(wire::kindOf<wire::Text>, text);
  EXPECT_TRUE(untilLogged("sent the text \"" + std::string(60, 'z')));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, ADescriptionWithoutANulEndsAtItsField) {
  wire::FrameEncoder frames;
  frames.append(wire::encodeCookie(0));
  Bytes payload = wire::encodeDescription("PhantomX");
  payload.pop_back();
  wire::storeBig(payload.data(), std::int32_t{8});
  frames.addRaw({}, 0, wire::kSenderDescription, payload);
  const auto peer = sendBytes(frames.bytes());
  EXPECT_TRUE(peer->untilNext<wire::IsTouching>()) << "the length includes the missing NUL";
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, BytesAfterTheNulOfANameAreIgnored) {
  wire::SetHapticProperty property{0, {}, 1};
  std::ranges::copy(std::string_view("stiffness\0damping\xff\xff!", 20), property.property.bytes.begin());
  good_.send(property);
  ASSERT_TRUE(untilApplied(good_));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, DescriptionsWithAWrongLengthEndTheConnection) {
  for (const std::int32_t length : {-1, 0, 50, 0x7FFFFFFF}) {
    wire::FrameEncoder frames;
    frames.append(wire::encodeCookie(0));
    Bytes payload = wire::encodeDescription("Phantom");
    wire::storeBig(payload.data(), length);
    frames.addRaw({}, 0, wire::kSenderDescription, payload);
    EXPECT_TRUE(sendBytes(frames.bytes())->untilClosed()) << length;
  }
  EXPECT_TRUE(untilLogged("description says its name has 50 bytes, it has 8"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, TwoThousandSendersAndTypesAreAcceptedAndOneMoreIsNot) {
  wire::FrameEncoder frames;
  frames.append(wire::encodeCookie(0));
  for (std::int32_t id = 0; id < 1999; ++id) {
    const Bytes name = wire::encodeDescription("name " + std::to_string(id));
    frames.addRaw({}, id, wire::kSenderDescription, name);
    frames.addRaw({}, id, wire::kTypeDescription, name);
  }
  frames.addRaw({}, 1999, wire::kSenderDescription, wire::encodeDescription("Phantom"));
  frames.addRaw({}, 1999, wire::kTypeDescription, wire::encodeDescription(wire::Ping::kInfo.name));
  frames.addRaw({}, 1999, 1999, {});
  const auto peer = sendBytes(frames.bytes());
  EXPECT_TRUE(peer->untilNext<wire::Pong>());

  frames.clear();
  frames.addRaw({}, 2000, wire::kTypeDescription, wire::encodeDescription("one too many"));
  peer->sendBytes(frames.bytes());
  EXPECT_TRUE(peer->untilClosed());
  EXPECT_TRUE(untilLogged("description of number 2000, expected 0 to 1999"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, MessagesOfUndescribedSendersAndTypesAreIgnored) {
  wire::FrameEncoder frames;
  for (const std::int32_t number : {1999, 2000, 0x7FFFFFFF, -1999}) {
    frames.addRaw({}, 1, number, Bytes(20));
    frames.addRaw({}, number, wire::kLocalType<wire::ResetScene>.value, Bytes(1));
  }
  bad_.sendBytes(frames.bytes());
  bad_.send(wire::Ping{});
  EXPECT_TRUE(bad_.untilNext<wire::Pong>());
  EXPECT_TRUE(isIntact());
}

// --- greetings

TEST_F(BadProtocol, OtherMinorVersionsAreAccepted) {
  for (const char* version : {"07.30", "07.34", "07.99"}) {
    EXPECT_TRUE(sendBytes(cookie(version))->untilConnected()) << version;
    EXPECT_TRUE(untilLogged(std::string("speaks VRPN ") + version));
  }
}

TEST_F(BadProtocol, OtherMajorVersionsAndGarbageCloseTheConnectionWithTheReason) {
  EXPECT_TRUE(isClosed(cookie("08.00"), "opened with \"vrpn: ver. 08.00"));
  EXPECT_TRUE(isClosed(cookie("06.38"), "opened with \"vrpn: ver. 06.38"));
  EXPECT_TRUE(isClosed(cookie("07.38", '7'), "log mode \"7\" is not 0 to 3"));
  EXPECT_TRUE(isClosed("GET / HTTP/1.1\r\nHost: haptics\r\n\r\n", "opened with \"GET / HTTP/1.1"));
  EXPECT_TRUE(isClosed(std::string(5000, '\xff'), "opened with \"\\xff"));
  EXPECT_TRUE(isClosed(std::string(24, '\0'), "opened with \"\\x00"));
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, APartialGreetingWaitsForTheRest) {
  const std::string whole = cookie("07.38");
  const auto slow = sendBytes(std::string_view(whole).substr(0, 11));
  const auto silent = sendBytes("");
  EXPECT_TRUE(isIntact());
  EXPECT_TRUE(slow->open());
  const std::string_view rest = std::string_view(whole).substr(11);
  slow->sendBytes(std::as_bytes(std::span(rest)));
  EXPECT_TRUE(slow->untilConnected());
  EXPECT_TRUE(untilLogged("speaks VRPN 07.38"));
  EXPECT_TRUE(silent->open());
}

// --- requests that the server must refuse

TEST_F(BadProtocol, LogFilesAreRefused) {
  const auto file = std::filesystem::temp_directory_path() / "hapticd_must_not_be_written";
  std::filesystem::remove(file);
  wire::FrameEncoder frames;
  frames.append(wire::encodeCookie(3));
  frames.addRaw({}, 3, wire::kLogDescription, wire::encodeLogDescription({3, file.string(), file.string()}));
  const auto peer = sendBytes(frames.bytes());
  EXPECT_TRUE(peer->untilText("log files on the server are refused"));
  EXPECT_TRUE(untilLogged("requested log files \"" + file.string()));
  EXPECT_FALSE(std::filesystem::exists(file));
  EXPECT_TRUE(peer->open());
  wire::FrameEncoder description;
  description.addRaw({}, 0, wire::kSenderDescription, wire::encodeDescription("Phantom"));
  peer->sendBytes(description.bytes());
  EXPECT_TRUE(peer->until([&] { return peer->texts().size() >= 2; }))
      << "the text of the device, which a stock client prints";
  EXPECT_TRUE(isIntact());
}

// The client is notified of the reason, too.
TEST_F(BadProtocol, AMalformedMessageIsAnsweredWithATextBeforeTheEnd) {
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  peer.sendPayload(wire::kindOf<wire::SetVertex>, Bytes(3));
  EXPECT_TRUE(peer.untilText("payload of 3 bytes"));
  EXPECT_TRUE(peer.untilClosed());
  ScriptedPeer torn(server_.address());
  ASSERT_TRUE(torn.untilConnected());
  torn.sendBytes(Bytes(64, std::byte{0xFF}));
  EXPECT_TRUE(torn.untilText("; the connection ends"));
  EXPECT_TRUE(torn.untilClosed());
}

TEST_F(BadProtocol, ReverseConnectionsToPortsBelow1024AreRefused) {
  for (const char* port : {"80", "0", "1023", "-5", "99999"}) {
    request(std::string("127.0.0.1 ") + port);
    EXPECT_TRUE(untilLogged("port \"" + std::string(port) + "\" is not 1024 to 65535")) << log_.text();
  }
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, MalformedRequestsAreRefused) {
  request("");
  request("hello");
  request("127.0.0.1;reboot 4000");
  EXPECT_TRUE(untilLogged("host \"127.0.0.1;reboot\" is not letters, digits and dots")) << log_.text();
  request("999.0.0.1 4000");
  EXPECT_TRUE(untilLogged(" refused: ")) << log_.text();
  request(std::string(1400, 'a') + " 4000");
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, ReverseConnectionsToAnotherHostAreRefusedWithTheRemedy) {
  request("192.0.2.1 4000");
  EXPECT_TRUE(untilLogged("names another host, 192.0.2.1:4000: refused; allow it with callback_hosts"));
  EXPECT_EQ(log_.count("reverse connection to"), 0U);
  EXPECT_TRUE(isIntact());
}

TEST_F(BadProtocol, ReverseConnectionsOnThisMachineMayUseAnotherLoopbackAddress) {
  net::Loop loop;
  bool called = false;
  const net::TcpListener listener(loop, net::Endpoint::parse("127.0.0.2", 0),
                                  [&](net::Connection) { called = true; });
  request("127.0.0.2 " + std::to_string(listener.local().port));
  for (int i = 0; i < 1000 && !called; ++i) loop.runOnce(20ms);
  EXPECT_TRUE(called);
}

// An address of this machine that is not loopback; empty if there is none.
std::string ownAddress() {
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) return {};
  std::string found;
  for (const ifaddrs* one = all; one != nullptr && found.empty(); one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    sockaddr_in address{};
    std::memcpy(&address, one->ifa_addr, sizeof address);
    const net::Endpoint endpoint{ntohl(address.sin_addr.s_addr), 0};
    if (endpoint.address >> 24 != 127) found = endpoint.addressText();
  }
  ::freeifaddrs(all);
  return found;
}

TEST(CallbackHosts, AListedHostGetsAReverseConnectionRequestedByAnotherHost) {
  const std::string host = ownAddress();
  if (host.empty()) GTEST_SKIP() << "this machine has no address but loopback";
  server::ServerConfig config = RunningServer::anyPort();
  for (const bool listed : {false, true}) {
    LogLines log;
    if (listed) config.callbackHosts = {"192.0.2.7", host};
    RunningServer server(config);
    net::Loop loop;
    bool called = false;
    const net::TcpListener listener(loop, net::Endpoint::parse(host, 0),
                                    [&](net::Connection) { called = true; });
    net::UdpSocket socket(loop, {net::kLoopbackAddress, 0});
    const std::string text = wire::formatUdpRequest({host, listener.local().port});
    socket.sendTo(std::as_bytes(std::span(text)), server.address());
    const auto refused = [&] { return log.count("names another host, " + host) > 0; };
    for (int i = 0; i < 1000 && !called && !refused(); ++i) loop.runOnce(20ms);
    EXPECT_EQ(called, listed);
    EXPECT_EQ(refused(), !listed);
  }
}

}  // namespace
}  // namespace hapticd::test
