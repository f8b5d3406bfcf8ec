// Ending callbacks, from outside and from within.
#include "client/client_tests.h"

namespace hapticd::test {
namespace {

/// Sends one report and waits until the client has dispatched it.
void sendReport(ScriptedServer& server, Client& client, int object) {
  server.send(wire::TouchedObject{object});
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().touchedObject.object == object; }));
}

TEST(Subscription, DiscardingItKeepsTheCallback) {
  ScriptedServer server;
  Client client(server.tcpName());
  int calls = 0;
  {
    client.onTouchedObject([&](const TouchedObjectReport&) { ++calls; });
  }
  sendReport(server, client, 1);
  sendReport(server, client, 2);
  EXPECT_EQ(calls, 2);
}

TEST(Subscription, EndStopsTheCallsAndDestroysTheFunction) {
  ScriptedServer server;
  Client client(server.tcpName());
  int calls = 0;
  auto captured = std::make_shared<int>(0);
  Subscription subscription =
      client.onTouchedObject([&calls, captured](const TouchedObjectReport&) { ++calls; });
  EXPECT_TRUE(subscription.active());
  EXPECT_EQ(captured.use_count(), 2);
  sendReport(server, client, 1);
  const Subscription copy = subscription;
  subscription.end();
  EXPECT_FALSE(copy.active());
  EXPECT_EQ(captured.use_count(), 1) << "the captures are still alive";
  sendReport(server, client, 2);
  EXPECT_EQ(calls, 1);
  subscription.end();
}

TEST(Subscription, AScopedOneEndsWithItsScope) {
  ScriptedServer server;
  Client client(server.tcpName());
  int calls = 0;
  {
    const ScopedSubscription scoped = client.onTouchedObject([&](const TouchedObjectReport&) { ++calls; });
    sendReport(server, client, 1);
  }
  sendReport(server, client, 2);
  EXPECT_EQ(calls, 1);
  ScopedSubscription ended = client.onTouchedObject([&](const TouchedObjectReport&) { ++calls; });
  ended.end();
  EXPECT_FALSE(ended.active());
  sendReport(server, client, 3);
  EXPECT_EQ(calls, 1);
}

TEST(Subscription, AScopedOneIsMovedAndReleased) {
  ScriptedServer server;
  Client client(server.tcpName());
  int first = 0;
  int second = 0;
  ScopedSubscription a = client.onTouchedObject([&](const TouchedObjectReport&) { ++first; });
  ScopedSubscription b = client.onTouchedObject([&](const TouchedObjectReport&) { ++second; });
  a = std::move(b);  // ends the first callback
  EXPECT_TRUE(a.active());
  EXPECT_FALSE(b.active());
  sendReport(server, client, 1);
  EXPECT_EQ(first, 0);
  EXPECT_EQ(second, 1);
  Subscription kept;
  {
    ScopedSubscription c = std::move(a);
    kept = c.release();
  }
  EXPECT_TRUE(kept.active());
  sendReport(server, client, 2);
  EXPECT_EQ(second, 2);
}

TEST(Subscription, ACallbackMayEndItselfAndOthers) {
  ScriptedServer server;
  Client client(server.tcpName());
  auto captured = std::make_shared<int>(0);
  Subscription self;
  Subscription other;
  int others = 0;
  self = client.onTouchedObject([&, captured](const TouchedObjectReport&) {
    self.end();
    other.end();
    ++*captured;  // the captures live until the callback returns
  });
  other = client.onTouchedObject([&](const TouchedObjectReport&) { ++others; });
  sendReport(server, client, 1);
  sendReport(server, client, 2);
  EXPECT_EQ(*captured, 1);
  EXPECT_EQ(captured.use_count(), 1);
  EXPECT_EQ(others, 0);
}

TEST(Subscription, ACallbackThatThrowsAfterItsEndIsNotCalledAgain) {
  ScriptedServer server;
  Client client(server.tcpName());
  Subscription self;
  int calls = 0;
  self = client.onTouchedObject([&](const TouchedObjectReport&) {
    ++calls;
    self.end();
    throw std::runtime_error("mine");
  });
  server.send(wire::TouchedObject{1});
  EXPECT_EQ(textOf<std::runtime_error>([&] { pollUntil(client, [] { return false; }); }), "mine");
  sendReport(server, client, 2);
  EXPECT_EQ(calls, 1);
}

TEST(Subscription, ItMayOutliveTheClient) {
  ScriptedServer server;
  ScopedSubscription scoped;
  Subscription plain;
  {
    Client client(server.tcpName());
    scoped = client.onForce([](const ForceReport&) {});
    plain = client.onConnection([](const ConnectionReport&) {});
    Client moved = std::move(client);
    EXPECT_TRUE(scoped.active());
  }
  EXPECT_FALSE(scoped.active());
  plain.end();
  Subscription().end();
}

}  // namespace
}  // namespace hapticd::test
