// Device programs written for VRPN's server classes, served by this library.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>
#include <vrpn_Connection.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "client/client_tests.h"
#include "client/vrpn_both_sides.h"
#include "client/vrpn_device.h"
#include "net/loopback.h"
#include "server/scripted_peer.h"
#include "wire/cookie.h"

namespace hapticd {
namespace {

using test::kPatience;
using test::ScriptedPeer;
using test::ServedConnection;

// A device program on a port that the system chose, in this thread.
class VrpnServer : public ::testing::Test {
 protected:
  net::Endpoint address() const {
    return {net::kLoopbackAddress, static_cast<std::uint16_t>(connection_->servedPort())};
  }
  template <class Condition>
  bool runUntil(ScriptedPeer& peer, Condition&& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      if (std::chrono::steady_clock::now() > end) return false;
      program_->mainloop();
      peer.poll();
      vrpn_SleepMsecs(0.2);
    }
    return true;
  }

  ServedConnection connection_{vrpn_create_server_connection(0, nullptr, nullptr, "127.0.0.1")};
  std::unique_ptr<DeviceProgram> program_ = std::make_unique<DeviceProgram>(connection_.get());
};

std::vector<std::byte> contentsOf(const std::string& file) {
  std::ifstream in(HAPTICD_TESTDATA "/vrpn_server/" + file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto* bytes = reinterpret_cast<const std::byte*>(text.data());
  return {bytes, bytes + text.size()};
}

// What was said, by kind: texts up to their NUL, behind which is garbage; other payloads in hexadecimal
// digits.
using Said = std::map<std::string, std::vector<std::string>>;
void add(Said& said, wire::MessageKind kind, wire::ByteView payload) {
  std::string digits;
  for (const std::byte byte : payload) {
    for (const int shift : {4, 0}) digits += "0123456789abcdef"[std::to_integer<int>(byte) >> shift & 15];
  }
  said[std::string(wire::info(kind).name)].push_back(digits);
}
void add(Said& said, const wire::Text& text) {
  said[std::string(wire::Text::kInfo.name)].push_back(std::to_string(text.severity) + ' ' +
                                                      std::to_string(text.level) + ' ' + text.text.text);
}

// A client of VRPN 07.38 uses everything that the device offers. The answers are those of the same program
// linked with VRPN.
TEST_F(VrpnServer, AnswersARecordedClientAsVrpnDoes) {
  Said expected;
  std::size_t count = 0;
  {
    wire::LocalNames names;
    names.addSender("Device0");
    wire::Peer reader(names);
    reader.feed({}, contentsOf("server.bin"), [&](const wire::Event& event) {
      const auto* message = std::get_if<wire::MessageReceived>(&event);
      if (message == nullptr || message->local_sender.value != 0) return;
      ++count;
      if (message->kind == wire::kindOf<wire::Text>) {
        add(expected, *wire::decode<wire::Text>(message->payload));
      } else {
        add(expected, message->kind, message->payload);
      }
    });
  }
  ASSERT_GE(count, 60U);
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
  client.sendBytes(contentsOf("client.bin"));
  const auto received = [&] { return client.messages().size() + client.texts().size(); };
  EXPECT_TRUE(runUntil(client, [&] { return received() >= count; })) << received() << " of " << count;
  Said answered;
  for (const auto& message : client.messages()) {
    if (message.kind != wire::kindOf<wire::Text>) add(answered, message.kind, message.payload);
  }
  for (const wire::Text& text : client.texts()) add(answered, text);
  // VRPN's handler passes stiffness, dynamic friction, static friction and damping in this order, although
  // the function declares stiffness, damping, dynamic friction and static friction. Ours passes them as
  // declared.
  auto& texts = answered[std::string(wire::Text::kInfo.name)];
  const auto declared =
      std::find(texts.begin(), texts.end(), "0 0 updateTrimeshChanges 1 0.5 0.25 0.125 0.75");
  ASSERT_NE(declared, texts.end());
  *declared = "0 0 updateTrimeshChanges 1 0.5 0.125 0.75 0.25";
  for (const auto& [kind, messages] : expected) EXPECT_EQ(answered[kind], messages) << kind;
  EXPECT_EQ(answered.size(), expected.size());
}

TEST_F(VrpnServer, SendsLowLatencyReportsByDatagram) {
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ButtonStates>() > 0; }));
  client.send(wire::Ping{});
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Pong>() > 0; }));
  client.send(wire::TrackerResetOrigin{});
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ForceError>() > 0; }));
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Force>() > 0; }));
  EXPECT_GT(client.datagrams(), 0U);
  EXPECT_EQ(client.all<wire::TrackerVelocity>().at(0).interval, 0.25);
  for (const auto& message : client.messages()) {
    EXPECT_FALSE(message.kind == wire::kindOf<wire::ButtonChange> && message.byDatagram);
  }
}

TEST_F(VrpnServer, SendsByTcpToAClientThatDescribesAnotherMachinesUdpPort) {
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ButtonStates>() > 0; }));
  const auto askForForce = [&] {
    client.forget();
    client.send(wire::TrackerResetOrigin{});
    return runUntil(client, [&] { return client.count<wire::Force>() > 0; });
  };
  const auto byDatagram = [&] {
    const auto& all = client.messages();
    return std::find_if(all.begin(), all.end(),
                        [](const auto& message) { return message.kind == wire::kindOf<wire::Force>; })
        ->byDatagram;
  };
  ASSERT_TRUE(askForForce());
  EXPECT_TRUE(byDatagram());
  wire::FrameEncoder description;
  description.addRaw({1, 2}, 9, wire::kUdpDescription, wire::encodeUdpDescription({"127.0.0.99", 9}));
  client.sendBytes(description.bytes());
  ASSERT_TRUE(askForForce());
  EXPECT_FALSE(byDatagram());
}

// Each reset is answered by one error of the force device.
TEST_F(VrpnServer, ADatagramOfAnotherMachineIsIgnored) {
  ScriptedPeer client(address(), "Device0", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ButtonStates>() > 0; }));
  client.send(wire::Ping{});  // by TCP, behind the names
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Pong>() > 0; }));
  wire::FrameEncoder reset;
  reset.addRaw({1, 2}, 1, wire::kLocalType<wire::TrackerResetOrigin>.value, {});
  auto stranger = net::RawSocket::connectedFrom(2, client.udpPeer(), SOCK_DGRAM);
  ASSERT_TRUE(stranger.send({reinterpret_cast<const char*>(reset.bytes().data()), reset.bytes().size()}));
  client.sendDatagram(reset.bytes());
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::ForceError>() > 0; }));
  client.send(wire::Ping{});
  ASSERT_TRUE(runUntil(client, [&] { return client.count<wire::Pong>() > 1; }));
  EXPECT_EQ(client.count<wire::ForceError>(), 1U);
}

// The table of names is one for all clients, and has room for 2000.
TEST_F(VrpnServer, AClientThatDescribesVeryManyTypesHarmsNobody) {
  ScriptedPeer greedy(address(), "Device0");
  ScriptedPeer other(address(), "Device0");
  ASSERT_TRUE(runUntil(greedy, [&] { return greedy.count<wire::ButtonStates>() > 0; }));
  ASSERT_TRUE(runUntil(other, [&] { return other.count<wire::ButtonStates>() > 0; }));
  for (int i = 0; i < 1500; ++i) greedy.sendForeign("type " + std::to_string(i), {});
  greedy.send(wire::Ping{});
  ASSERT_TRUE(runUntil(greedy, [&] { return greedy.count<wire::Pong>() > 0; }));
  for (int i = 0; i < 1500; ++i) other.sendForeign("another type " + std::to_string(i), {});
  other.send(wire::Ping{});
  EXPECT_TRUE(runUntil(other, [&] { return other.count<wire::Pong>() > 0; }));
  EXPECT_TRUE(other.open()) << other.closeReason();
  EXPECT_GE(connection_->register_message_type("a type of the program"), 0);
}

TEST_F(VrpnServer, ReportsConnectionsToItsHandlers) {
  struct Seen {
    int firsts = 0, connections = 0, drops = 0, lasts = 0;
    static int VRPN_CALLBACK count(void* number, vrpn_HANDLERPARAM) {
      ++*static_cast<int*>(number);
      return 0;
    }
  } seen;
  const auto on = [&](const char* type, int* number) {
    connection_->register_handler(connection_->register_message_type(type), Seen::count, number);
  };
  on(vrpn_got_first_connection, &seen.firsts);
  on(vrpn_got_connection, &seen.connections);
  on(vrpn_dropped_connection, &seen.drops);
  on(vrpn_dropped_last_connection, &seen.lasts);
  auto one = std::make_unique<ScriptedPeer>(address(), "Device0");
  auto two = std::make_unique<ScriptedPeer>(address(), "Device0");
  ASSERT_TRUE(runUntil(*one, [&] {
    two->poll();
    return seen.connections == 2;
  }));
  EXPECT_EQ(seen.firsts, 1);
  EXPECT_TRUE(connection_->connected());
  one.reset();
  ASSERT_TRUE(runUntil(*two, [&] { return seen.drops == 1; }));
  EXPECT_EQ(seen.lasts, 0);
  two->close();
  ASSERT_TRUE(runUntil(*two, [&] { return seen.drops == 2; }));
  EXPECT_EQ(seen.lasts, 1);
  EXPECT_FALSE(connection_->connected());
}

// Programs index arrays of vrpn_CONNECTION_MAX_TYPES by them.
TEST_F(VrpnServer, NumbersOfTypesAreBelowTheirLimit) {
  std::vector<vrpn_int32> types;
  connection_->register_handler(
      vrpn_ANY_TYPE,
      [](void* list, vrpn_HANDLERPARAM p) {
        static_cast<std::vector<vrpn_int32>*>(list)->push_back(p.type);
        return 0;
      },
      &types, connection_->register_sender(vrpn_CONTROL));
  ScriptedPeer client(address(), "Device0");
  ASSERT_TRUE(runUntil(client, [&] { return connection_->connected(); }));
  ASSERT_EQ(types.size(), 2U);
  EXPECT_STREQ(connection_->message_type_name(types[0]), vrpn_got_first_connection);
  EXPECT_STREQ(connection_->message_type_name(types[1]), vrpn_got_connection);
  for (const vrpn_int32 type : types) EXPECT_LT(type, vrpn_CONNECTION_MAX_TYPES);
  vrpn_int32 largest = 0;
  for (int i = 0; i < vrpn_CONNECTION_MAX_TYPES; ++i) {
    largest = std::max(largest, connection_->register_message_type(std::to_string(i).c_str()));
  }
  EXPECT_LT(largest, types[0]) << "no other type has the number";
}

TEST_F(VrpnServer, ADamagedStreamEndsOnlyItsConnection) {
  ScriptedPeer good(address(), "Device0");
  ScriptedPeer bad(address(), "Device0", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
  bad.sendBytes(std::vector<std::byte>(100, std::byte{0xff}));
  ASSERT_TRUE(runUntil(good, [&] {
    bad.poll();
    return !bad.open();
  }));
  ASSERT_TRUE(runUntil(good, [&] { return good.count<wire::ButtonStates>() > 0; }));
}

TEST_F(VrpnServer, AClientWhoseStreamIsDamagedIsReportedAsDropped) {
  int dropped = 0;
  connection_->register_handler(
      connection_->register_message_type(vrpn_dropped_last_connection),
      [](void* count, vrpn_HANDLERPARAM) { return ++*static_cast<int*>(count), 0; }, &dropped);
  ScriptedPeer bad(address(), "Device0", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
  const auto cookie = wire::encodeCookie(0);
  std::vector<std::byte> bytes(cookie.begin(), cookie.end());
  bytes.resize(bytes.size() + 100, std::byte{0xff});
  bad.sendBytes(bytes);
  ASSERT_TRUE(runUntil(bad, [&] { return !bad.open(); }));
  ASSERT_TRUE(runUntil(bad, [&] { return dropped == 1; }));
  EXPECT_FALSE(connection_->connected());
}

TEST_F(VrpnServer, APortThatIsTakenIsReported) {
  EXPECT_EQ(vrpn_create_server_connection(connection_->servedPort(), nullptr, nullptr, "127.0.0.1"), nullptr);
}

TEST_F(VrpnServer, APortIsServedByTheNameOfItsAddress) {
  const std::string name = "Device0@127.0.0.1:" + std::to_string(connection_->servedPort());
  EXPECT_EQ(vrpn_create_server_connection(name.c_str()), nullptr) << "it is taken";
  const int port = connection_->servedPort();
  program_.reset();
  connection_.reset();
  timeval before, opened, after;
  vrpn_gettimeofday(&before);
  connection_.reset(vrpn_create_server_connection(name.c_str()));
  ASSERT_TRUE(connection_);
  EXPECT_EQ(connection_->servedPort(), port);
  EXPECT_EQ(connection_->time_since_connection_open(&opened), 0);
  vrpn_gettimeofday(&after);
  EXPECT_GE(vrpn_TimevalMsecs(opened), 0);
  EXPECT_LE(vrpn_TimevalMsecs(opened), vrpn_TimevalMsecs(vrpn_TimevalDiff(after, before)));
  EXPECT_EQ(vrpn_create_server_connection(static_cast<const char*>(nullptr)), nullptr);
}

TEST_F(VrpnServer, ProgramsMayCreateTheirConnectionThemselves) {
  vrpn_Connection_IP connection(0, nullptr, nullptr, "127.0.0.1");
  EXPECT_TRUE(connection.doing_okay());
  EXPECT_NE(connection.servedPort(), 0);
  vrpn_Connection_IP second(static_cast<unsigned short>(connection.servedPort()), nullptr, nullptr,
                            "127.0.0.1");
  EXPECT_FALSE(second.doing_okay()) << "the port is taken";
  EXPECT_EQ(second.mainloop(), -1);
}

TEST_F(VrpnServer, AHandlerOfAMessageOfTheProgramItselfMayEndTheConnection) {
  const int port = connection_->servedPort();
  vrpn_Connection* connection = connection_.get();
  program_.reset();
  const vrpn_int32 type = connection->register_message_type("the end");
  connection->register_handler(
      type,
      [](void* reference, vrpn_HANDLERPARAM) {
        static_cast<ServedConnection*>(reference)->reset();
        return 0;
      },
      &connection_);
  connection->pack_message(0, {}, type, connection->register_sender("program"), nullptr,
                           vrpn_CONNECTION_RELIABLE);
  EXPECT_FALSE(connection->doing_okay());
  const ServedConnection again(vrpn_create_server_connection(port, nullptr, nullptr, "127.0.0.1"));
  EXPECT_TRUE(again) << "the port is free again";
}

}  // namespace
}  // namespace hapticd
