#include "net/connection.h"

#include <gtest/gtest.h>
#include <netinet/tcp.h>

#include <algorithm>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

#ifdef HAPTICD_SANITIZED
constexpr std::size_t kMany = 20;
#else
constexpr std::size_t kMany = 200;
#endif

/// An outgoing connection that keeps what happens to it.
struct Client {
  Client(Loop& loop, const Endpoint& peer, milliseconds timeout = milliseconds(20000))
      : connection(Connection::connect(loop, peer, timeout)) {
    connection.start({.onConnected = [this] { connected = true; },
                      .onBytes = [this](std::span<const std::byte> bytes) { received += textOf(bytes); },
                      .onDrained = {},
                      .onClosed =
                          [this](const std::string& reason) {
                            closed = reason;
                            ++closedCalls;
                          }});
  }
  Connection connection;
  bool connected = false;
  std::string received;
  std::string closed;
  int closedCalls = 0;
};

int option(int fd, int level, int name) {
  int value = -1;
  socklen_t size = sizeof value;
  EXPECT_EQ(::getsockopt(fd, level, name, &value, &size), 0);
  return value;
}

TEST(Connection, EchoesBothWaysAndCounts) {
  Loop loop;
  Server server(loop, {}, true);
  Client client(loop, server.listener.local());
  client.connection.send(bytesOf("queued while connecting"));
  ASSERT_TRUE(pumpUntil(loop, [&] { return client.received == "queued while connecting"; }));
  EXPECT_TRUE(client.connected);
  EXPECT_EQ(client.connection.remote(), server.listener.local());
  EXPECT_EQ(client.connection.local(), server.last().connection.remote());
  const ConnectionStatistics there = server.last().connection.statistics();
  EXPECT_EQ(there.bytesIn, 23u);
  EXPECT_EQ(there.bytesOut, 23u);
  EXPECT_EQ(there.queuedBytes, 0u);
  EXPECT_EQ(there.droppedBuffers, 0u);
}

TEST(Connection, SendWaitsForFlush) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  Connection& connection = server.last().connection;
  for (int i = 0; i < 200; ++i) {  // more parts than one system call takes
    connection.send(bytesOf("part;"));
  }
  EXPECT_EQ(connection.statistics().queuedBytes, 1000u);
  EXPECT_EQ(connection.statistics().bytesOut, 0u);
  connection.flush();
  EXPECT_EQ(connection.statistics().queuedBytes, 0u);
  EXPECT_EQ(connection.statistics().bytesOut, 1000u);
  EXPECT_EQ(peer.receive(1000).size(), 1000u);
}

TEST(Connection, MegabytesArriveInOrder) {
  Loop loop;
  Server server(loop, {}, true);
  Client client(loop, server.listener.local());
  std::string text;
  while (text.size() < 3'000'000) {
    text += std::to_string(text.size()) + ' ';
  }
  client.connection.send(bytesOf(text));
  client.connection.flush();
  ASSERT_TRUE(
      pumpUntil(loop, [&] { return client.received.size() >= text.size() || !client.closed.empty(); }));
  EXPECT_TRUE(client.received == text);
}

TEST(Connection, ManyAtOnceAreServed) {
  Loop loop;
  Server server(loop, {}, true);
  std::vector<std::unique_ptr<Client>> clients;
  for (std::size_t i = 0; i < kMany; ++i) {
    clients.push_back(std::make_unique<Client>(loop, server.listener.local()));
    clients.back()->connection.send(bytesOf("client " + std::to_string(1000 + i)));
  }
  ASSERT_TRUE(pumpUntil(loop, [&] {
    return std::all_of(clients.begin(), clients.end(),
                       [](const auto& c) { return c->received.size() == 11; });
  }));
  for (std::size_t i = 0; i < kMany; ++i) {
    EXPECT_EQ(clients[i]->received, "client " + std::to_string(1000 + i));
  }
}

TEST(Connection, OneBufferIsSharedByAllConnections) {
  Loop loop;
  Server server(loop);
  std::vector<RawSocket> peers;
  for (std::size_t i = 0; i < kMany; ++i) {
    peers.push_back(server.join());
  }
  const auto batch = bufferOf(std::string(1000, 'b'));
  for (const auto& session : server.sessions) {
    session->connection.send(batch, Delivery::lowLatency);
  }
  EXPECT_EQ(batch.use_count(), static_cast<long>(1 + kMany));
  for (const auto& session : server.sessions) {
    session->connection.flush();
  }
  EXPECT_EQ(batch.use_count(), 1);
  for (RawSocket& peer : peers) {
    EXPECT_EQ(peer.receive(1000), std::string(1000, 'b'));
  }
}

TEST(Connection, AHalfClosedPeerGetsTheAnswerToItsLastBytes) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  Server::Session& session = server.last();
  session.connection.start(
      {.onConnected = {},
       .onBytes = [&](std::span<const std::byte> bytes) { session.connection.send(bytes); },  // no flush
       .onDrained = {},
       .onClosed = [&](const std::string& reason) { session.closed = reason; }});
  ASSERT_TRUE(peer.send("last words"));
  peer.shutdownSend();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, "closed by the peer");
  EXPECT_FALSE(server.last().connection.isOpen());
  EXPECT_EQ(server.last().connection.statistics().bytesIn, 10u);
  EXPECT_EQ(peer.receive(100), "last words");
}

// As a tunnel needs it: its client must not believe that all has arrived before the server says so.
class HalfClosedPeer : public ::testing::Test {
 protected:
  HalfClosedPeer() {
    server_.last().connection.start(
        {.onBytes = [this](std::span<const std::byte> bytes) { server_.last().received += textOf(bytes); },
         .onPeerEnded = [this] { ++ends_; },
         .onClosed = [this](const std::string& reason) { server_.last().closed = reason; }});
    EXPECT_TRUE(peer_.send("the end of an upload"));
    peer_.shutdownSend();
    EXPECT_TRUE(pumpUntil(loop_, [&] { return ends_ > 0; }));
    for (int i = 0; i < 3; ++i) loop_.runOnce(milliseconds(1));
    EXPECT_EQ(ends_, 1);
    EXPECT_EQ(server_.last().received, "the end of an upload");
    EXPECT_EQ(server_.last().closed, "");
    EXPECT_TRUE(server_.last().connection.isOpen());
  }
  bool closed() {
    return pumpUntil(loop_, [&] { return !server_.last().closed.empty(); });
  }

  Loop loop_;
  Server server_{loop_};
  RawSocket peer_ = server_.join();
  int ends_ = 0;
};

TEST_F(HalfClosedPeer, KeepsItsConnectionUntilClose) {
  server_.last().connection.send(bytesOf("an answer"));
  server_.last().connection.close("all has arrived");
  ASSERT_TRUE(closed());
  EXPECT_EQ(server_.last().closed, "all has arrived");
  EXPECT_EQ(peer_.receiveSome(), "an answer");
  EXPECT_EQ(peer_.receiveSome(), "");
}

TEST_F(HalfClosedPeer, ThatIsGoneEndsItsConnectionByTheNextBytes) {
  peer_.close();
  ASSERT_TRUE(pumpUntil(loop_, [&] {
    server_.last().connection.send(bytesOf("a report"));
    server_.last().connection.flush();
    loop_.runOnce(milliseconds(1));
    return !server_.last().closed.empty();
  }));
  EXPECT_EQ(server_.last().closed, "connection reset by the peer");
}

TEST(Connection, AResetHasAReason) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  peer.reset();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, "connection reset by the peer");
}

TEST(Connection, WhatAPeerSentBeforeItsResetIsStillRead) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  Connection& connection = server.last().connection;
  connection.pauseReading();
  connection.send(bytesOf("a report that the peer never reads"));
  connection.flush();
  const std::string upload(30'000, 'u');
  ASSERT_TRUE(peer.send(upload));
  peer.close();  // with unread bytes: a reset, which the next write meets first
  for (int i = 0; i < 3; ++i) {
    connection.send(bytesOf("more"));
    connection.flush();
  }
  EXPECT_FALSE(connection.isOpen());
  connection.resumeReading();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().received, upload);
  EXPECT_EQ(server.last().closed, "connection reset by the peer");
}

TEST(Connection, PausedReadingHoldsBytesBackUntilResumed) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  Server::Session& session = server.last();
  ASSERT_TRUE(peer.send("one"));
  ASSERT_TRUE(pumpUntil(loop, [&] { return session.received == "one"; }));
  session.connection.pauseReading();
  ASSERT_TRUE(peer.send("two"));
  // A later round trip on another connection shows that the loop had the chance to read "two".
  RawSocket other = server.join();
  ASSERT_TRUE(other.send("x"));
  ASSERT_TRUE(pumpUntil(loop, [&] { return server.last().received == "x"; }));
  EXPECT_EQ(session.received, "one");
  session.connection.resumeReading();
  ASSERT_TRUE(pumpUntil(loop, [&] { return session.received == "onetwo"; }));
}

TEST(Connection, PausingInsideTheCallbackHoldsBackTheRest) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  Connection& connection = server.last().connection;
  std::size_t received = 0;
  connection.start({.onConnected = {},
                    .onBytes =
                        [&](std::span<const std::byte> bytes) {
                          received += bytes.size();
                          connection.pauseReading();
                        },
                    .onDrained = {},
                    .onClosed = {}});
  // The peer's writes end when the buffers of the system are full: nothing grows here meanwhile.
  const std::string chunk(64 * 1024, 'c');
  std::size_t sent = 0;
  for (ssize_t size = 0; (size = ::send(peer.fd(), chunk.data(), chunk.size(), MSG_DONTWAIT)) > 0;) {
    sent += static_cast<std::size_t>(size);
  }
  ASSERT_TRUE(pumpUntil(loop, [&] { return received > 0; }));
  EXPECT_LE(received, 256u * 1024);
  while (received < sent) {
    const std::size_t before = received;
    connection.resumeReading();
    ASSERT_TRUE(pumpUntil(loop, [&] { return received > before; }));
    ASSERT_LE(received - before, 256u * 1024);
  }
  EXPECT_EQ(received, sent);
}

TEST(Connection, AnExceptionInACallbackEndsThatConnectionOnly) {
  Loop loop;
  Server server(loop, {}, true);
  RawSocket victim = server.join();
  Server::Session& session = server.last();
  session.connection.start(
      {.onConnected = {},
       .onBytes = [](std::span<const std::byte>) { throw std::runtime_error("bad length 7"); },
       .onDrained = {},
       .onClosed = [&](const std::string& reason) { session.closed = reason; }});
  RawSocket other = server.join();
  ASSERT_TRUE(victim.send("x"));
  ASSERT_TRUE(pumpUntil(loop, [&] { return !session.closed.empty(); }));
  EXPECT_EQ(session.closed, "error while handling the connection: bad length 7");
  EXPECT_EQ(victim.receive(1), "");
  ASSERT_TRUE(other.send("still here"));
  ASSERT_TRUE(pumpUntil(loop, [&] { return server.last().received == "still here"; }));
}

TEST(Connection, CloseSendsWhatIsQueuedAndWaitsForThePeer) {
  Loop loop;
  Server server(loop);
  Client client(loop, server.listener.local());
  ASSERT_TRUE(pumpUntil(loop, [&] { return client.connected && server.sessions.size() == 1; }));
  const std::string farewell(3'000'000, 'f');
  Connection& connection = server.last().connection;
  client.connection.send(bytesOf("never looked at"));
  client.connection.flush();
  connection.send(bytesOf(farewell));
  connection.close("the server stops");
  EXPECT_FALSE(connection.isOpen());
  EXPECT_EQ(server.last().closed, "") << "called back from inside close()";
  connection.send(bytesOf("too late"));
  connection.flush();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !client.closed.empty() && !server.last().closed.empty(); }));
  EXPECT_EQ(client.received.size(), farewell.size());
  EXPECT_EQ(client.closed, "closed by the peer");
  EXPECT_EQ(server.last().closed, "the server stops");
  EXPECT_EQ(server.last().received, "");
}

TEST(Connection, CloseOfAPeerThatNeverReadsEndsAfterItsTime) {
  Loop loop;
  Server server(loop, {.closeTimeout = milliseconds(20), .sendBufferBytes = 16 * 1024});
  RawSocket peer = server.join();
  Connection& connection = server.last().connection;
  connection.send(bytesOf(std::string(8'000'000, 'f')));
  connection.close("the server stops");
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, "the server stops");
  EXPECT_EQ(connection.nativeHandle(), -1);
}

TEST(Connection, AbortResetsThePeerAndTellsOnce) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  server.last().connection.abort("kicked");
  server.last().connection.abort("again");
  server.last().connection.close("and again");
  EXPECT_EQ(server.last().closed, "");
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, "kicked");
  char byte = 0;
  EXPECT_EQ(::recv(peer.fd(), &byte, 1, 0), -1);
  EXPECT_EQ(errno, ECONNRESET);
}

TEST(Connection, DestroyingItClosesTheSocketWithoutACallback) {
  Loop loop;
  Server server(loop);
  RawSocket peer = server.join();
  server.last().connection = Connection();
  EXPECT_EQ(peer.receive(1), "");
  loop.runFor(milliseconds(2));
  EXPECT_EQ(server.last().closed, "");
  EXPECT_FALSE(server.last().connection.isOpen());
}

TEST(Connection, TellsThatTheConnectionWasRefused) {
  Loop loop;
  RawSocket silent;
  const Endpoint peer = silent.bindToAnyPort();  // bound, yet not listening
  Client client(loop, peer);
  EXPECT_EQ(client.closed, "");
  ASSERT_TRUE(pumpUntil(loop, [&] { return !client.closed.empty(); }));
  EXPECT_EQ(client.closed, "cannot connect to " + peer.text() + ": Connection refused");
  EXPECT_FALSE(client.connected);
  EXPECT_EQ(client.closedCalls, 1);
}

TEST(Connection, GivesUpWhenThePeerDoesNotAnswerAndTheLoopGoesOnMeanwhile) {
  Loop loop;
  RawSocket listener;
  const Endpoint peer = listener.bindToAnyPort();
  ASSERT_EQ(::listen(listener.fd(), 0), 0);
  const RawSocket filler = RawSocket::connected(peer);  // the queue is full: later attempts get no answer
  int ticks = 0;
  const Subscription ticker = loop.every(milliseconds(1), [&] { ++ticks; });
  Client client(loop, peer, milliseconds(50));
  ASSERT_TRUE(pumpUntil(loop, [&] { return !client.closed.empty(); }));
  EXPECT_EQ(client.closed, "cannot connect to " + peer.text() + ": no answer within 50 ms");
  EXPECT_GT(ticks, 0);
}

TEST(Connection, CancelledWhileConnectingItTellsNothing) {
  Loop loop;
  Server server(loop);
  auto client = std::make_unique<Client>(loop, server.listener.local());
  Client second(loop, server.listener.local());
  client.reset();
  ASSERT_TRUE(pumpUntil(loop, [&] { return second.connected; }));
}

TEST(Connection, SetsItsSocketOptions) {
  Loop loop;
  Server server(loop, {.lossTimeout = milliseconds(500), .keepAlive = std::chrono::seconds(1)});
  const RawSocket peer = server.join();
  const int fd = server.last().connection.nativeHandle();
  EXPECT_EQ(option(fd, IPPROTO_TCP, TCP_NODELAY), 1);
  EXPECT_EQ(option(fd, IPPROTO_TCP, TCP_USER_TIMEOUT), 0) << "would end a peer that does not read";
  EXPECT_EQ(option(fd, SOL_SOCKET, SO_KEEPALIVE), 1);
  EXPECT_EQ(option(fd, IPPROTO_TCP, TCP_KEEPIDLE), 1);
  EXPECT_EQ(option(fd, IPPROTO_TCP, TCP_KEEPINTVL), 1);
  server.last().connection.setLossDetection(milliseconds(750), std::chrono::seconds(0));
  EXPECT_EQ(option(fd, SOL_SOCKET, SO_KEEPALIVE), 0);
}

TEST(Connection, CountsWhatThePeerHasNotAcknowledged) {
  Loop loop;
  Server server(loop, {.sendBufferBytes = 16 * 1024});
  const RawSocket peer = server.join(4096);
  Connection& connection = server.last().connection;
  connection.send(bytesOf(std::string(500'000, 'x')));
  connection.flush();
  const ConnectionStatistics now = connection.statistics();
  EXPECT_GT(now.unacknowledgedBytes, 0u);
  EXPECT_LE(now.unacknowledgedBytes, now.bytesOut);
  EXPECT_EQ(now.bytesOut + now.queuedBytes, 500'000u);
}

// Each callback destroys its own connection and then uses what it captured.
class DestroyedIn : public testing::TestWithParam<const char*> {};

TEST_P(DestroyedIn, ItsOwnCallback) {
  const std::string where = GetParam();
  Loop loop;
  Server server(loop, {}, true);
  auto connection =
      std::make_unique<Connection>(Connection::connect(loop, server.listener.local(), milliseconds(20000)));
  const auto token = std::make_shared<std::string>();
  const auto destroyIn = [&, token](const std::string& callback) {
    if (callback == where) {
      connection.reset();
      *token += callback;
    }
  };
  connection->start({.onConnected = [destroyIn] { destroyIn("onConnected"); },
                     .onBytes =
                         [destroyIn, &server](std::span<const std::byte>) {
                           destroyIn("onBytes");
                           server.last().connection.abort("end");
                         },
                     .onDrained = [destroyIn] { destroyIn("onDrained"); },
                     .onClosed = [destroyIn](const std::string&) { destroyIn("onClosed"); }});
  if (where == "onDrained") {  // more than the system takes at once; the echo must not end it first
    connection->pauseReading();
  }
  connection->send(bytesOf(std::string(where == "onDrained" ? 8'000'000 : 1, 'x')));
  ASSERT_TRUE(pumpUntil(loop, [&] { return connection == nullptr; }));
  loop.runFor(milliseconds(2));
  EXPECT_EQ(*token, where) << "called after its destruction";
}

INSTANTIATE_TEST_SUITE_P(Connection, DestroyedIn,
                         testing::Values("onConnected", "onBytes", "onDrained", "onClosed"),
                         [](const auto& instance) { return std::string(instance.param); });

}  // namespace
}  // namespace hapticd::net
