#include "server/session/session.h"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <optional>

#include "net/loop.h"
#include "net/tcp_listener.h"
#include "wire/cookie.h"
#include "wire/frame_encoder.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;

class CountingOwner final : public SessionOwner {
 public:
  void onSubscribed(Session& /*session*/, wire::LocalSender /*name*/) override {}
  void onMessage(Session& /*session*/, const wire::MessageReceived& /*message*/, base::Nanos) override {
    ++messages;
  }
  void onWarning(const Session& /*session*/, const std::string& /*text*/) override {}
  void onReadSlice() override {
    mostBetween = std::max(mostBetween, messages - last);
    last = messages;
    ++slices;
  }
  void onReadEnd(Session& /*session*/) override {
    mostBetween = std::max(mostBetween, messages - last);
    last = messages;
  }
  void onPeerGone(Session& /*session*/, const std::string& /*reason*/) override {}
  void onClosed(Session& /*session*/, const std::string& reason) override { closed = reason; }

  std::size_t messages = 0;
  std::size_t last = 0;
  std::size_t slices = 0;
  std::size_t mostBetween = 0;
  std::string closed;
};

// The handshake of a client with the sender `Phantom`, then `count` pings.
std::vector<std::byte> pings(std::size_t count) {
  wire::LocalNames names;
  names.addSender("Phantom");
  wire::Peer peer(names);
  net::Buffer bytes;
  peer.takeStream(bytes);
  wire::Peer other(names);
  net::Buffer answer;
  other.takeStream(answer);
  peer.feed({}, answer, [](const wire::Event&) {});
  for (std::size_t i = 0; i < count; ++i) peer.send({}, *names.findSender("Phantom"), wire::Ping{});
  net::Buffer rest;
  peer.takeStream(rest);
  bytes.insert(bytes.end(), rest.begin(), rest.end());
  return bytes;
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

}  // namespace
}  // namespace hapticd::server
