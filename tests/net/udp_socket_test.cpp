#include "net/udp_socket.h"

#include <gtest/gtest.h>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

struct Received {
  std::string text;
  Endpoint from;
};

/// A socket that keeps what it receives.
struct Keeper {
  explicit Keeper(Loop& loop) : socket(loop, kAnyPort) {
    socket.start({.onDatagram =
                      [this](std::span<const std::byte> bytes, const Endpoint& from) {
                        received.push_back({textOf(bytes), from});
                      },
                  .onRefused = [this] { ++refused; }});
  }
  UdpSocket socket;
  std::vector<Received> received;
  int refused = 0;
};

TEST(UdpSocket, DatagramsOfAllSizesArriveWholeWithTheirSender) {
  Loop loop;
  Keeper from(loop);
  Keeper to(loop);
  for (const std::size_t size : {0u, 1u, 24u, 1472u, 1473u, 9000u, 65507u}) {
    const std::string text(size, static_cast<char>('a' + size % 26));
    ASSERT_TRUE(from.socket.sendTo(bytesOf(text), to.socket.local())) << size;
    const std::size_t before = to.received.size();
    ASSERT_TRUE(pumpUntil(loop, [&] { return to.received.size() > before; })) << size;
    EXPECT_EQ(to.received.back().text, text) << size;
    EXPECT_EQ(to.received.back().from, from.socket.local());
  }
  EXPECT_EQ(to.socket.statistics().datagramsIn, 7u);
  EXPECT_EQ(from.socket.statistics().bytesOut, to.socket.statistics().bytesIn);
}

TEST(UdpSocket, ADatagramThatCannotBeSentIsCountedAndHarmsNothing) {
  Loop loop;
  Keeper from(loop);
  Keeper to(loop);
  EXPECT_FALSE(from.socket.sendTo(bytesOf(std::string(65508, 'x')), to.socket.local()));
  EXPECT_EQ(from.socket.statistics().dropped, 1u);
  EXPECT_TRUE(from.socket.sendTo(bytesOf("next"), to.socket.local()));
  ASSERT_TRUE(pumpUntil(loop, [&] { return to.received.size() == 1; }));
  EXPECT_EQ(to.received[0].text, "next");
}

TEST(UdpSocket, ConnectedOnesTalkBothWaysAndHearNobodyElse) {
  Loop loop;
  Keeper one(loop);
  Keeper two(loop);
  Keeper stranger(loop);
  one.socket.connect(two.socket.local());
  two.socket.connect(one.socket.local());
  EXPECT_TRUE(stranger.socket.sendTo(bytesOf("stranger"), one.socket.local()));
  EXPECT_TRUE(one.socket.send(bytesOf("ping")));
  ASSERT_TRUE(pumpUntil(loop, [&] { return !two.received.empty(); }));
  EXPECT_TRUE(two.socket.send(bytesOf("pong")));
  ASSERT_TRUE(pumpUntil(loop, [&] { return !one.received.empty(); }));
  EXPECT_EQ(one.received.size(), 1u);
  EXPECT_EQ(one.received[0].text, "pong");
}

TEST(UdpSocket, ARefusedPeerIsAnEventAndTheSocketLivesOn) {
  Loop loop;
  Keeper one(loop);
  RawSocket other(SOCK_DGRAM);
  const Endpoint peer = other.bindToAnyPort();
  other.close();
  one.socket.connect(peer);
  EXPECT_TRUE(one.socket.send(bytesOf("into the void")));
  ASSERT_TRUE(pumpUntil(loop, [&] { return one.refused > 0; }));
  EXPECT_EQ(one.socket.statistics().refused, 1u);
  // The pending answer is met by the next send instead of by a read: that datagram is sent all the same.
  EXPECT_TRUE(one.socket.send(bytesOf("again")));
  EXPECT_TRUE(one.socket.send(bytesOf("and again")));
  EXPECT_GE(one.socket.statistics().refused, 2u);
  EXPECT_EQ(one.socket.statistics().dropped, 0u);
  ASSERT_TRUE(pumpUntil(loop, [&] { return one.refused >= 3; }));
  const UdpSocket second(loop, peer);
  Keeper three(loop);
  one.socket.connect(three.socket.local());
  EXPECT_TRUE(one.socket.send(bytesOf("alive")));
  ASSERT_TRUE(pumpUntil(loop, [&] { return three.received.size() == 1; }));
}

TEST(UdpSocket, ABatchReachesEveryAddressAndSkipsTheOneThatFails) {
  Loop loop;
  Keeper from(loop);
  Keeper one(loop);
  Keeper two(loop);
  const std::string tooLong(70000, 'x');
  std::vector<std::string> texts;
  for (int i = 0; i < 150; ++i) {
    texts.push_back(i == 70 ? tooLong : "datagram " + std::to_string(i));
  }
  std::vector<Datagram> batch;
  for (std::size_t i = 0; i < texts.size(); ++i) {
    batch.push_back({bytesOf(texts[i]), i % 2 == 0 ? one.socket.local() : two.socket.local()});
  }
  EXPECT_EQ(from.socket.sendBatch(batch), 149u);
  EXPECT_EQ(from.socket.statistics().dropped, 1u);
  ASSERT_TRUE(pumpUntil(loop, [&] { return one.received.size() == 74 && two.received.size() == 75; }));
  EXPECT_EQ(one.received[1].text, "datagram 2");
  EXPECT_EQ(two.received[74].text, "datagram 149");
}

TEST(UdpSocket, ExceptionsGoToTheErrorHandlerAndTheNextDatagramComes) {
  Loop loop;
  std::string error;
  loop.setErrorHandler([&](std::string_view text) { error = text; });
  int count = 0;
  UdpSocket socket(loop, kAnyPort);
  socket.start({.onDatagram =
                    [&](std::span<const std::byte>, const Endpoint&) {
                      if (++count == 1) {
                        throw std::runtime_error("bad datagram");
                      }
                    },
                .onRefused = {}});
  Keeper from(loop);
  from.socket.sendTo(bytesOf("1"), socket.local());
  from.socket.sendTo(bytesOf("2"), socket.local());
  ASSERT_TRUE(pumpUntil(loop, [&] { return count == 2; }));
  EXPECT_EQ(error, "bad datagram");
}

TEST(UdpSocket, MayBeDestroyedInItsCallback) {
  Loop loop;
  Keeper from(loop);
  auto socket = std::make_unique<UdpSocket>(loop, kAnyPort);
  const auto token = std::make_shared<int>(0);
  socket->start({.onDatagram =
                     [&socket, token](std::span<const std::byte>, const Endpoint&) {
                       socket.reset();
                       ++*token;
                     },
                 .onRefused = {}});
  const Endpoint to = socket->local();
  from.socket.sendTo(bytesOf("1"), to);
  from.socket.sendTo(bytesOf("2"), to);
  ASSERT_TRUE(pumpUntil(loop, [&] { return socket == nullptr; }));
  loop.runFor(std::chrono::milliseconds(2));
  EXPECT_EQ(*token, 1);
  EXPECT_EQ(token.use_count(), 1);
}

TEST(UdpSocket, NamesThePortInUse) {
  Loop loop;
  const UdpSocket socket(loop, kAnyPort);
  try {
    const UdpSocket second(loop, socket.local());
    FAIL() << "two sockets share a port";
  } catch (const Error& error) {
    EXPECT_NE(std::string(error.what()).find("cannot listen on UDP " + socket.local().text()),
              std::string::npos);
    EXPECT_NE(std::string(error.what()).find("--listen"), std::string::npos);
  }
}

}  // namespace
}  // namespace hapticd::net
