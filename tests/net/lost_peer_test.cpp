// A peer that vanishes without a word: its system answers nothing any more.
#include <gtest/gtest.h>
#include <linux/filter.h>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

constexpr char kLost[] = "the peer is lost: it acknowledged nothing in time";

/// As if the cable were cut: the system drops all that comes for this socket, unanswered.
void vanish(const RawSocket& socket) {
  sock_filter dropAll = BPF_STMT(BPF_RET | BPF_K, 0);
  const sock_fprog program{1, &dropAll};
  ASSERT_EQ(::setsockopt(socket.fd(), SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program), 0)
      << std::strerror(errno);
}

ConnectionOptions quickOptions() {
  return {.lossTimeout = milliseconds(200), .keepAlive = std::chrono::seconds(1)};
}

TEST(LostPeer, IsNoticedWhenItDoesNotAcknowledge) {
  Loop loop;
  Server server(loop, quickOptions());
  const RawSocket peer = server.join();
  vanish(peer);
  server.last().connection.send(bytesOf("are you there?"));
  server.last().connection.flush();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, kLost);
}

TEST(LostPeer, IsNoticedByProbesWhenNothingIsSaid) {
  Loop loop;
  Server server(loop, quickOptions());
  const RawSocket peer = server.join();
  vanish(peer);
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, kLost);
}

TEST(LostPeer, IsNoticedWhileItsWindowIsClosed) {
  Loop loop;
  ConnectionOptions options = quickOptions();
  options.sendBufferBytes = 16 * 1024;
  Server server(loop, options);
  const RawSocket peer = server.join(16 * 1024);
  Connection& connection = server.last().connection;
  connection.send(bytesOf(std::string(500'000, 'x')));
  connection.flush();
  loop.runFor(milliseconds(300));
  ASSERT_TRUE(connection.isOpen());
  vanish(peer);
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, kLost);
}

TEST(LostPeer, WhatItSentBeforeIsStillRead) {
  Loop loop;
  Server server(loop, quickOptions());
  RawSocket peer = server.join();
  Connection& connection = server.last().connection;
  connection.pauseReading();
  const std::string upload(30'000, 'u');
  ASSERT_TRUE(peer.send(upload));
  vanish(peer);
  connection.send(bytesOf("a report"));
  connection.flush();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !connection.isOpen(); }));
  connection.resumeReading();
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().received, upload);
  EXPECT_EQ(server.last().closed, kLost);
}

TEST(LostPeer, TheWatchMayBeginLater) {
  Loop loop;
  Server server(loop);
  const RawSocket peer = server.join();
  Connection& connection = server.last().connection;
  vanish(peer);
  connection.send(bytesOf("are you there?"));
  connection.flush();
  loop.runFor(milliseconds(300));
  EXPECT_TRUE(connection.isOpen());
  connection.setLossDetection(milliseconds(100), std::chrono::seconds(0));
  ASSERT_TRUE(pumpUntil(loop, [&] { return !server.last().closed.empty(); }));
  EXPECT_EQ(server.last().closed, kLost);
}

}  // namespace
}  // namespace hapticd::net
