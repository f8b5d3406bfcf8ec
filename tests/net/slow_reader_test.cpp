// A peer that reads late or never: what it is sent stays bounded, in order, and harms nobody else.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <thread>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

constexpr std::size_t kRecordBytes = 1024;
constexpr int kSmallBuffer = 16 * 1024;

ConnectionOptions tightOptions() {
  return {.lowMarkBytes = 32 * 1024, .hardLimitBytes = 256 * 1024, .sendBufferBytes = kSmallBuffer};
}

/// A record of fixed size: 'R' or 'L', a number, filling.
std::shared_ptr<const Buffer> record(Delivery delivery, int number) {
  std::string text = (delivery == Delivery::reliable ? "R" : "L") + std::to_string(number) + ' ';
  text.resize(kRecordBytes, '.');
  return bufferOf(text);
}

/// The kind and the number of a record, ('?', 0) for a torn one.
std::pair<char, int> parseRecord(const std::string& text) {
  const std::size_t space = text.find(' ');
  if (text.size() != kRecordBytes || space > 8 ||
      text.find_first_not_of('.', space + 1) != std::string::npos) {
    ADD_FAILURE() << "a torn record: " << text.substr(0, 40);
    return {'?', 0};
  }
  return {text[0], std::stoi(text.substr(1))};
}

bool isServed(Server& server, Loop& loop) {
  RawSocket other = server.join();
  return other.send("hello") && pumpUntil(loop, [&] { return server.last().received == "hello"; }) &&
         other.receive(5) == "hello";
}

TEST(SlowReader, LosesLowLatencyRecordsOnlyAndGetsTheRestInOrder) {
  Loop loop;
  Server server(loop, tightOptions(), true);
  RawSocket slow = server.join(kSmallBuffer);
  Connection& connection = server.last().connection;
  int reliable = 0;
  int lowLatency = 0;
  while (connection.statistics().droppedBuffers < 100 && lowLatency < 100'000) {
    for (int i = 0; i < 10; ++i) {
      connection.send(record(Delivery::lowLatency, lowLatency++), Delivery::lowLatency);
    }
    if (reliable < 100) {
      connection.send(record(Delivery::reliable, reliable++));
    }
    connection.flush();
  }
  const std::uint64_t dropped = connection.statistics().droppedBuffers;
  ASSERT_GE(dropped, 100u);
  EXPECT_EQ(connection.statistics().droppedBytes, dropped * kRecordBytes);
  EXPECT_LE(connection.statistics().queuedBytes, (32u + 100u + 1u) * 1024);
  EXPECT_TRUE(isServed(server, loop));
  ASSERT_TRUE(server.sessions[0]->connection.isOpen());

  std::vector<int> gotReliable;
  std::vector<int> gotLowLatency;
  std::thread reader([&] {
    for (std::string text; !(text = slow.receive(kRecordBytes)).empty();) {
      const auto [kind, number] = parseRecord(text);
      (kind == 'R' ? gotReliable : gotLowLatency).push_back(number);
    }
    slow.close();
  });
  connection.close("done");
  const bool closed = pumpUntil(loop, [&] { return !server.sessions[0]->closed.empty(); });
  reader.join();
  ASSERT_TRUE(closed);
  EXPECT_EQ(gotLowLatency.size() + dropped, static_cast<std::size_t>(lowLatency));
  ASSERT_EQ(gotReliable.size(), static_cast<std::size_t>(reliable));
  for (int i = 0; i < reliable; ++i) {
    ASSERT_EQ(gotReliable[static_cast<std::size_t>(i)], i);
  }
  EXPECT_TRUE(std::is_sorted(gotLowLatency.begin(), gotLowLatency.end()));
  EXPECT_EQ(gotLowLatency.back(), lowLatency - 1) << "the newest state is the one to keep";
}

// With a limit of unsent bytes a reader that was behind gets the newest record after what was under way
// already.
TEST(SlowReader, GetsTheNewestRecordInsteadOfAQueue) {
  Loop loop;
  Server server(loop, {.unsentLimitBytes = kSmallBuffer}, true);
  RawSocket slow = server.join(kSmallBuffer);
  Connection& connection = server.last().connection;
  int sent = 0;
  while (sent < 1000) {
    connection.send(record(Delivery::lowLatency, sent++), Delivery::lowLatency);
    connection.flush();
  }
  EXPECT_LE(connection.statistics().queuedBytes, 2 * kRecordBytes) << "the newest, and a partly sent one";
  std::vector<int> got;
  std::thread reader([&] {
    for (std::string text; !(text = slow.receive(kRecordBytes)).empty();) {
      got.push_back(parseRecord(text).second);
    }
    slow.close();
  });
  connection.close("done");
  const bool closed = pumpUntil(loop, [&] { return !server.sessions[0]->closed.empty(); });
  reader.join();
  ASSERT_TRUE(closed);
  EXPECT_LT(got.size(), 400u);
  EXPECT_EQ(got.back(), sent - 1);
}

TEST(SlowReader, IsClosedWithAReasonAboveTheHardLimit) {
  Loop loop;
  Server server(loop, tightOptions(), true);
  RawSocket slow = server.join(kSmallBuffer);
  Server::Session& session = server.last();
  std::size_t mostQueued = 0;
  for (int i = 0; session.connection.isOpen() && i < 100'000; ++i) {
    session.connection.send(record(Delivery::reliable, i));
    session.connection.flush();
    mostQueued = std::max(mostQueued, session.connection.statistics().queuedBytes);
  }
  EXPECT_FALSE(session.connection.isOpen());
  EXPECT_LE(mostQueued, 256u * 1024);
  EXPECT_EQ(session.closed, "") << "called back from inside send()";
  ASSERT_TRUE(pumpUntil(loop, [&] { return !session.closed.empty(); }));
  EXPECT_EQ(session.closed, "the peer does not read: 262656 bytes wait for it, the limit is 262144");
  EXPECT_TRUE(isServed(server, loop));
}

TEST(SlowReader, ABurstAboveTheLimitIsFineWhenTheSystemTakesIt) {
  Loop loop;
  Server server(loop, {.hardLimitBytes = 10'000});
  RawSocket peer = server.join();
  for (int i = 0; i < 40; ++i) {
    server.last().connection.send(record(Delivery::reliable, i));
  }
  server.last().connection.flush();
  for (int i = 0; i < 40; ++i) {
    EXPECT_EQ(parseRecord(peer.receive(kRecordBytes)), std::pair('R', i));
  }
  EXPECT_TRUE(server.last().connection.isOpen());
}

TEST(SlowReader, TellsWhenTheQueueIsEmptyAgain) {
  Loop loop;
  Server server(loop);
  int drained = 0;
  Connection sender = Connection::connect(loop, server.listener.local(), std::chrono::seconds(20));
  sender.start({.onConnected = {}, .onBytes = {}, .onDrained = [&] { ++drained; }, .onClosed = {}});
  sender.send(bytesOf("small"));
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.sessions.empty() && server.last().received == "small"; }));
  EXPECT_EQ(drained, 0);
  sender.send(bytesOf(std::string(8'000'000, 'l')));
  sender.flush();
  ASSERT_TRUE(pumpUntil(loop, [&] { return drained > 0; }));
  EXPECT_EQ(sender.statistics().queuedBytes, 0u);
  EXPECT_EQ(drained, 1);
}

// Long enough for the system to close the window, to probe it and to get no answer to the second probe.
TEST(SlowReader, StaysConnectedHoweverLongItDoesNotRead) {
  Loop loop;
  ConnectionOptions options = tightOptions();
  options.lossTimeout = std::chrono::milliseconds(500);
  options.keepAlive = std::chrono::seconds(1);
  Server server(loop, options);
  RawSocket slow = server.join(kSmallBuffer);
  Connection& connection = server.last().connection;
  connection.send(record(Delivery::reliable, 0));
  int lowLatency = 0;
  const Subscription reports = loop.every(std::chrono::milliseconds(1), [&] {
    connection.send(record(Delivery::lowLatency, lowLatency++), Delivery::lowLatency);
    connection.flush();
  });
  loop.runFor(std::chrono::milliseconds(2500));
  EXPECT_TRUE(connection.isOpen());
  EXPECT_GT(connection.statistics().droppedBuffers, 0u);
  EXPECT_EQ(server.last().closed, "");
  EXPECT_EQ(parseRecord(slow.receive(kRecordBytes)), std::pair('R', 0));
  EXPECT_EQ(parseRecord(slow.receive(kRecordBytes)), std::pair('L', 0));
}

// Small messages use up a small receive buffer long before its window is full: the peer's system discards
// bytes in flight, closes the window and answers every repetition.
TEST(SlowReader, StaysConnectedHoweverLittleMemoryItHas) {
  Loop loop;
  ConnectionOptions options;
  options.lossTimeout = std::chrono::milliseconds(200);
  options.keepAlive = std::chrono::seconds(1);
  Server server(loop, options);
  std::vector<RawSocket> peers;
  std::vector<int> buffers{2 * 1024, 4 * 1024, 8 * 1024, 8 * 1024, 16 * 1024, 64 * 1024};
  auto time = std::chrono::milliseconds(2500);
  if (std::getenv("HAPTICD_LONG") != nullptr) {
    buffers.insert(buffers.end(), {256 * 1024, 6 * 1024 * 1024});
    while (buffers.size() < 40) buffers.push_back(buffers[buffers.size() - 8]);
    time = std::chrono::seconds(60);
  }
  for (const int buffer : buffers) peers.push_back(server.join(buffer));
  const auto report = bufferOf(std::string(150, 'x'));
  const Subscription reports = loop.every(std::chrono::milliseconds(1), [&] {
    for (const auto& session : server.sessions) {
      for (int i = 0; i < 4; ++i) session->connection.send(report, Delivery::lowLatency);
      session->connection.flush();
    }
  });
  loop.runFor(time);
  for (const auto& session : server.sessions) EXPECT_EQ(session->closed, "");
}

}  // namespace
}  // namespace hapticd::net
