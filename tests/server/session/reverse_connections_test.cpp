#include "server/session/reverse_connections.h"

#include <gtest/gtest.h>

#include "net/fake_network.h"
#include "net/loopback.h"
#include "net/tcp_listener.h"
#include "server/log_lines.h"
#include "wire/text.h"
#include "wire/udp_request.h"

namespace hapticd::server {
namespace {

using std::chrono::milliseconds;

class ReverseConnectionsTest : public testing::Test {
 protected:
  // Asks as a client whose program is another one.
  void ask() {
    const std::string request =
        wire::formatUdpRequest({listener_.local().addressText(), listener_.local().port});
    requests_.sendTo(wire::asBytes(request), kServer);
    loop_.runFor(milliseconds(10));
  }
  void leave(std::size_t sockets) { network_.limitSockets(0, network_.sockets(0) + sockets); }

  const net::Endpoint kServer{net::kLoopbackAddress, 3883};
  test::LogLines lines_;
  base::SimulatedClock clock_;
  net::FakeNetwork network_{clock_};
  net::ScopedNetwork scope_{network_};
  net::Loop loop_;
  net::Loop clientLoop_;
  ThrottledLog log_;
  bool plaintext_ = true;
  std::vector<net::Connection> accepted_;
  std::vector<std::unique_ptr<net::UdpSocket>> datagrams_;
  ReverseConnections connections_{loop_,
                                  kServer,
                                  {},
                                  {},
                                  [this](std::uint32_t) { return plaintext_; },
                                  log_,
                                  [this](net::Connection c, std::unique_ptr<net::UdpSocket> udp) {
                                    accepted_.push_back(std::move(c));
                                    datagrams_.push_back(std::move(udp));
                                  }};
  net::UdpSocket requests_{clientLoop_, net::kAnyPort};
  std::vector<net::Connection> called_;  // at the client
  net::TcpListener listener_{clientLoop_, net::kAnyPort,
                             [this](net::Connection c) { called_.push_back(std::move(c)); }};
};

TEST_F(ReverseConnectionsTest, ConnectsToAClientThatAsks) {
  ask();
  EXPECT_EQ(accepted_.size(), 1U);
  EXPECT_EQ(called_.size(), 1U);
}

TEST_F(ReverseConnectionsTest, WithoutADescriptorItReportsAndConnectsAtALaterRequest) {
  leave(0);
  ask();
  EXPECT_TRUE(accepted_.empty());
  EXPECT_EQ(lines_.count("failed: cannot connect to " + listener_.local().text() + ": Too many open files"),
            1U)
      << lines_.text();
  network_.limitSockets(0, std::nullopt);
  ask();
  EXPECT_EQ(accepted_.size(), 1U);
}

TEST_F(ReverseConnectionsTest, WithoutADescriptorForDatagramsItReportsAndEndsTheConnection) {
  leave(1);
  ask();
  EXPECT_TRUE(accepted_.empty());
  EXPECT_EQ(lines_.count("reverse connection to " + listener_.local().text() + " failed: "), 1U)
      << lines_.text();
  EXPECT_EQ(lines_.count("Too many open files"), 1U) << lines_.text();
  ASSERT_EQ(called_.size(), 1U);
  std::string reason;
  called_[0].start({.onClosed = [&](const std::string& why) { reason = why; }});
  loop_.runFor(milliseconds(10));
  EXPECT_EQ(reason, "closed by the peer");
  network_.limitSockets(0, std::nullopt);
  ask();
  EXPECT_EQ(accepted_.size(), 1U);
}

// Connections that are not answered yet: one machine may have a quarter of them, whatever it calls itself.
TEST_F(ReverseConnectionsTest, OneAddressLeavesRoomForOthers) {
  network_.options.delay = 500'000'000;
  network_.options.otherMachines = true;
  const auto before = network_.sockets(0);
  net::UdpSocket far(clientLoop_, {0x0a000001, 0});
  const auto request = [&](net::UdpSocket& from, const net::Endpoint& client) {
    from.sendTo(wire::asBytes(wire::formatUdpRequest({client.addressText(), client.port})), kServer);
  };
  for (std::uint16_t port = 5000; port < 5100; ++port) request(far, {0x0a000001, port});
  request(requests_, listener_.local());
  for (std::uint16_t port = 5000; port < 5100; ++port)
    request(requests_, {net::kLoopbackAddress + port % 200U, port});
  loop_.runFor(milliseconds(600));
  EXPECT_EQ(network_.sockets(0) - before, 16U + 16U) << "all of 127.0.0.0/8 is one machine";
  EXPECT_GE(lines_.count("16 others of its address are pending"), 1U) << lines_.text();
  loop_.runFor(milliseconds(3000));
  EXPECT_EQ(accepted_.size(), 1U);
  EXPECT_EQ(network_.sockets(0) - before, 2U) << "the connection and its datagrams";
  request(far, {0x0a000001, 6000});
  loop_.runFor(milliseconds(600));
  EXPECT_EQ(network_.sockets(0) - before, 3U) << "those that have failed make room";
}

TEST_F(ReverseConnectionsTest, NoMoreThan64ArePending) {
  network_.options.delay = 500'000'000;
  network_.options.otherMachines = true;
  std::vector<std::unique_ptr<net::UdpSocket>> far;
  for (std::uint32_t i = 0; i < 5; ++i)
    far.push_back(std::make_unique<net::UdpSocket>(clientLoop_, net::Endpoint{0x0a000001 + i, 0}));
  const auto before = network_.sockets(0);
  for (const auto& socket : far) {
    for (std::uint16_t port = 5000; port < 5016; ++port) {
      const std::string request = wire::formatUdpRequest({socket->local().addressText(), port});
      socket->sendTo(wire::asBytes(request), kServer);
    }
  }
  loop_.runFor(milliseconds(600));
  EXPECT_EQ(network_.sockets(0) - before, 64U);
  EXPECT_EQ(lines_.count("connection request to 10.0.0.5:5000 ignored: 64 others are pending"), 1U)
      << lines_.text();
}

TEST_F(ReverseConnectionsTest, WhereOnlyEncryptedOnesAreAllowedTheRemedyIsTold) {
  plaintext_ = false;
  ask();
  EXPECT_TRUE(accepted_.empty());
  EXPECT_EQ(lines_.count("datagrams cannot be encrypted; use 'hapticd tunnel' on that machine"), 1U)
      << lines_.text();
  plaintext_ = true;
  ask();
  EXPECT_EQ(accepted_.size(), 1U);
}

}  // namespace
}  // namespace hapticd::server
