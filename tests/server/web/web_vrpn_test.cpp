// A VRPN session over the HTTP port's WebSocket behaves like one over TCP.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "feeling.h"
#include "http_client.h"
#include "web_tunnel.h"

namespace hapticd::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

class WebVrpn : public testing::Test {
 protected:
  net::Endpoint web() { return *server_.server().webAddress(); }
  ScriptedPeer::Mode tcp() { return ScriptedPeer::Mode::tcp; }

  RunningServer server_{withWeb()};
  WebTunnel tunnel_{web()};
};

// The first bytes from the server, before any message that depends on the timing of ticks.
std::string opening(const net::Endpoint& server, std::size_t size) {
  net::RawSocket socket = net::RawSocket::connected(server);
  const std::string cookie = "vrpn: ver. 07.35  0";
  socket.send(cookie + std::string(24 - cookie.size(), '\0'));
  return socket.receive(size);
}

TEST_F(WebVrpn, ReceivesTheSameBytesAsOverTcp) {
  std::string direct = opening(server_.address(), 2000);
  std::string tunnelled = opening(tunnel_.address(), 2000);
  ASSERT_EQ(direct.size(), 2000u);
  ASSERT_EQ(tunnelled.size(), 2000u);
  EXPECT_EQ(tunnelled.substr(0, 24), direct.substr(0, 24));
  // The messages after it are equal except for their time stamps.
  for (std::size_t at = 24; at + 24 < direct.size();) {
    std::uint32_t length = 0;
    std::memcpy(&length, direct.data() + at, sizeof length);
    length = __builtin_bswap32(length);
    ASSERT_GE(length, 24u);
    direct.replace(at + 4, 8, 8, '\0');
    tunnelled.replace(at + 4, 8, 8, '\0');
    at += (length + 7) / 8 * 8;
  }
  EXPECT_EQ(tunnelled, direct);
}

TEST_F(WebVrpn, ReceivesTheSameTicksAsATcpClient) {
  ScriptedPeer direct(server_.address());
  ScriptedPeer tunnelled(tunnel_.address());
  ASSERT_TRUE(direct.untilConnected());
  ASSERT_TRUE(tunnelled.untilConnected());
  const wire::Subscribe wanted{wire::kReportTick | wire::kReportContacts, 100};
  direct.send(wanted);
  tunnelled.send(wanted);
  sendCube(tunnelled);
  ASSERT_TRUE(tunnelled.until([&] {
    const auto tick = tunnelled.last<wire::TickReport>();
    return tick && tick->object == 0;
  }));
  tunnelled.forget();
  std::map<std::uint64_t, std::vector<std::byte>> heard;
  ASSERT_TRUE(tunnelled.until([&] { return tunnelled.count<wire::TickReport>() >= 30; }));
  for (const auto& message : tunnelled.messages()) {
    if (message.kind != wire::kindOf<wire::TickReport>) continue;
    heard[wire::decode<wire::TickReport>(message.payload)->tick] = message.payload;
  }
  std::size_t same = 0;
  ASSERT_TRUE(direct.until([&] {
    same = 0;
    for (const auto& message : direct.messages()) {
      if (message.kind != wire::kindOf<wire::TickReport>) continue;
      const auto found = heard.find(wire::decode<wire::TickReport>(message.payload)->tick);
      if (found == heard.end()) continue;
      EXPECT_EQ(found->second, message.payload);
      ++same;
    }
    return same >= 30;
  })) << same
      << " ticks were received by both";
}

TEST_F(WebVrpn, APageHoldsAndReleasesTheSimulatedHand) {
  ScriptedPeer page(tunnel_.address());
  ASSERT_TRUE(page.untilConnected());
  page.send(wire::HoldHand{.hold = 1, .position = {10, 20, 5}});
  EXPECT_TRUE(untilHandAt(page, {0.010, 0.020, 0.005}, 2e-3));
  const json held = get(web(), "/api/state").json();
  EXPECT_EQ(held["devices"][0]["hand"], "held");
  EXPECT_EQ(held["devices"][0]["held_by"], held["clients"][0]["id"]);
  EXPECT_EQ(held["clients"][0]["mode"], "web");
  page.close();
  const json free =
      stateWhen(web(), [](const json& state) { return state["devices"][0]["held_by"].is_null(); });
  ASSERT_FALSE(free.is_null());
  EXPECT_EQ(free["devices"][0]["hand"], "scripted");
  EXPECT_TRUE(free["clients"].empty());
}

TEST_F(WebVrpn, APageStopsAndReArms) {
  ScriptedPeer page(tunnel_.address());
  ASSERT_TRUE(page.untilConnected());
  page.send(wire::StopForces{});
  json state = stateWhen(web(), [](const json& s) { return s["devices"][0]["guard"]["stopped"] == true; });
  ASSERT_FALSE(state.is_null());
  EXPECT_THAT(state["devices"][0]["guard"]["active"].dump(), HasSubstr("stopped"));
  page.send(wire::RearmForces{});
  state = stateWhen(web(), [](const json& s) { return s["devices"][0]["guard"]["stopped"] == false; });
  EXPECT_FALSE(state.is_null());
}

TEST_F(WebVrpn, TheStateShowsActiveEffects) {
  ScriptedPeer page(tunnel_.address());
  ASSERT_TRUE(page.untilConnected());
  wire::Effect push{.type = "constant",
                    .index = 1,
                    .gain = 0,
                    .magnitude = 1,
                    .duration = 0,
                    .frequency = 0,
                    .position = {},
                    .direction = {0, 1, 0}};
  page.send(push);
  page.send(wire::StartEffect{1});
  const auto active = [](bool wanted) {
    return [wanted](const json& state) {
      const json& effects = state["scenes"][0]["effects"];
      return !effects.empty() && effects[0]["active"] == wanted;
    };
  };
  EXPECT_FALSE(stateWhen(web(), active(true)).is_null());
  page.send(wire::StopEffect{1});
  EXPECT_FALSE(stateWhen(web(), active(false)).is_null());
}

TEST(WebVrpnToken, OneThatTheRequestPresentsIsTakenOrRefusedByAText) {
  const std::string file = testing::TempDir() + "web-token-" + std::to_string(getpid());
  std::ofstream(file) << "operator 0123456789abcdef\n";
  std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  server::ServerConfig config = withWeb();
  config.tokens = file;
  RunningServer server(config);
  const net::Endpoint web = *server.server().webAddress();
  WebTunnel right(web, "bearer 0123456789abcdef");
  WebTunnel wrong(web, "Bearer 0123456789abcde0");
  ScriptedPeer taken(right.address());
  ASSERT_TRUE(taken.untilConnected());
  EXPECT_FALSE(stateWhen(web, [](const json& state) {
                 return state["clients"].size() == 1 && state["clients"][0]["role"] == "operator";
               }).is_null());
  ScriptedPeer refused(wrong.address());
  EXPECT_TRUE(refused.untilText("Identify refused: wrong token"));
  EXPECT_TRUE(taken.texts().empty());
  std::filesystem::remove(file);
}

TEST_F(WebVrpn, DisconnectsAWebSocketThatDoesNotSpeakVrpn) {
  namespace asio = boost::asio;
  asio::io_context context;
  boost::beast::websocket::stream<asio::ip::tcp::socket> page(context);
  page.next_layer().connect({asio::ip::address_v4::loopback(), web().port});
  page.handshake(web().text(), "/vrpn");
  page.binary(true);
  page.write(asio::buffer(std::string(64, 'x')));
  boost::system::error_code error;
  boost::beast::flat_buffer buffer;
  while (!error) page.read(buffer, error);
  const json gone = stateWhen(web(), [](const json& state) { return state["clients"].empty(); });
  EXPECT_FALSE(gone.is_null());
}

// A page that never reads delays no other client, and its queue stays within its limit.
TEST(WebVrpnLoad, APageThatNeverReadsDoesNotDelayOthers) {
  namespace asio = boost::asio;
  server::ServerConfig config = withWeb();
  config.devices.front().linearTolerance_m = 0;  // report every tick
  RunningServer busy(config);
  const net::Endpoint port = *busy.server().webAddress();
  asio::io_context context;
  boost::beast::websocket::stream<asio::ip::tcp::socket> page(context);
  page.next_layer().open(asio::ip::tcp::v4());
  page.next_layer().set_option(asio::socket_base::receive_buffer_size(4096));
  page.next_layer().connect({asio::ip::address_v4::loopback(), port.port});
  page.handshake(port.text(), "/vrpn");
  page.binary(true);
  const std::string cookie = "vrpn: ver. 07.35  0";
  page.write(asio::buffer(cookie + std::string(24 - cookie.size(), '\0')));
  ScriptedPeer other(busy.address());
  ASSERT_TRUE(other.untilConnected());
  const json dropping = stateWhen(port, [](const json& state) {
    for (const json& client : state["clients"]) {
      if (client["mode"] == "web") return client["dropped"] > 0;
    }
    return false;
  });
  ASSERT_FALSE(dropping.is_null()) << "reports that it does not read are dropped";
  for (const json& client : dropping["clients"]) EXPECT_LE(client["queued_bytes"], 400 * 1024);
  EXPECT_TRUE(untilTicks(other, 50));
}

}  // namespace
}  // namespace hapticd::test
