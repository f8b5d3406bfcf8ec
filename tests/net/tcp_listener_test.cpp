#include "net/tcp_listener.h"

#include <gtest/gtest.h>

#include <optional>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

std::string listenError(Loop& loop, const Endpoint& local) {
  try {
    const TcpListener listener(loop, local, [](Connection) {});
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(TcpListener, TellsThePortItGot) {
  Loop loop;
  const Server server(loop);
  EXPECT_EQ(server.listener.local().address, kLoopbackAddress);
  EXPECT_NE(server.listener.local().port, 0);
}

TEST(TcpListener, NamesThePortInUseAndTheRemedy) {
  Loop loop;
  const Server server(loop);
  const Endpoint local = server.listener.local();
  EXPECT_EQ(listenError(loop, local), "cannot listen on TCP " + local.text() + ": port " +
                                          std::to_string(local.port) +
                                          " is in use by another program: choose another with --listen");
}

TEST(TcpListener, NamesAnAddressOfAnotherMachine) {
  Loop loop;
  EXPECT_EQ(listenError(loop, {0xc0000201, 0}),  // 192.0.2.1 is reserved for documentation
            "cannot listen on TCP 192.0.2.1:0: 192.0.2.1 is not an address of this machine: choose one with "
            "--listen (0.0.0.0 for all)");
}

TEST(TcpListener, ThePortIsFreeAfterDestructionAlsoWithinItsCallback) {
  Loop loop;
  std::unique_ptr<TcpListener> listener;
  bool accepted = false;
  listener = std::make_unique<TcpListener>(loop, kAnyPort, [&](Connection) {
    listener.reset();
    accepted = true;
  });
  const Endpoint local = listener->local();
  const RawSocket first = RawSocket::connected(local);
  const RawSocket second = RawSocket::connected(local);
  ASSERT_TRUE(pumpUntil(loop, [&] { return accepted; }));
  const TcpListener again(loop, local, [](Connection) {});
  EXPECT_EQ(again.local(), local);
}

// Its address decides who may come in, and stands in the log.
TEST(TcpListener, KnowsTheAddressOfAPeerThatIsGoneAlready) {
  Loop loop;
  std::optional<Endpoint> remote;
  const TcpListener listener(loop, kAnyPort,
                             [&](const Connection& connection) { remote = connection.remote(); });
  RawSocket::connectedFrom(7, listener.local()).reset();
  ASSERT_TRUE(pumpUntil(loop, [&] { return remote.has_value(); }));
  EXPECT_EQ(remote->addressText(), "127.0.0.7");
  EXPECT_NE(remote->port, 0);
}

TEST(TcpListener, AcceptsEverythingThatWaitedWhileTheLoopDidNotRun) {
  Loop loop;
  Server server(loop);
  std::vector<RawSocket> peers;
  for (int i = 0; i < 100; ++i) {
    peers.push_back(RawSocket::connected(server.listener.local()));
  }
  EXPECT_TRUE(pumpUntil(loop, [&] { return server.sessions.size() == peers.size(); }));
}

TEST(TcpListener, AnExceptionInTheCallbackEndsThatConnectionOnly) {
  Loop loop;
  std::string error;
  loop.setErrorHandler([&](std::string_view text) { error = text; });
  int accepted = 0;
  const TcpListener listener(loop, kAnyPort, [&](Connection) {
    if (++accepted == 1) {
      throw std::runtime_error("no room");
    }
  });
  RawSocket first = RawSocket::connected(listener.local());
  ASSERT_TRUE(pumpUntil(loop, [&] { return !error.empty(); }));
  EXPECT_EQ(error, "no room");
  EXPECT_EQ(first.receive(1), "");
  const RawSocket second = RawSocket::connected(listener.local());
  EXPECT_TRUE(pumpUntil(loop, [&] { return accepted == 2; }));
}

#ifndef HAPTICD_SANITIZED
TEST(TcpListener, OutOfDescriptorsItTellsAndAcceptsLater) {
  Loop loop;
  std::string error;
  loop.setErrorHandler([&](std::string_view text) { error = text; });
  Server server(loop);
  const RawSocket peer = RawSocket::connected(server.listener.local());
  {
    const NoDescriptors none;
    ASSERT_TRUE(pumpUntil(loop, [&] { return !error.empty(); }));
  }
  EXPECT_EQ(error,
            "cannot accept a connection on " + server.listener.local().text() + ": Too many open files");
  EXPECT_TRUE(pumpUntil(loop, [&] { return server.sessions.size() == 1; }));
}
#endif

}  // namespace
}  // namespace hapticd::net
