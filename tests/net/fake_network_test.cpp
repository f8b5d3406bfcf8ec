// What only the simulated network can do: exact times, chosen splits, faults, and the same run twice.
#include "net/fake_network.h"

#include <gtest/gtest.h>

#include <deque>

#include "net/loopback.h"

namespace hapticd::net {
namespace {

using std::chrono::milliseconds;

class FakeNetworkTest : public testing::Test {
 protected:
  void join(const ConnectionOptions& options = {}) {
    listener_.emplace(
        loop_, kAnyPort,
        [this](Connection c) {
          there_ = std::move(c);
          there_.start({.onBytes =
                            [this](std::span<const std::byte> bytes) {
                              reads_.push_back(bytes.size());
                              arrivals_.push_back(clock_.now());
                            },
                        .onPeerGone = [this](const std::string& reason) { gone_ = reason; },
                        .onClosed = [this](const std::string& reason) { closedThere_ = reason; }});
        },
        options);
    here_ = Connection::connect(loop_, listener_->local(), milliseconds(1000), options);
    here_.start({.onClosed = [this](const std::string& reason) { closedHere_ = reason; }});
    loop_.runFor(milliseconds(10));
    ASSERT_TRUE(there_.isOpen());
  }
  void send(std::size_t size) {
    here_.send(bytesOf(std::string(size, 'x')));
    here_.flush();
  }

  base::SimulatedClock clock_;
  FakeNetwork network_{clock_};
  ScopedNetwork scope_{network_};
  Loop loop_;
  std::optional<TcpListener> listener_;
  Connection here_;
  Connection there_;
  std::vector<std::size_t> reads_;
  std::vector<base::Nanos> arrivals_;
  std::string gone_;
  std::string closedHere_;
  std::string closedThere_;
};

TEST_F(FakeNetworkTest, BytesTakeTheDelayExactly) {
  network_.options.delay = 7'000'000;
  join();
  const base::Nanos sent = clock_.now();
  send(100);
  loop_.runFor(milliseconds(6));
  EXPECT_TRUE(reads_.empty());
  loop_.runFor(milliseconds(2));
  EXPECT_EQ(arrivals_, std::vector<base::Nanos>{sent + 7'000'000});
}

TEST_F(FakeNetworkTest, ReadsAreSplitWhereTheTestSays) {
  join();
  network_.options.readSize = [](std::size_t available) {
    return available > 3 ? std::size_t{3} : available;
  };
  send(10);
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(reads_, (std::vector<std::size_t>{3, 3, 3, 1}));
}

TEST_F(FakeNetworkTest, TheWindowBoundsWhatIsUnread) {
  network_.options.windowBytes = 10'000;
  join();
  there_.pauseReading();
  send(25'000);
  loop_.runFor(milliseconds(10));
  EXPECT_EQ(here_.statistics().bytesOut, 10'000U);
  EXPECT_EQ(here_.statistics().queuedBytes, 15'000U);
  there_.resumeReading();
  loop_.runFor(milliseconds(10));
  EXPECT_EQ(there_.statistics().bytesIn, 25'000U);
}

TEST_F(FakeNetworkTest, ChosenDatagramsAreLost) {
  UdpSocket to(loop_, kAnyPort);
  UdpSocket from(loop_, kAnyPort);
  std::string received;
  to.start(
      {.onDatagram = [&](std::span<const std::byte> bytes, const Endpoint&) { received += textOf(bytes); },
       .onRefused = {}});
  network_.options.losesDatagram = [](std::uint64_t number) { return number % 3 == 1; };
  for (const char* text : {"a", "b", "c", "d", "e"}) EXPECT_TRUE(from.sendTo(bytesOf(text), to.local()));
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(received, "acd");
}

// The same rules as over the system's sockets: they are those of Acceptor.
class OutOfDescriptors : public FakeNetworkTest {
 protected:
  OutOfDescriptors() {
    loop_.setErrorHandler([this](std::string_view text) { errors_.emplace_back(text); });
    network_.options.refusedAccept = [this](const Endpoint&, std::size_t pending) {
      refused_.emplace_back(clock_.now(), pending);
    };
    listener_.emplace(loop_, kAnyPort, [this](Connection c) { accepted_.push_back(std::move(c)); });
  }
  // A client has its own program.
  Connection& call() {
    clients_.push_back(Connection::connect(clientLoop_, listener_->local(), milliseconds(1000)));
    clients_.back().start({.onConnected = [this] { ++connected_; },
                           .onClosed = [this](const std::string& reason) { closedHere_ = reason; }});
    return clients_.back();
  }
  void leave(std::size_t sockets) { network_.limitSockets(0, network_.sockets(0) + sockets); }

  Loop clientLoop_;
  int connected_ = 0;
  std::vector<std::string> errors_;
  std::vector<std::pair<base::Nanos, std::size_t>> refused_;
  std::vector<Connection> accepted_;
  std::deque<Connection> clients_;
};

TEST_F(OutOfDescriptors, ConnectionsWaitAndAreAcceptedSoonAfterwards) {
  leave(0);
  for (int i = 0; i < 3; ++i) call().send(bytesOf("hello"));
  for (auto& client : clients_) client.flush();
  loop_.runFor(milliseconds(1000));
  EXPECT_EQ(connected_, 3) << "the system does that";
  EXPECT_TRUE(accepted_.empty());
  network_.limitSockets(0, std::nullopt);
  loop_.runFor(milliseconds(110));
  EXPECT_EQ(accepted_.size(), 3U);
  EXPECT_EQ(network_.sockets(0), 3U);
}

TEST_F(OutOfDescriptors, ItTriesTenTimesASecondAndReportsOnce) {
  leave(0);
  call();
  loop_.runFor(milliseconds(3050));
  EXPECT_EQ(refused_.size(), 31U);
  const std::string text =
      "cannot accept a connection on " + listener_->local().text() + ": Too many open files";
  EXPECT_EQ(errors_, std::vector<std::string>(4, text));
}

TEST_F(OutOfDescriptors, TheLastOneIsUsedAndNobodyIsSaidToWait) {
  leave(1);
  call();
  loop_.runFor(milliseconds(500));
  EXPECT_EQ(accepted_.size(), 1U);
  EXPECT_EQ(refused_.size(), 1U);
  EXPECT_EQ(refused_[0].second, 0U);
  EXPECT_TRUE(errors_.empty());
  call();
  loop_.runFor(milliseconds(500));
  EXPECT_EQ(accepted_.size(), 1U);
  EXPECT_EQ(errors_.size(), 1U);
  accepted_.clear();
  loop_.runFor(milliseconds(110));
  EXPECT_EQ(accepted_.size(), 1U) << "a connection that ends makes room";
}

TEST_F(OutOfDescriptors, AWaitingConnectionThatWasResetEndsAfterItIsAccepted) {
  leave(0);
  call();
  loop_.runFor(milliseconds(50));
  clients_.back().abort("gone");
  loop_.runFor(milliseconds(50));
  network_.limitSockets(0, std::nullopt);
  loop_.runFor(milliseconds(110));
  ASSERT_EQ(accepted_.size(), 1U);
  std::string reason;
  accepted_[0].start({.onClosed = [&](const std::string& why) { reason = why; }});
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(reason, "connection reset by the peer");
}

TEST_F(OutOfDescriptors, AListenerThatGoesEndsThoseThatWait) {
  leave(0);
  call();
  loop_.runFor(milliseconds(50));
  listener_.reset();
  loop_.runFor(milliseconds(500));
  EXPECT_EQ(closedHere_, "connection reset by the peer");
}

TEST_F(OutOfDescriptors, OtherSocketsAreRefused) {
  leave(0);
  Connection out = Connection::connect(loop_, listener_->local(), milliseconds(1000));
  out.start({.onClosed = [this](const std::string& reason) { closedHere_ = reason; }});
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(closedHere_, "cannot connect to " + listener_->local().text() + ": Too many open files");
  EXPECT_THROW(UdpSocket(loop_, kAnyPort), Error);
  EXPECT_EQ(network_.sockets(0), 0U);
}

TEST_F(FakeNetworkTest, ACutConnectionIsLostAfterItsTimeoutAndNotBefore) {
  join({.lossTimeout = milliseconds(500)});
  network_.cut(here_.local());
  send(100);
  loop_.runFor(milliseconds(499));
  EXPECT_EQ(closedHere_, "");
  loop_.runFor(milliseconds(2));
  EXPECT_EQ(closedHere_, "the peer is lost: it acknowledged nothing in time");
  EXPECT_TRUE(reads_.empty());
  EXPECT_EQ(closedThere_, "") << "the other end had nothing to send";
}

TEST_F(FakeNetworkTest, AResetFromOutsideEndsBoth) {
  join();
  there_.pauseReading();
  network_.reset(here_.local());
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(closedHere_, "connection reset by the peer");
  EXPECT_EQ(gone_, "connection reset by the peer");
  EXPECT_EQ(closedThere_, "");
  there_.resumeReading();
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(closedThere_, "connection reset by the peer");
}

TEST_F(FakeNetworkTest, ConnectingTimesOutOnTheSimulatedClock) {
  network_.options.delay = base::toNanos(3600);
  const TcpListener listener(loop_, kAnyPort, [](Connection) {});
  std::string closed;
  Connection connection = Connection::connect(loop_, listener.local(), milliseconds(250));
  connection.start({.onClosed = [&](const std::string& reason) { closed = reason; }});
  loop_.runFor(milliseconds(251));
  EXPECT_EQ(closed, "cannot connect to " + listener.local().text() + ": no answer within 250 ms");
}

TEST_F(FakeNetworkTest, RunForEndsExactlyAtItsTime) {
  const base::Nanos begin = clock_.now();
  loop_.runFor(std::chrono::hours(24));
  EXPECT_EQ(clock_.now() - begin, base::toNanos(24 * 3600));
}

TEST_F(FakeNetworkTest, ALoopThatCouldNeverWakeSaysSo) {
  EXPECT_THROW(loop_.run(), std::logic_error);
}

// Events of a loop that is gone are dropped, those of the others are not.
TEST_F(FakeNetworkTest, LoopsMayEndBeforeTheNetwork) {
  int ran = 0;
  {
    Loop other;
    other.post([&] { ran += 100; });
  }
  loop_.post([&] { ++ran; });
  loop_.runFor(milliseconds(1));
  EXPECT_EQ(ran, 1);
}

/// Times and sizes of all reads of an exchange with splits and loss chosen by a generator.
std::vector<std::uint64_t> trace(std::uint64_t seed) {
  base::SimulatedClock clock;
  FakeNetwork network(clock);
  const ScopedNetwork scope(network);
  std::vector<std::uint64_t> events;
  std::uint64_t state = seed;
  network.options.readSize = [&](std::size_t available) -> std::size_t {
    state = state * 6364136223846793005U + 1442695040888963407U;
    return 1 + (state >> 33) % available;
  };
  network.options.windowBytes = 5000;
  Loop loop;
  Server server(loop, {}, true);
  Connection client = Connection::connect(loop, server.listener.local(), milliseconds(1000));
  client.start({.onBytes = [&](std::span<const std::byte> bytes) {
    events.push_back(static_cast<std::uint64_t>(clock.now()));
    events.push_back(bytes.size());
  }});
  client.send(bytesOf(std::string(50'000, 'x')));
  loop.runFor(std::chrono::seconds(1));
  EXPECT_EQ(client.statistics().bytesIn, 50'000U);
  return events;
}

TEST(FakeNetworkTrace, TheSameSeedGivesTheSameEvents) {
  EXPECT_EQ(trace(1), trace(1));
  EXPECT_NE(trace(1), trace(2));
}

}  // namespace
}  // namespace hapticd::net
