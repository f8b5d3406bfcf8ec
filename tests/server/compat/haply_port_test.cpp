// A whole server with the compatible port, and clients shaped after public programs for the Inverse Service.
#include "server/compat/haply_port.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <list>
#include <nlohmann/json.hpp>
#include <thread>

#include "device/haply/service_connection.h"
#include "feeling.h"
#include "hands.h"
#include "http_client.h"
#include "log_lines.h"
#include "net/client_frames.h"

namespace hapticd::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

constexpr auto kLimit = std::chrono::seconds(20);

/// In the service's frame.
Vec3 vectorOf(const json& j) {
  return {j.at("x").get<double>(), j.at("y").get<double>(), j.at("z").get<double>()};
}

/// As the samples of the service: read a frame, send a command, once for each frame.
class HaplyClient {
 public:
  enum class Form { values, vector };

  explicit HaplyClient(const net::Endpoint& port, Form form = Form::values)
      : form_(form),
        connection_("127.0.0.1", std::to_string(port.port), kLimit),
        first(json::parse(connection_.receive(kLimit))),
        id(first.at("inverse3").at(0).at("device_id").get<std::string>()) {}

  void send(const json& message) { connection_.send(message.dump(), kLimit); }
  void sendForce(const Vec3& force_N) {
    const json v{{"x", force_N.x()}, {"y", force_N.y()}, {"z", force_N.z()}};
    send({{"inverse3",
           json::array({{{"device_id", id},
                         {"commands",
                          {{"set_cursor_force", {{form_ == Form::values ? "values" : "vector", v}}}}}}})}});
  }
  void probe() {
    send({{"inverse3",
           json::array({{{"device_id", id}, {"commands", {{"probe_position", json::object()}}}}})}});
  }
  json receive() { return json::parse(connection_.receive(kLimit)); }
  json forced(const Vec3& force_N) {
    sendForce(force_N);
    return receive();
  }
  json probed() {
    probe();
    return receive();
  }

 private:
  const Form form_;
  device::haply::ServiceConnection connection_;

 public:
  const json first;
  const std::string id;
};

Vec3 positionIn(const json& frame) {
  return vectorOf(frame.at("inverse3").at(0).at("state").at("cursor_position"));
}
Vec3 forceIn(const json& frame) {
  return vectorOf(frame.at("inverse3").at(0).at("state").at("current_cursor_force"));
}

/// Asks for frames until one satisfies the condition; null after the limit.
json untilFrame(const std::function<json()>& next, const std::function<bool(const json&)>& condition) {
  const auto end = std::chrono::steady_clock::now() + kLimit;
  while (std::chrono::steady_clock::now() < end) {
    json frame = next();
    if (condition(frame)) return frame;
  }
  return nullptr;
}

server::ServerConfig withHaply(server::ServerConfig config) {
  config.compat.haply = "127.0.0.1:0";
  return config;
}

constexpr double kHandX = 0.010, kHandY = 0.020, kHandZ = 0.030;

class Haply : public testing::Test {
 protected:
  net::Endpoint port() { return *server_.server().haplyAddress(); }
  static bool isPushed(const json& frame) { return (forceIn(frame) - Vec3(1, 0, 0)).norm() < 0.05; }
  static bool isFree(const json& frame) { return forceIn(frame).norm() < 1e-3; }

  LogLines log_;
  Hand hand_ = Hand::at({kHandX, kHandY, kHandZ});
  RunningServer server_{withHaply(hand_.config())};
};

TEST_F(Haply, TheFirstFrameIsTheInventoryAndEachMessageHasOneAnswer) {
  HaplyClient client(port());
  EXPECT_EQ(client.id, "Phantom");
  EXPECT_EQ(client.first["inverse3"][0]["config"]["handedness"], "right");
  EXPECT_EQ(client.first["wireless_verse_grip"].size(), 1U);
  const json at = untilFrame(
      [&] {
        return client.forced({0, 0, 0});
      },
      [](const json& frame) { return (positionIn(frame) - Vec3(kHandX, -kHandZ, kHandY)).norm() < 1e-3; });
  ASSERT_FALSE(at.is_null());
  EXPECT_FALSE(at["inverse3"][0].contains("config"));
  const int kMessages = 3 * static_cast<int>(server::HaplyPort::kMostUnanswered);
  for (int i = 0; i < kMessages; ++i) client.probe();
  client.send({{"session", {{"force_render_full_state", json::object()}}}});
  int frames = 0;
  json frame;
  do {
    frame = client.receive();
    ++frames;
  } while (!frame["inverse3"][0].contains("config") && frames <= kMessages);
  EXPECT_EQ(frames, kMessages + 1) << "the answer to the last message";
  EXPECT_FALSE(client.probed()["inverse3"][0].contains("config"));
}

// More messages at once than wait for answers: the port stops reading, reads again, and misses none.
TEST_F(Haply, AFloodOfMessagesIsAnsweredToItsEnd) {
  net::RawSocket client = net::RawSocket::connected(port());
  std::string request = net::upgradeRequest("/");
  request.replace(request.find("Host: localhost"), 15, "Host: " + port().text());
  constexpr std::size_t kMessages = 10 * server::HaplyPort::kMostUnanswered;
  for (std::size_t i = 0; i < kMessages; ++i) request += net::clientFrame(net::kBinary, "{}");
  request += net::clientFrame(net::kBinary, R"({"session":{"force_render_full_state":{}}})");
  ASSERT_TRUE(client.send(request));
  std::string all;
  while (all.find("handedness") == all.rfind("handedness")) {  // the first frame's and the last one's
    std::string part(65536, '\0');
    const ssize_t got = ::recv(client.fd(), part.data(), part.size(), 0);
    ASSERT_GT(got, 0);
    all.append(part, 0, static_cast<std::size_t>(got));
  }
  std::size_t frames = 0;
  for (std::size_t at = all.find("control_domain"); at != std::string::npos; ++frames)
    at = all.find("control_domain", at + 1);
  EXPECT_EQ(frames, kMessages + 2) << "the first frame, and one for each message";
}

// Position and orientation from two devices, buttons a to c, and a force with each frame.
TEST_F(Haply, AClientThatNeedsArmAndGripGetsBoth) {
  HaplyClient client(port());
  const json frame = client.forced({0, 0, 0});
  const json& arms = frame["inverse3"];
  const json& grips = frame["wireless_verse_grip"];
  ASSERT_EQ(arms.size(), 1U);
  ASSERT_EQ(grips.size(), 1U);
  for (const char* axis : {"x", "y", "z"}) {
    EXPECT_TRUE(arms[0]["state"]["cursor_position"][axis].is_number());
    EXPECT_TRUE(grips[0]["state"]["orientation"][axis].is_number());
  }
  EXPECT_EQ(grips[0]["state"]["orientation"]["w"], 1.0);
  for (const char* button : {"a", "b", "c"}) EXPECT_EQ(grips[0]["state"]["buttons"][button], false);
}

// A profile with the first message, as since version 3.5 of the service.
TEST_F(Haply, BothFormsOfAForceAreFelt) {
  for (const auto form : {HaplyClient::Form::values, HaplyClient::Form::vector}) {
    HaplyClient client(port(), form);
    client.send({{"session", {{"configure", {{"profile", {{"name", "test"}}}}}}}});
    client.receive();
    const json felt = untilFrame([&] { return client.forced({1, 0, 0}); }, isPushed);
    ASSERT_FALSE(felt.is_null());
    EXPECT_EQ(felt["inverse3"][0]["status"]["in_use"], true);
    ASSERT_FALSE(untilFrame([&] { return client.forced({0, 0, 0}); }, isFree).is_null());
  }
}

TEST_F(Haply, AForceEndsWithItsClient) {
  HaplyClient watcher(port());
  {
    HaplyClient client(port());
    ASSERT_FALSE(untilFrame([&] { return client.forced({1, 0, 0}); }, isPushed).is_null());
  }
  EXPECT_FALSE(untilFrame([&] { return watcher.probed(); }, isFree).is_null());
}

TEST_F(Haply, AForceExpiresWithoutMessages) {
  HaplyClient watcher(port());
  HaplyClient client(port());
  ASSERT_FALSE(untilFrame([&] { return client.forced({1, 0, 0}); }, isPushed).is_null());
  ASSERT_FALSE(untilFrame([&] { return watcher.probed(); }, isFree).is_null());
  // A stall of the machine, too, ends the force for a moment, and gives it back.
  EXPECT_FALSE(untilFrame([&] { return client.probed(); }, isFree).is_null())
      << "a message without a force holds none";
}

TEST_F(Haply, AForceThatIsTooLargeIsRefused) {
  HaplyClient client(port());
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(isFree(client.forced({1e31, 0, 0})));
  EXPECT_GE(log_.count("client 1: 'Phantom': force refused: a number is not finite or too large"), 1U)
      << log_.text();
}

TEST_F(Haply, OneClientPushesAtATime) {
  HaplyClient client(port());
  HaplyClient other(port());
  ASSERT_FALSE(untilFrame([&] { return client.forced({1, 0, 0}); }, isPushed).is_null());
  const json refused = untilFrame(
      [&] {
        client.forced({1, 0, 0});
        return other.forced({0, 0, -2});
      },
      [&](const json&) { return log_.count("streams to this device") > 0; });
  ASSERT_FALSE(refused.is_null());
  EXPECT_GT(forceIn(client.forced({1, 0, 0})).x(), -0.01);
}

TEST_F(Haply, AStopOfAnyClientStopsItsForces) {
  HaplyClient client(port());
  const auto isReady = [](const json& frame) {
    return frame.at("inverse3").at(0).at("status").at("ready").get<bool>();
  };
  const json pushed = untilFrame([&] { return client.forced({1, 0, 0}); }, isPushed);
  ASSERT_FALSE(pushed.is_null());
  EXPECT_TRUE(isReady(pushed));
  ScriptedPeer peer(server_.address());
  ASSERT_TRUE(peer.untilConnected());
  peer.send(wire::StopForces{});
  ASSERT_FALSE(untilFrame([&] { return client.forced({1, 0, 0}); }, isFree).is_null());
  for (int i = 0; i < 20; ++i) {
    const json frame = client.forced({1, 0, 0});
    EXPECT_TRUE(isFree(frame));
    EXPECT_FALSE(isReady(frame)) << "the program sees that it pushes nothing";
  }
  peer.send(wire::RearmForces{});
  const json again = untilFrame([&] { return client.forced({1, 0, 0}); }, isPushed);
  ASSERT_FALSE(again.is_null());
  EXPECT_TRUE(isReady(again));
}

TEST_F(Haply, RefusesPagesAndForeignNames) {
  const std::string host = "Host: " + port().text() + "\r\n";
  const auto upgrade = [&](const std::string& hostHeader, const std::string& more) {
    return ask(port(), "GET / HTTP/1.1\r\n" + hostHeader + more +
                           "Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: 13\r\n"
                           "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nConnection: close\r\n\r\n");
  };
  const Answer page = upgrade(host, "Origin: http://evil.example\r\n");
  EXPECT_EQ(page.status, 403);
  EXPECT_THAT(page.body, HasSubstr("http://evil.example"));
  EXPECT_EQ(upgrade(host, "Origin: http://" + port().text() + "\r\n").status, 403) << "it has no page";
  EXPECT_EQ(upgrade("Host: evil.example\r\n", "").status, 403);
  EXPECT_EQ(get(port(), "/").status, 426);
}

TEST_F(Haply, AMessageThatIsNoneEndsTheConnection) {
  HaplyClient client(port());
  client.send("no object");
  EXPECT_THROW(client.receive(), device::haply::ConnectionError);
  HaplyClient next(port());
  next.forced({0, 0, 0});
  next.send({{"inverse3",
              {{{"device_id", "Other"},
                {"commands", {{"set_cursor_force", {{"values", {{"x", 1}, {"y", 0}, {"z", 0}}}}}}}}}}});
  next.receive();
  EXPECT_EQ(log_.count("there is no device \"Other\""), 1U) << log_.text();
}

TEST_F(Haply, WhatHasNoEffectIsToldOnce) {
  HaplyClient client(port());
  for (int i = 0; i < 3; ++i) {
    client.send({{"inverse3",
                  {{{"device_id", client.id}, {"commands", {{"set_cursor_position", json::object()}}}}}}});
    client.receive();
  }
  EXPECT_EQ(log_.count("client 1: \"set_cursor_position\" is not supported and has no effect"), 1U)
      << log_.text();
}

TEST(HaplyPort, ItsClientsAreCountedAndShown) {
  RunningServer server(withHaply(withWeb()));
  const net::Endpoint port = *server.server().haplyAddress();
  const net::Endpoint web = *server.server().webAddress();
  std::list<HaplyClient> clients;
  while (clients.size() < server::HaplyPort::kMostClients) clients.emplace_back(port);
  clients.front().probed();
  const json shown = stateWhen(
      web, [](const json& state) { return state["clients"].size() == server::HaplyPort::kMostClients; });
  ASSERT_FALSE(shown.is_null());
  const json& first = shown["clients"][0];
  EXPECT_EQ(first["mode"], "haply");
  EXPECT_EQ(first["devices"], json::array({"Phantom"}));
  EXPECT_GT(first["bytes_in"], 0);
  EXPECT_GT(first["bytes_out"], first["bytes_in"]);
  const Answer full = get(port, "/");
  EXPECT_EQ(full.status, 503);
  EXPECT_EQ(full.body, "16 clients are connected, the most\n");
  clients.pop_front();
  EXPECT_FALSE(stateWhen(web, [](const json& state) {
                 return state["clients"].size() == server::HaplyPort::kMostClients - 1;
               }).is_null());
  HaplyClient next(port);
  EXPECT_EQ(next.first["session_id"], 17);
}

TEST(HaplyPort, ANetworkIsRefusedUntilItIsTrusted) {
  LogLines log;
  server::ServerConfig config = withHaply(RunningServer::anyPort());
  config.tls = server::kTlsGenerated;
  config.tlsLoopback = true;  // this machine counts as a distant one
  {
    RunningServer server(config);
    EXPECT_THROW(HaplyClient(*server.server().haplyAddress()), device::haply::ConnectionError);
    const Answer refused = get(*server.server().haplyAddress(), "/");
    EXPECT_EQ(refused.status, 403) << "a program hears why";
    EXPECT_EQ(refused.body, "this port is not encrypted, and 127.0.0.1 is not in trusted_networks\n");
    EXPECT_EQ(log.count("haply connection from 127.0.0.1 refused: this port is not encrypted, and 127.0.0.1 "
                        "is not in trusted_networks"),
              1U)
        << log.text();
  }
  config.trustedNetworks = {"127.0.0.0/8"};
  RunningServer server(config);
  HaplyClient client(*server.server().haplyAddress());
  EXPECT_EQ(client.first["session_id"], 1);
}

TEST(HaplyPort, ItsClientsCountAmongAllConnections) {
  LogLines log;
  server::ServerConfig config = withHaply(RunningServer::anyPort());
  config.limits.connections = 1;
  RunningServer server(config);
  const net::Endpoint port = *server.server().haplyAddress();
  {
    HaplyClient first(port);
    EXPECT_THROW(HaplyClient{port}, device::haply::ConnectionError);
    const Answer refused = get(port, "/");
    EXPECT_EQ(refused.status, 503);
    EXPECT_EQ(refused.body, "the server is full\n");
    EXPECT_EQ(log.count("haply connection from 127.0.0.1 refused: the server is full"), 1U) << log.text();
  }
  const auto end = std::chrono::steady_clock::now() + kLimit;
  while (log.count("(127.0.0.1, haply) disconnected") == 0 && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(HaplyClient(port).first["session_id"], 2);
}

// As clients do whose JSON library makes bytes.
TEST(HaplyPort, BinaryMessagesAreTexts) {
  RunningServer server(withHaply(RunningServer::anyPort()));
  const net::Endpoint port = *server.server().haplyAddress();
  net::RawSocket client = net::RawSocket::connected(port);
  std::string request = net::upgradeRequest("/");
  request.replace(request.find("Host: localhost"), 15, "Host: " + port.text());
  client.send(request + net::clientFrame(net::kBinary, "{}"));
  ASSERT_EQ(client.receive(12), "HTTP/1.1 101");
  std::string all;
  while (all.find("session_id") == all.rfind("session_id")) all += client.receive(1);  // two frames
  EXPECT_THAT(all, HasSubstr("handedness"));
}

TEST(HaplyPort, AnOriginThatIsConfiguredMayConnect) {
  server::ServerConfig config = withHaply(RunningServer::anyPort());
  config.compat.haplyOrigins = {"http://localhost:5173"};
  RunningServer server(config);
  net::RawSocket page = net::RawSocket::connected(*server.server().haplyAddress());
  page.send(net::upgradeRequest("/", "Origin: http://localhost:5173\r\n"));
  EXPECT_EQ(page.receive(12), "HTTP/1.1 403") << "Host: localhost without the port is another server";
  net::RawSocket again = net::RawSocket::connected(*server.server().haplyAddress());
  const std::string host = "localhost:" + std::to_string(server.server().haplyAddress()->port);
  std::string request = net::upgradeRequest("/", "Origin: http://localhost:5173\r\n");
  request.replace(request.find("Host: localhost"), 15, "Host: " + host);
  again.send(request);
  EXPECT_EQ(again.receive(12), "HTTP/1.1 101");
}

// Zero forces, which every program sends to get states, take no control.
TEST(HaplyPort, RolesAreThoseOfTheDevice) {
  LogLines log;
  const Hand hand = Hand::at(Vec3::Zero());
  server::ServerConfig config = withHaply(hand.config());
  config.devices[0].control = server::Control::first;
  RunningServer server(config);
  HaplyClient client(*server.server().haplyAddress());
  for (int i = 0; i < 3; ++i) client.forced({0, 0, 0});
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  ASSERT_TRUE(untilApplied(peer));
  ASSERT_FALSE(untilFrame(
                   [&] {
                     return client.forced({1, 0, 0});
                   },
                   [&](const json&) { return log.count("is in control") > 0; })
                   .is_null());
  EXPECT_EQ(log.count("refused: client 2 is in control"), log.count("is in control")) << log.text();
}

// A force along the motion of the hand gives it energy, of which the tank has 20 mJ and 20 mW.
TEST(HaplyPort, AForceThatDrivesTheHandIsCut) {
  Hand hand = Hand::at({-0.05, 0, 0});
  for (int i = 1; i < 200; ++i) hand.row(i, {i % 2 == 0 ? -0.05 : 0.05, 0, 0});
  RunningServer server(withHaply(hand.config()));
  HaplyClient client(*server.server().haplyAddress());
  double most_N = 0;
  const auto next = [&] { return client.forced({3, 0, 0}); };
  EXPECT_FALSE(untilFrame(next,
                          [&](const json& frame) {
                            most_N = std::max(most_N, forceIn(frame).x());
                            return most_N > 1 && forceIn(frame).x() < 0.5 * most_N &&
                                   frame["inverse3"][0]["state"]["cursor_velocity"]["x"].get<double>() > 0.02;
                          })
                   .is_null())
      << most_N;
}

// Two servers: the second drives the first one's hand through this port and feels its own scene.
TEST(HaplyPort, OurDriverDrivesAHandThroughIt) {
  const Hand hand = Hand::stroking();
  RunningServer arm(withHaply(hand.config()));
  server::ServerConfig config = RunningServer::anyPort();
  config.devices[0].driver = "haply";
  config.devices[0].hardware = arm.server().haplyAddress()->text() + "/Phantom";
  config.devices[0].enableForces = true;
  RunningServer server(config);
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(untilHandAt(peer, {0, 0.040, 0}, 2e-3));
  HaplyClient watcher(*arm.server().haplyAddress());
  sendCube(peer);
  // A machine that pauses for 20 ms makes the arm a device that does not answer: someone re-arms it.
  const auto probed = [&] {
    peer.poll();
    const auto guard = peer.last<wire::GuardState>();
    if (guard && guard->latched != 0) peer.send(wire::RearmForces{});
    return watcher.probed();
  };
  const json felt = untilFrame(probed, [](const json& frame) { return forceIn(frame).z() > 0.1; });
  ASSERT_FALSE(felt.is_null());
  EXPECT_LT(std::abs(forceIn(felt).x()), 0.05);
  server.stop();
  EXPECT_FALSE(untilFrame([&] { return watcher.probed(); },
                          [](const json& frame) { return forceIn(frame).norm() < 1e-3; })
                   .is_null());
}

}  // namespace
}  // namespace hapticd::test
