// Both sides of vrpn_room.h against what the same sides said when they were linked with VRPN 07.38.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <vrpn_Connection.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/vrpn_room.h"
#include "client/vrpn_stream.h"
#include "client/vrpn_values.h"
#include "net/loopback.h"

namespace hapticd {
namespace {

using net::RawSocket;
using test::VrpnMessage;
using test::VrpnStream;

constexpr auto kRoomPatience = std::chrono::seconds(30);

std::string roomRecording(const char* file) {
  return test::recording(std::string("vrpn_room/") + file);
}

// What VRPN does otherwise than it means: its library cuts eight characters off a text that arrives, its
// remote of the redundant transmission names another type, and its poser sends as a change of the pose the
// sum of all changes, which the server adds again.
std::vector<VrpnMessage> asMeant(std::vector<VrpnMessage> said) {
  std::string pose;
  for (VrpnMessage& s : said) {
    if (s.type == "vrpn_Poser Request Pos_Quat") pose = s.payload;
    if (s.type == "vrpn_Poser Request Relative Pos_Quat") s.payload = pose;  // the change is the same
    if (s.payload == "a text of the client, which i 0 there") {
      s.payload = "a text of the client, which is longer 0 there";
    } else if (s.payload == "another text that 0 there") {
      s.payload = "another text that is long 0 there";
    } else if (s.type == "VRPN_Connection_Got_First_Connection") {
      s.type = s.payload.size() == 2 ? "vrpn_Red_Xmit_Ctrl enable" : "vrpn_Red_Xmit_Ctrl set";
    }
  }
  return said;
}

std::string arrived(RawSocket& socket) {
  char bytes[4096];
  const ssize_t count = ::recv(socket.fd(), bytes, sizeof bytes, MSG_DONTWAIT);
  return {bytes, count > 0 ? static_cast<std::size_t>(count) : 0};
}

struct RemoveReference {
  void operator()(vrpn_Connection* connection) const { connection->removeReference(); }
};
using Held = std::unique_ptr<vrpn_Connection, RemoveReference>;

// VRPN's remote of a lock says who it is by its address and process, 8 bytes.
std::string identityIn(const std::vector<VrpnMessage>& said) {
  const auto request = std::find_if(said.begin(), said.end(),
                                    [](const auto& s) { return s.type == "vrpn_Mutex Request Index"; });
  return request != said.end() ? request->payload : "";
}

std::string replaced(std::string text, const std::string& what, const std::string& with) {
  for (std::size_t at = 0; !what.empty() && (at = text.find(what, at)) != std::string::npos;
       at += with.size())
    text.replace(at, what.size(), with);
  return text;
}

// Serves the room until the condition holds.
bool serveUntil(RoomServer& server, const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + kRoomPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    server.mainloop();
  }
  return true;
}

RawSocket connectedTo(const vrpn_Connection& served) {
  return RawSocket::connected({net::kLoopbackAddress, static_cast<std::uint16_t>(served.servedPort())});
}

TEST(VrpnRoom, ServerAnswersARecordedClientAsVrpnDoes) {
  VrpnStream expected;
  expected.feed(roomRecording("server.bin"));
  ASSERT_EQ(expected.steps(), kRoomSteps);
  VrpnStream expectedForwards;
  expectedForwards.feed(roomRecording("forwarded.bin"));
  ASSERT_EQ(expectedForwards.said().size(), 3U);
  // The recorded port may be taken here; the system chooses another for port 0.
  const std::string script =
      replaced(roomRecording("client.bin"), {"\0\0\x11\x94", 4}, std::string("\0\0\0\0", 4));
  VrpnStream scripted;
  scripted.feed(script);
  const std::size_t beforeLast = scripted.stepEnds().at(kRoomSteps - 1);

  const Held connection(vrpn_create_server_connection(0, nullptr, nullptr, "127.0.0.1"));
  ASSERT_TRUE(connection);
  RoomServer server(connection.get());
  RawSocket client = connectedTo(*connection);
  VrpnStream answers;
  const auto answered = [&](std::size_t steps) {
    return serveUntil(server, [&] {
      answers.feed(arrived(client));
      return answers.steps() >= steps;
    });
  };
  ASSERT_TRUE(client.send(script.substr(0, beforeLast)));
  ASSERT_TRUE(answered(kRoomSteps - 1));
  vrpn_Connection* const forwarding = server.forwarder().connectionAt(0);
  ASSERT_NE(forwarding, nullptr);
  RawSocket listener = connectedTo(*forwarding);
  VrpnStream forwarded;
  ASSERT_TRUE(listener.send(roomRecording("listener.bin")));
  ASSERT_TRUE(serveUntil(server, [&] { return forwarding->connected() != 0; }));
  ASSERT_TRUE(client.send(script.substr(beforeLast)));
  ASSERT_TRUE(answered(kRoomSteps));
  EXPECT_TRUE(serveUntil(server, [&] {
    forwarded.feed(arrived(listener));
    return forwarded.said().size() >= expectedForwards.said().size();
  }));
  expectSame(forwarded.said(), expectedForwards.said());

  std::vector<VrpnMessage> said = answers.said();
  // VRPN means to tell a new client the present values but registers for it under the wrong sender.
  ASSERT_GE(said.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(said[i].type, "vrpn_Shared update");
  said.erase(said.begin(), said.begin() + 3);
  expectSame(said, asMeant(expected.said()));
}

TEST(VrpnRoom, ClientSaysToARecordedServerWhatVrpnDoes) {
  const std::string script = roomRecording("server.bin");
  VrpnStream expected;
  expected.feed(roomRecording("client.bin"));
  const std::string recordedIdentity = identityIn(expected.said());
  ASSERT_EQ(recordedIdentity.size(), 8U);
  VrpnStream scripted;
  scripted.feed(script);
  const std::vector<std::size_t> ends = scripted.stepEnds();
  ASSERT_EQ(ends.size(), kRoomSteps + 1U);

  RawSocket listener;
  const net::Endpoint address = listener.bindToAnyPort();
  ASSERT_EQ(::listen(listener.fd(), 1), 0);
  VrpnStream heard;
  // Each step of the client is answered by the part of the recording that follows it.
  std::thread server([&] {
    RawSocket socket = RawSocket::accepted(listener);
    socket.send(std::string_view(script).substr(0, ends[0]));
    for (std::string bytes; !(bytes = socket.receiveSome()).empty();) {
      const std::size_t before = heard.steps();
      heard.feed(bytes);
      for (std::size_t step = before; step < heard.steps() && step + 1 < ends.size(); ++step) {
        socket.send(replaced(script.substr(ends[step], ends[step + 1] - ends[step]), recordedIdentity,
                             identityIn(heard.said())));
      }
    }
  });
  bool done = false;
  {
    const std::string name = "Room@tcp://127.0.0.1:" + std::to_string(address.port);
    const Held connection(vrpn_get_connection_by_name(name.c_str()));
    RoomClient client(connection.get());
    const auto end = std::chrono::steady_clock::now() + kRoomPatience;
    const auto run = [&](const auto& condition) {
      while (!condition() && std::chrono::steady_clock::now() < end) client.mainloop();
    };
    run([&] { return connection->connected() != 0; });
    client.begin();
    run([&] { return client.waits(); });
    client.finish();
    run([&] { return client.done(); });
    done = client.done();
  }
  server.join();
  EXPECT_TRUE(done);
  std::vector<VrpnMessage> said = heard.said();
  for (VrpnMessage& s : said) s.payload = replaced(s.payload, identityIn(heard.said()), recordedIdentity);
  expectSame(said, asMeant(expected.said()));
}

TEST(VrpnValues, AreThoseOfVrpn) {
  FILE* const file = std::tmpfile();
  ASSERT_NE(file, nullptr);
  writeValues(file);
  std::rewind(file);
  std::string values(1 << 16, '\0');
  values.resize(std::fread(values.data(), 1, values.size(), file));
  std::fclose(file);
  EXPECT_EQ(values, roomRecording("values.txt"));
}

}  // namespace
}  // namespace hapticd
