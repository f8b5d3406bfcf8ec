// A stop that must not wait behind what the same client has sent.
#include "client/client_tests.h"

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

ScriptedServerOptions ableServer() {
  ScriptedServerOptions options;
  options.capabilities = allCapabilities();
  return options;
}

std::size_t stops(const std::vector<Received>& received) {
  return static_cast<std::size_t>(std::count_if(received.begin(), received.end(), [](const Received& r) {
    return r.message.as<wire::StopForces>() != nullptr;
  }));
}

constexpr int kVertices = 400'000;  // 19 MB: more than the socket buffers of both sides hold

/// Makes the server stop reading, and fills the stream of the client until its own queue holds bytes.
void backUp(ScriptedServer& server, Client& client) {
  ASSERT_TRUE(client.waitCapabilities());
  server.stopReading();
  for (int i = 0; i < kVertices; ++i) client.setVertex(0, i, 0, 0, 0);
  client.flush();
  ASSERT_LT(client.statistics().tcpBytesOut, static_cast<std::uint64_t>(kVertices) * 48) << "nothing waits";
}

TEST(Stop, OvertakesABackedUpStreamByASecondConnection) {
  ScriptedServer server(ableServer());
  Client client(server.tcpName(), {.queueLimit_bytes = 64 * 1024 * 1024});
  backUp(server, client);
  client.stopForces();
  const auto received = server.waitReceived(2);
  ASSERT_EQ(received.size(), 2U) << "the first connection is not read";
  EXPECT_EQ(received[0].message.kind(), wire::kindOf<wire::Identify>) << "both are of one program";
  EXPECT_TRUE(is(received[1], wire::StopForces{}));
  EXPECT_EQ(received[1].sender, "Phantom");
  EXPECT_EQ(server.connections(), 2U);
  EXPECT_EQ(client.statistics().connections, 1U) << "of the client's own stream";

  client.rearmForces();
  server.startReading();
  client.flushAll();
  const auto all = server.waitReceived(6);
  ASSERT_EQ(all.size(), 6U);
  EXPECT_EQ(stops(all), 2U);
  EXPECT_TRUE(is(all[5], wire::RearmForces{})) << "behind both stops";
  EXPECT_EQ(server.openConnections(), 1U) << "the second one is closed";
}

TEST(Stop, NeedsNoSecondConnectionWhileNothingWaits) {
  ScriptedServer server(ableServer());
  Client client(server.tcpName());
  client.stopForces();
  EXPECT_EQ(stops(server.waitReceived(2)), 1U);
  EXPECT_EQ(server.connections(), 1U);
}

// The server knows a program by its key, and its next connection by nothing else.
TEST(Stop, IsOfTheSameProgramOnItsNextConnection) {
  ScriptedServer server(ableServer());
  Client client(server.tcpName());
  client.stopForces();
  ASSERT_EQ(server.waitReceived(2).size(), 2U);
  server.dropClients();
  ASSERT_TRUE(pollUntil(client, [&] { return server.connections() == 2 && client.connected(); }));
  client.rearmForces();
  const auto received = server.waitReceived(4);
  ASSERT_EQ(received.size(), 4U);
  const auto keyOf = [](const Received& r) {
    const auto* identify = r.message.as<wire::Identify>();
    return identify != nullptr && identify->token.view().empty() ? identify->key : 0;
  };
  EXPECT_NE(keyOf(received[0]), 0U);
  EXPECT_TRUE(is(received[1], wire::StopForces{}));
  EXPECT_EQ(keyOf(received[2]), keyOf(received[0]));
  EXPECT_TRUE(is(received[3], wire::RearmForces{}));
}

TEST(Stop, OvertakesAReverseConnectionToo) {
  ScriptedServer server(ableServer());
  Client client(server.name(), {.queueLimit_bytes = 64 * 1024 * 1024});
  backUp(server, client);
  client.stopForces();
  EXPECT_EQ(stops(server.waitReceived(2)), 1U);
  EXPECT_EQ(server.connections(), 2U);
  server.startReading();  // the client waits for it at its end
}

TEST(Stop, WithoutAConfirmationItThrowsAndKeepsTheFirstStop) {
  ScriptedServer server(ableServer());
  Client client(server.tcpName(), {.connectTimeout = 1s, .queueLimit_bytes = 64 * 1024 * 1024});
  server.ignorePings();
  backUp(server, client);
  EXPECT_THAT(textOf<ConnectError>([&] { client.stopForces(); }),
              HasSubstr("stop not confirmed: it waits behind"));
  server.startReading();
  client.flushAll();
  EXPECT_EQ(stops(server.waitReceived(4)), 2U);
}

}  // namespace
}  // namespace hapticd::test
