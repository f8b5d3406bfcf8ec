// Limits of docs/limits.md: who exceeds one is told and alone is closed, and the others go on.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <string>

#include "server/log_lines.h"
#include "server/running_server.h"
#include "server/scripted_peer.h"
#include "server/session/throttled_log.h"

namespace hapticd::test {
namespace {

bool answers(ScriptedPeer& peer) {
  peer.send(wire::Ping{});
  return peer.untilNext<wire::Pong>();
}

TEST(Limits, ConnectionsOfOneAddressLeaveRoomForOthers) {
  server::ServerConfig config = RunningServer::anyPort();
  config.limits.connectionsPerAddress = 2;
  RunningServer server(config);
  ScriptedPeer first(server.address());
  ScriptedPeer second(server.address());
  ScriptedPeer third(server.address());
  for (ScriptedPeer* peer : {&first, &second, &third}) ASSERT_TRUE(peer->untilConnected());
  third.send(wire::SetObjectNumber{2});
  EXPECT_TRUE(third.untilText("this connection may only stop and re-arm forces"));
  EXPECT_TRUE(answers(first));
  EXPECT_TRUE(answers(third));
  second.close();
  third.close();
  // A place is free once the server has noticed.
  EXPECT_TRUE(first.until([&] {
    ScriptedPeer next(server.address());
    if (!next.untilConnected()) return false;
    next.send(wire::SetObjectNumber{-1});
    return next.untilText("setObjectNumber") &&
           next.texts().back().text.text.find("full") == std::string::npos;
  }));
}

// No client exceeds its own limit.
TEST(Limits, OfAllClientsTogetherTheOneThatUsesMostIsClosed) {
  server::ServerConfig config = RunningServer::anyPort();
  config.limits.sendQueue_MB = 1000;
  config.limits.clientMemory_MB = 60;
  config.limits.memory_MB = 64;
  config.limits.commandsPerSecond = 1'000'000'000;
  LogLines log;
  RunningServer server(config);
  ScriptedPeer other(server.address());
  ASSERT_TRUE(other.untilConnected());
  std::deque<ScriptedPeer> deaf;
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(deaf.emplace_back(server.address()).untilConnected());
    deaf.back().connection().pauseReading();
  }
  const auto ended = [&] { return log.count("all clients together use more than 64 MiB of the server") > 0; };
  const auto end = std::chrono::steady_clock::now() + 60s;
  while (!ended() && std::chrono::steady_clock::now() < end) {
    for (ScriptedPeer& peer : deaf) {
      if (!peer.open()) continue;
      for (int i = 0; i < 1000; ++i) peer.queue(wire::QueryCapabilities{});
      peer.flush();
      peer.poll();
    }
    other.poll();
  }
  EXPECT_TRUE(ended()) << log.text();
  EXPECT_TRUE(answers(other));
}

TEST(Limits, LinesThatClientsCauseAreCountedBeyondTheirNumberAndTheirBytes) {
  LogLines log;
  server::ThrottledLog throttled(1000);
  for (int i = 0; i < 100; ++i) throttled.warn("a stranger");
  EXPECT_EQ(log.count("a stranger"), 20U) << "of one source";
  for (int i = 0; i < 100; ++i) throttled.log(spdlog::level::info, "10.0.0." + std::to_string(i), "hello");
  EXPECT_EQ(log.count("hello"), 40U) << "60 of all";
  const std::string here = "127.0.0.1";
  throttled.log(spdlog::level::info, here, std::string(700, 'x'));
  EXPECT_EQ(log.count("xxx"), 0U) << "1000 bytes in all, of which 400 are used";
  throttled.log(spdlog::level::info, here, std::string(600, 'y'));
  EXPECT_EQ(log.count("yyy"), 1U);
  throttled.reportSuppressed();
  EXPECT_EQ(log.count("141 more lines about clients suppressed"), 1U) << log.text();
  throttled.warn("a stranger");
  EXPECT_EQ(log.count("a stranger"), 21U) << "in the next second";
}

TEST(Limits, AClientWithoutTlsThatTriesAgainIsLoggedOnce) {
  LogLines log;
  server::ServerConfig config = RunningServer::anyPort();
  config.tls = server::kTlsGenerated;
  config.tlsLoopback = true;
  {
    RunningServer server(config);
    for (int i = 0; i < 3; ++i) {
      ScriptedPeer peer(server.address(), "Phantom", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
      peer.sendBytes(std::as_bytes(std::span(std::string_view("vrpn: ver. 07.38  0"))));
      ASSERT_TRUE(peer.untilClosed());
    }
  }
  EXPECT_EQ(log.count("connection from 127.0.0.1 ended: TLS handshake failed"), 1U) << log.text();
  EXPECT_EQ(log.count("client "), 0U) << log.text();
}

// Such as a client that is refused and tries again four times a second, all night.
TEST(Limits, ACauseThatLastsIsLoggedOnceAMinute) {
  LogLines log;
  server::ThrottledLog throttled;
  const std::string cause = "connection from 10.0.0.5 refused: a reason";
  const auto second = [&](int tries) {
    for (int i = 0; i < tries; ++i) throttled.warnOfLasting(cause);
    throttled.reportSuppressed();
  };
  for (int i = 0; i < 59; ++i) second(4);
  EXPECT_EQ(log.count(cause), 1U) << log.text();
  throttled.warnOfLasting("connection from 10.0.0.6 refused: a reason");
  EXPECT_EQ(log.count("10.0.0.6"), 1U) << "each cause for itself";
  second(4);
  EXPECT_EQ(log.count(cause + " (239 more times in a minute)"), 1U) << log.text();
  for (int i = 0; i < 60; ++i) second(1);
  EXPECT_EQ(log.count(cause + " (60 more times in a minute)"), 1U) << log.text();
  for (int i = 0; i < 60; ++i) second(0);
  second(1);
  EXPECT_EQ(log.count(cause), 4U) << "a quiet minute makes it new";
  for (int i = 0; i < 10'000; ++i) throttled.warnOfLasting("connection from " + std::to_string(i));
  EXPECT_LE(log.count("connection from "), 60U + 5U) << "the limits hold";
}

}  // namespace
}  // namespace hapticd::test
