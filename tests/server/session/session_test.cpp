#include "server/session/session.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <functional>
#include <optional>

#include "net/loop.h"
#include "net/tcp_listener.h"
#include "server/session/quiet_owner.h"
#include "wire/cookie.h"
#include "wire/frame_encoder.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;

class CountingOwner final : public QuietOwner {
 public:
  void onMessage(Session& /*session*/, const wire::MessageReceived& /*message*/, base::Nanos) override {
    ++messages;
  }
  void onReadSlice() override {
    mostBetween = std::max(mostBetween, messages - last);
    last = messages;
    ++slices;
  }
  void onReadEnd(Session& /*session*/) override {
    mostBetween = std::max(mostBetween, messages - last);
    last = messages;
  }
  void onHeartbeatAgain(Session& /*session*/) override { ++returns; }
  void onEnding(Session& /*session*/) override { ++endings; }
  void onClosed(Session& /*session*/, const std::string& reason) override { closed = reason; }

  std::size_t endings = 0;
  std::size_t returns = 0;
  std::size_t messages = 0;
  std::size_t last = 0;
  std::size_t slices = 0;
  std::size_t mostBetween = 0;
  std::string closed;
};

// The handshake of a client with the sender `Phantom`, then what `write` sends.
std::vector<std::byte> bytesWith(const std::function<void(wire::Peer&, wire::LocalSender)>& write) {
  wire::LocalNames names;
  names.addSender("Phantom");
  wire::Peer peer(names);
  net::Buffer bytes;
  peer.takeStream(bytes);
  wire::Peer other(names);
  net::Buffer answer;
  other.takeStream(answer);
  peer.feed({}, answer, [](const wire::Event&) {});
  write(peer, *names.findSender("Phantom"));
  net::Buffer rest;
  peer.takeStream(rest);
  bytes.insert(bytes.end(), rest.begin(), rest.end());
  return bytes;
}

std::vector<std::byte> pings(std::size_t count) {
  return bytesWith([count](wire::Peer& peer, wire::LocalSender sender) {
    for (std::size_t i = 0; i < count; ++i) peer.send({}, sender, wire::Ping{});
  });
}

TEST(Session, ReportsSlicesOfALongRead) {
  constexpr std::size_t kPings = 2000;
  net::Loop loop;
  wire::LocalNames names;
  names.addSender("Phantom");
  WallClock clock;
  CountingOwner owner;
  std::optional<Session> session;
  net::TcpListener listener(loop, net::Endpoint::parse("127.0.0.1", 0), [&](net::Connection connection) {
    session.emplace(1, owner, names, clock, std::move(connection), nullptr, SessionMode::tcp);
    session->start();
  });
  net::Connection client = net::Connection::connect(loop, listener.local(), 20s);
  client.start({});
  client.send(pings(kPings));
  for (int i = 0; i < 2000 && owner.messages < kPings; ++i) loop.runOnce(10ms);
  EXPECT_EQ(owner.messages, kPings);
  EXPECT_EQ(owner.closed, "");
  EXPECT_GE(owner.slices, 1U);
  EXPECT_LE(owner.mostBetween, 8 * 1024 / wire::kHeaderBytes + 1);  // one frame spans the boundary
}

// The server reads what a client sent and holds it back.
struct HeldSession {
  HeldSession() { names.addSender("Phantom"); }

  net::Loop loop;
  wire::LocalNames names;
  WallClock clock;
  CountingOwner owner;
  std::optional<Session> session;
  net::TcpListener listener{loop, net::Endpoint::parse("127.0.0.1", 0), [this](net::Connection connection) {
                              session.emplace(1, owner, names, clock, std::move(connection), nullptr,
                                              SessionMode::tcp);
                              session->hold();
                              session->start();
                            }};
};

// The promise to send heartbeats is seen although everything else is held back: later silence counts.
TEST(Session, ReadsHeartbeatsAheadOfWhatIsHeldBack) {
  HeldSession held;
  net::Loop& loop = held.loop;
  CountingOwner& owner = held.owner;
  std::optional<Session>& session = held.session;
  net::Connection client = net::Connection::connect(loop, held.listener.local(), 20s);
  client.start({});
  client.send(bytesWith([](wire::Peer& peer, wire::LocalSender sender) {
    peer.send({}, sender, wire::StartEffect{1});
    peer.send({}, sender, wire::Heartbeat{1});
    peer.send({}, sender, wire::StopForces{});
  }));
  for (int i = 0; i < 2000 && owner.messages < 1; ++i) loop.runOnce(10ms);
  EXPECT_EQ(owner.messages, 1U) << "the stop alone";
  const base::Nanos later = base::now() + 2 * HeartbeatWatch::kLimit;
  EXPECT_EQ(session->checkHeartbeat(later), HeartbeatWatch::Verdict::lost) << "the heartbeat was read";
  EXPECT_TRUE(session->holding());
  EXPECT_FALSE(session->release());
  EXPECT_EQ(owner.messages, 2U) << "the effect follows";
  EXPECT_FALSE(session->holding());
}

// A client whose heartbeats wait behind its own data: its forces end, until a heartbeat is read.
TEST(Session, TellsThatHeartbeatsReturn) {
  HeldSession held;
  net::Loop& loop = held.loop;
  CountingOwner& owner = held.owner;
  std::optional<Session>& session = held.session;
  net::ConnectionOptions options;
  options.hardLimitBytes = std::size_t{64} << 20;
  net::Connection client = net::Connection::connect(loop, held.listener.local(), 20s, options);
  client.start({});
  client.send(bytesWith([](wire::Peer& peer, wire::LocalSender sender) {
    peer.send({}, sender, wire::Heartbeat{1});
    const wire::MeshVertices run{0, 0, {std::vector<float>(15'000)}};
    for (std::size_t sent = 0; sent < 2 * Session::kReadAhead_bytes; sent += 60'000)
      peer.send({}, sender, run);
    peer.send({}, sender, wire::Heartbeat{1});
    peer.send({}, sender, wire::Heartbeat{1});
  }));
  const auto pauses = [&] { return session && session->memory() >= Session::kReadAhead_bytes; };
  for (int i = 0; i < 2000 && !pauses(); ++i) loop.runOnce(10ms);
  ASSERT_TRUE(pauses());
  const base::Nanos later = base::now() + 2 * HeartbeatWatch::kExcuse;
  EXPECT_EQ(session->checkHeartbeat(later), HeartbeatWatch::Verdict::excused);
  EXPECT_EQ(owner.returns, 0U);
  for (int i = 0; i < 2000 && owner.returns == 0; ++i) {
    while (session->release()) {
    }
    loop.runOnce(10ms);
  }
  for (int i = 0; i < 10; ++i) loop.runOnce(1ms);
  EXPECT_EQ(owner.returns, 1U) << "once";
}

}  // namespace
}  // namespace hapticd::server
