// What every network promises: the same test bodies on real sockets and on the simulated network.
#include "net/network.h"

#include <gtest/gtest.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "net/fake_network.h"
#include "net/local_socket.h"
#include "net/loopback.h"

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

struct RealNetwork {
  Loop loop;
};

struct SimulatedNetwork {
  base::SimulatedClock clock;
  FakeNetwork network{clock};
  ScopedNetwork scope{network};
  Loop loop;
};

/// A connection that keeps what happens to it.
struct Peer {
  void take(Connection c) {
    connection = std::move(c);
    connection.start({.onConnected = [this] { connected = true; },
                      .onBytes = [this](std::span<const std::byte> bytes) { received += textOf(bytes); },
                      .onDrained = [this] { ++drained; },
                      .onPeerGone = [this](const std::string& reason) { gone = reason; },
                      .onClosed = [this](const std::string& reason) { closed = reason; }});
  }
  void send(std::string_view text) {
    connection.send(bytesOf(text));
    connection.flush();
  }

  Connection connection;
  bool connected = false;
  int drained = 0;
  std::string received;
  std::string gone;
  std::string closed;
};

template <class N>
class NetworkTest : public testing::Test {
 protected:
  void join(const ConnectionOptions& options = {}) {
    listener.emplace(
        loop(), kAnyPort, [this](Connection c) { server.take(std::move(c)); }, options);
    client.take(Connection::connect(loop(), listener->local(), milliseconds(20000), options));
    ASSERT_TRUE(until([this] { return client.connected && server.connection; }));
  }
  bool until(const std::function<bool()>& condition) { return pumpUntil(loop(), condition); }
  Loop& loop() { return net.loop; }

  N net;
  Peer client;
  Peer server;
  std::optional<TcpListener> listener;
};

using Networks = testing::Types<RealNetwork, SimulatedNetwork>;
struct NameOfNetwork {
  template <class N>
  static std::string GetName(int) {
    return std::is_same_v<N, RealNetwork> ? "Real" : "Simulated";
  }
};
TYPED_TEST_SUITE(NetworkTest, Networks, NameOfNetwork);

TYPED_TEST(NetworkTest, AUnixSocketNamesTheUserOfItsClient) {
  const std::string path = testing::TempDir() + "hapticd_network_" + std::to_string(getpid()) + ".sock";
  if constexpr (std::is_same_v<TypeParam, SimulatedNetwork>) this->net.network.localUser = geteuid();
  EXPECT_THROW(connectLocal(this->loop(), path), Error);
  std::optional<LocalListener> local;
  local.emplace(this->loop(), path, [this](Connection c) { this->server.take(std::move(c)); });
  EXPECT_THROW(LocalListener(this->loop(), path, [](Connection) {}), Error) << "somebody listens there";
  this->client.take(connectLocal(this->loop(), path));
  this->client.send("hello");
  ASSERT_TRUE(this->until([this] { return this->server.received == "hello"; }));
  EXPECT_EQ(this->server.connection.peerUser(), geteuid());
  local.reset();
  EXPECT_THROW(connectLocal(this->loop(), path), Error);
  this->server.send("goodbye");
  EXPECT_TRUE(this->until([this] { return this->client.received == "goodbye"; })) << "the connection stays";
  const LocalListener again(this->loop(), path, [](Connection) {});
}

/// Frames with a length before each, in pieces of any size.
class Frames {
 public:
  static std::string frame(const std::string& text) {
    const auto size = static_cast<std::uint32_t>(text.size());
    std::string out;
    for (int shift = 24; shift >= 0; shift -= 8) out += static_cast<char>(size >> shift & 255U);
    return out + text;
  }
  std::vector<std::string> feed(std::string_view bytes) {
    input_ += bytes;
    std::vector<std::string> frames;
    while (input_.size() >= 4) {
      std::size_t size = 0;
      for (int i = 0; i < 4; ++i)
        size = size << 8 | static_cast<unsigned char>(input_[static_cast<std::size_t>(i)]);
      if (input_.size() < 4 + size) break;
      frames.push_back(input_.substr(4, size));
      input_.erase(0, 4 + size);
    }
    return frames;
  }

 private:
  std::string input_;
};

// As VRPN begins and goes on: cookies both ways, an address for datagrams, commands by TCP and reports by
// UDP.
TYPED_TEST(NetworkTest, ACookieThenCommandsByTcpAndReportsByUdp) {
  constexpr char kCookie[] = "vrpn: ver. 07.35  0     ";
  constexpr int kCommands = 100;
  UdpSocket reports(this->loop(), kAnyPort);
  UdpSocket here(this->loop(), kAnyPort);
  std::vector<std::string> reported;
  here.start({.onDatagram =
                  [&](std::span<const std::byte> bytes, const Endpoint& from) {
                    EXPECT_EQ(from, reports.local());
                    reported.push_back(textOf(bytes));
                  },
              .onRefused = {}});
  Frames commands;
  std::string cookie;
  Connection session;
  const TcpListener listening(this->loop(), kAnyPort, [&](Connection c) {
    session = std::move(c);
    session.start({.onBytes = [&](std::span<const std::byte> bytes) {
      std::string_view rest(reinterpret_cast<const char*>(bytes.data()), bytes.size());
      const std::size_t ofCookie = std::min(rest.size(), 24 - cookie.size());
      cookie += rest.substr(0, ofCookie);
      for (const std::string& command : commands.feed(rest.substr(ofCookie))) {
        session.send(bytesOf(Frames::frame("done " + command)));
        EXPECT_TRUE(reports.sendTo(bytesOf(command), here.local()));
      }
      session.flush();
    }});
    session.send(bytesOf(kCookie));
    session.flush();
  });
  this->client.take(Connection::connect(this->loop(), listening.local(), milliseconds(20000)));
  this->client.connection.send(bytesOf(kCookie));
  std::vector<std::string> sent;
  for (int i = 0; i < kCommands; ++i) {
    sent.push_back(std::to_string(i) + std::string(static_cast<std::size_t>(i) * 7, '.'));
    this->client.connection.send(bytesOf(Frames::frame(sent.back())));
  }
  this->client.connection.flush();
  Frames answers;
  std::vector<std::string> answered;
  ASSERT_TRUE(this->until([&] {
    std::string& in = this->client.received;
    if (in.size() >= 24) {
      for (const std::string& text : answers.feed(std::string_view(in).substr(24))) answered.push_back(text);
      in.resize(24);
    }
    return answered.size() == kCommands && reported.size() == kCommands;
  }));
  EXPECT_EQ(cookie, kCookie);
  EXPECT_EQ(this->client.received, kCookie);
  EXPECT_EQ(reported, sent);
  for (std::size_t i = 0; i < sent.size(); ++i) EXPECT_EQ(answered[i], "done " + sent[i]);
}

TYPED_TEST(NetworkTest, AddressesOfBothEndsAgree) {
  this->join();
  EXPECT_EQ(this->client.connection.remote(), this->listener->local());
  EXPECT_EQ(this->client.connection.local(), this->server.connection.remote());
}

TYPED_TEST(NetworkTest, NobodyListensThere) {
  std::optional<TcpListener> gone(std::in_place, this->loop(), kAnyPort, [](Connection) {});
  const Endpoint peer = gone->local();
  gone.reset();
  this->client.take(Connection::connect(this->loop(), peer, milliseconds(20000)));
  ASSERT_TRUE(this->until([&] { return !this->client.closed.empty(); }));
  EXPECT_EQ(this->client.closed, "cannot connect to " + peer.text() + ": Connection refused");
}

TYPED_TEST(NetworkTest, APortIsGivenOnce) {
  const TcpListener first(this->loop(), kAnyPort, [](Connection) {});
  const std::string port = std::to_string(first.local().port);
  try {
    const TcpListener second(this->loop(), first.local(), [](Connection) {});
    ADD_FAILURE() << "bound twice";
  } catch (const Error& error) {
    EXPECT_EQ(std::string(error.what()), "cannot listen on TCP 127.0.0.1:" + port + ": port " + port +
                                             " is in use by another program: choose another with --listen");
  }
}

TYPED_TEST(NetworkTest, MegabytesBothWaysKeepTheirOrder) {
  this->join();
  std::string text;
  while (text.size() < 8'000'000) text += std::to_string(text.size()) + ' ';
  this->client.send(text);
  this->server.send(text);
  ASSERT_TRUE(this->until([&] {
    return this->server.received.size() >= text.size() && this->client.received.size() >= text.size();
  }));
  EXPECT_TRUE(this->server.received == text);
  EXPECT_TRUE(this->client.received == text);
  EXPECT_GT(this->client.drained, 0);
}

TYPED_TEST(NetworkTest, CloseSendsTheRestFirst) {
  this->join();
  const std::string farewell(3'000'000, 'f');
  this->server.connection.send(bytesOf(farewell));
  this->server.connection.close("the server stops");
  EXPECT_EQ(this->server.closed, "") << "called back from inside close()";
  ASSERT_TRUE(this->until([&] { return !this->client.closed.empty() && !this->server.closed.empty(); }));
  EXPECT_EQ(this->client.received.size(), farewell.size());
  EXPECT_EQ(this->client.closed, "closed by the peer");
  EXPECT_EQ(this->server.closed, "the server stops");
}

TYPED_TEST(NetworkTest, AnAbortIsAReset) {
  this->join();
  this->server.connection.abort("thrown out");
  ASSERT_TRUE(this->until([&] { return !this->client.closed.empty() && !this->server.closed.empty(); }));
  EXPECT_EQ(this->client.closed, "connection reset by the peer");
  EXPECT_EQ(this->server.closed, "thrown out");
}

TYPED_TEST(NetworkTest, ADestroyedConnectionEndsItsPeer) {
  this->join();
  this->server.connection = Connection();
  ASSERT_TRUE(this->until([&] { return !this->client.closed.empty(); }));
  EXPECT_EQ(this->client.closed, "closed by the peer");
  EXPECT_EQ(this->server.closed, "");
}

TYPED_TEST(NetworkTest, APeerThatDoesNotReadBlocksTheSender) {
  this->join({.lowMarkBytes = 64 * 1024, .hardLimitBytes = 1024 * 1024});
  this->server.connection.pauseReading();
  const auto report = bufferOf(std::string(1024, 'r'));
  Connection& sender = this->client.connection;
  for (int i = 0; i < 100'000 && sender.statistics().droppedBuffers == 0; ++i) {
    sender.send(report, Delivery::lowLatency);
    sender.flush();
  }
  EXPECT_GT(sender.statistics().droppedBuffers, 0U);
  EXPECT_TRUE(sender.isOpen());
  sender.send(bytesOf(std::string(2'000'000, 'm')));
  EXPECT_FALSE(sender.isOpen());
  ASSERT_TRUE(this->until([&] { return !this->client.closed.empty(); }));
  EXPECT_EQ(this->client.closed.find("the peer does not read: "), 0U) << this->client.closed;
}

TYPED_TEST(NetworkTest, ThePausedOwnerLearnsOfTheEndBehindUnreadBytes) {
  this->join();
  this->server.connection.pauseReading();
  this->client.send(std::string(100'000, 'u'));
  this->client.connection.close("done");
  ASSERT_TRUE(this->until([&] { return !this->server.gone.empty(); }));
  EXPECT_EQ(this->server.gone, "closed by the peer");
  EXPECT_EQ(this->server.received, "");
  this->server.connection.resumeReading();
  ASSERT_TRUE(this->until([&] { return !this->server.closed.empty(); }));
  EXPECT_EQ(this->server.received.size(), 100'000U);
}

TYPED_TEST(NetworkTest, AnExceptionInACallbackEndsThatConnection) {
  this->join();
  this->server.connection.start(
      {.onBytes = [](std::span<const std::byte>) { throw std::runtime_error("bad length 7"); },
       .onClosed = [this](const std::string& reason) { this->server.closed = reason; }});
  this->client.send("x");
  ASSERT_TRUE(this->until([&] { return !this->server.closed.empty(); }));
  EXPECT_EQ(this->server.closed, "error while handling the connection: bad length 7");
}

TYPED_TEST(NetworkTest, ADatagramToNobodyIsRefused) {
  UdpSocket socket(this->loop(), kAnyPort);
  int refused = 0;
  socket.start({.onDatagram = {}, .onRefused = [&] { ++refused; }});
  std::optional<UdpSocket> gone(std::in_place, this->loop(), kAnyPort);
  socket.connect(gone->local());
  gone.reset();
  EXPECT_TRUE(socket.send(bytesOf("anybody?")));
  ASSERT_TRUE(this->until([&] { return refused > 0; }));
  EXPECT_EQ(socket.statistics().refused, 1U);
  EXPECT_FALSE(socket.send(bytesOf(std::string(65508, 'x'))));
  EXPECT_EQ(socket.statistics().dropped, 1U);
}

TYPED_TEST(NetworkTest, TimersFireInTheirOrderAndCancelledOnesNever) {
  std::string order;
  const Subscription late = this->loop().after(milliseconds(30), [&] { order += "late "; });
  const Subscription early = this->loop().after(milliseconds(1), [&] { order += "early "; });
  Subscription never = this->loop().after(milliseconds(2), [&] { order += "never "; });
  int ticks = 0;
  const Subscription every = this->loop().every(milliseconds(5), [&] { ++ticks; });
  this->loop().post([&] { order += "posted "; });
  never.cancel();
  ASSERT_TRUE(this->until([&] { return order.size() > 13; }));
  EXPECT_EQ(order, "posted early late ");
  ASSERT_TRUE(this->until([&] { return ticks >= 3; }));
  EXPECT_FALSE(late.active());
  EXPECT_TRUE(every.active());
}

TYPED_TEST(NetworkTest, AWatchedDescriptorCallsUntilItIsDrained) {
  const int fd = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  int calls = 0;
  const Subscription watch = this->loop().watchFd(fd, [&] {
    if (++calls == 3) drainEventFd(fd);
  });
  EXPECT_EQ(this->loop().runOnce(milliseconds(0)), 0U);
  const std::uint64_t one = 1;
  ASSERT_EQ(::write(fd, &one, sizeof one), static_cast<ssize_t>(sizeof one));
  ASSERT_TRUE(this->until([&] { return calls == 3; }));
  EXPECT_EQ(this->loop().runOnce(milliseconds(0)), 0U);
  ::close(fd);
}

TYPED_TEST(NetworkTest, RunEndsWithStopAndCanRunAgain) {
  for (int i = 0; i < 2; ++i) {
    bool ran = false;
    this->loop().post([&] {
      ran = true;
      this->loop().stop();
    });
    this->loop().run();
    EXPECT_TRUE(ran);
  }
}

}  // namespace
}  // namespace hapticd::net
