// Both sides of vrpn_room.h against what the same sides said when they were linked with VRPN 07.38. The bytes
// are read here by VRPN's format alone, not by this project's wire code.
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <vrpn_Connection.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "client/vrpn_room.h"
#include "client/vrpn_values.h"
#include "net/loopback.h"

namespace hapticd {
namespace {

using net::RawSocket;

constexpr std::size_t kVrpnCookieBytes = 24;
constexpr std::size_t kVrpnHeaderBytes = 24;
constexpr auto kRoomPatience = std::chrono::seconds(30);

struct RoomMessage {
  std::string sender, type, payload;
  bool operator==(const RoomMessage&) const = default;
};
std::ostream& operator<<(std::ostream& out, const RoomMessage& said) {
  return out << said.sender << " | " << said.type << " | " << ::testing::PrintToString(said.payload);
}

// A stream of one side: cookie, descriptions of names, messages.
class RoomStream {
 public:
  void feed(const std::string& bytes) {
    bytes_ += bytes;
    if (at_ == 0 && bytes_.size() >= kVrpnCookieBytes) at_ = kVrpnCookieBytes;
    while (at_ >= kVrpnCookieBytes && bytes_.size() >= at_ + kVrpnHeaderBytes) {
      const std::size_t length = static_cast<std::size_t>(number(0));
      const std::size_t next = at_ + kVrpnHeaderBytes + (length - kVrpnHeaderBytes + 7) / 8 * 8;
      if (bytes_.size() < next) return;
      take(number(12), number(16), bytes_.substr(at_ + kVrpnHeaderBytes, length - kVrpnHeaderBytes));
      at_ = next;
    }
  }
  const std::vector<RoomMessage>& said() const { return said_; }
  /// How much had been said before anything but names, then at the end of each step.
  const std::vector<std::size_t>& stepEnds() const { return ends_; }
  std::size_t steps() const { return steps_; }

 private:
  std::int32_t number(std::size_t offset) const {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i)
      value = value << 8 | static_cast<unsigned char>(bytes_[at_ + offset + i]);
    return static_cast<std::int32_t>(value);
  }
  void take(std::int32_t sender, std::int32_t type, const std::string& payload) {
    if (type == -1 || type == -2) {
      (type == -1 ? senders_ : types_)[sender] = payload.substr(4, payload.find('\0', 4) - 4);
    }
    if (type < 0) return;
    const std::string& name = types_[type];
    if (name == "vrpn_Base ping_message") return;  // how often is a matter of time
    if (said_.empty()) ends_.push_back(at_);
    said_.push_back({senders_[sender], name, payload});
    if (name != "Room Step") return;
    ++steps_;
    ends_.push_back(at_ + kVrpnHeaderBytes + (payload.size() + 7) / 8 * 8);
  }

  std::string bytes_;
  std::size_t at_ = 0;
  std::map<std::int32_t, std::string> senders_, types_;
  std::vector<RoomMessage> said_;
  std::vector<std::size_t> ends_;
  std::size_t steps_ = 0;
};

std::string roomRecording(const std::string& file) {
  std::ifstream in(HAPTICD_TESTDATA "/vrpn_room/" + file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

// What VRPN does otherwise than it means: its library cuts eight characters off a text that arrives, its
// remote of the redundant transmission names another type, and its poser sends as a change of the pose the
// sum of all changes, which the server adds again.
std::vector<RoomMessage> asMeant(std::vector<RoomMessage> said) {
  std::string pose;
  for (RoomMessage& s : said) {
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

void expectSame(const std::vector<RoomMessage>& said, const std::vector<RoomMessage>& expected) {
  EXPECT_EQ(said.size(), expected.size());
  for (std::size_t i = 0; i < std::min(said.size(), expected.size()); ++i) {
    ASSERT_EQ(said[i], expected[i]) << "message " << i;
  }
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

TEST(VrpnRoom, ServerAnswersARecordedClientAsVrpnDoes) {
  RoomStream expected;
  expected.feed(roomRecording("server.bin"));
  ASSERT_EQ(expected.steps(), 6U);
  const Held connection(vrpn_create_server_connection(0, nullptr, nullptr, "127.0.0.1"));
  ASSERT_TRUE(connection);
  RoomServer server(connection.get());
  RawSocket client =
      RawSocket::connected({net::kLoopbackAddress, static_cast<std::uint16_t>(connection->servedPort())});
  ASSERT_TRUE(client.send(roomRecording("client.bin")));
  RoomStream answers;
  const auto end = std::chrono::steady_clock::now() + kRoomPatience;
  while (answers.steps() < expected.steps() && std::chrono::steady_clock::now() < end) {
    server.mainloop();
    answers.feed(arrived(client));
  }
  std::vector<RoomMessage> said = answers.said();
  // VRPN means to tell a new client the present values but registers for it under the wrong sender.
  ASSERT_GE(said.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(said[i].type, "vrpn_Shared update");
  said.erase(said.begin(), said.begin() + 3);
  expectSame(said, asMeant(expected.said()));
}

TEST(VrpnRoom, ClientSaysToARecordedServerWhatVrpnDoes) {
  const std::string script = roomRecording("server.bin");
  RoomStream expected;
  expected.feed(roomRecording("client.bin"));
  RoomStream scripted;
  scripted.feed(script);
  const std::vector<std::size_t> ends = scripted.stepEnds();
  ASSERT_EQ(ends.size(), 7U);

  RawSocket listener;
  const net::Endpoint address = listener.bindToAnyPort();
  ASSERT_EQ(::listen(listener.fd(), 1), 0);
  RoomStream heard;
  // Each step of the client is answered by the part of the recording that follows it.
  std::thread server([&] {
    RawSocket socket = RawSocket::accepted(listener);
    socket.send(std::string_view(script).substr(0, ends[0]));
    for (std::string bytes; !(bytes = socket.receiveSome()).empty();) {
      const std::size_t before = heard.steps();
      heard.feed(bytes);
      for (std::size_t step = before; step < heard.steps() && step + 1 < ends.size(); ++step) {
        socket.send(std::string_view(script).substr(ends[step], ends[step + 1] - ends[step]));
      }
    }
  });
  bool done = false;
  {
    const std::string name = "Room@tcp://127.0.0.1:" + std::to_string(address.port);
    const Held connection(vrpn_get_connection_by_name(name.c_str()));
    RoomClient client(connection.get());
    const auto end = std::chrono::steady_clock::now() + kRoomPatience;
    while (!connection->connected() && std::chrono::steady_clock::now() < end) client.mainloop();
    client.begin();
    while (!client.done() && std::chrono::steady_clock::now() < end) client.mainloop();
    done = client.done();
  }
  server.join();
  EXPECT_TRUE(done);
  expectSame(heard.said(), asMeant(expected.said()));
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
