#include "server/session/admission.h"

#include <gtest/gtest.h>

#include <deque>
#include <map>
#include <memory>
#include <string>

#include "net/loop.h"
#include "net/tcp_listener.h"
#include "server/session/quiet_owner.h"

namespace hapticd::server {
namespace {

using namespace std::chrono_literals;

// Remembers why sessions ended.
class Ends final : public QuietOwner {
 public:
  void onClosed(Session& session, const std::string& reason) override { reasons[session.id()] = reason; }

  std::map<scene::ClientId, std::string> reasons;
};

// Silent clients that connect one after the other, as the server admits them.
class AdmissionTest : public testing::Test {
 protected:
  AdmissionTest() { names_.addSender("Phantom"); }

  void connect(scene::ClientId upTo) {
    while (sessions_.size() < upTo) {
      const std::size_t before = sessions_.size();
      clients_.push_back(net::Connection::connect(loop_, listener_.local(), 20s));
      clients_.back().start({});
      for (int i = 0; i < 2000 && sessions_.size() == before; ++i) loop_.runOnce(10ms);
      ASSERT_GT(sessions_.size(), before);
    }
    for (int i = 0; i < 20; ++i) loop_.runOnce(1ms);
  }
  const std::string& reason(scene::ClientId id) { return ends_.reasons[id]; }
  bool mayOnlyStop(scene::ClientId id) { return admission_.mayOnlyStop(*sessions_.at(id)); }
  void leave(scene::ClientId id) {
    admission_.leave(*sessions_.at(id));
    sessions_.erase(id);
  }

  LimitsConfig limits_;
  net::Loop loop_;
  wire::LocalNames names_;
  WallClock clock_;
  Ends ends_;
  Sessions sessions_;
  Admission admission_{limits_, sessions_};
  net::TcpListener listener_{loop_, net::Endpoint::parse("127.0.0.1", 0), [this](net::Connection connection) {
                               const scene::ClientId id = ++last_;
                               auto session =
                                   std::make_unique<Session>(id, ends_, names_, clock_, std::move(connection),
                                                             nullptr, SessionMode::tcp);
                               session->start();
                               admission_.enter(*session);
                               sessions_.emplace(id, std::move(session));
                             }};
  std::deque<net::Connection> clients_;
  scene::ClientId last_ = 0;
};

TEST_F(AdmissionTest, RoomEndsWithTheConnectionsAndReturnsWithThem) {
  limits_.connections = 2;
  admission_.enter("one");
  EXPECT_TRUE(admission_.hasRoom("another"));
  admission_.enter("another");
  EXPECT_FALSE(admission_.hasRoom("a third"));
  admission_.leave("one");
  EXPECT_TRUE(admission_.hasRoom("a third"));
}

TEST_F(AdmissionTest, OneSourceLeavesRoomForOthers) {
  limits_.connectionsPerAddress = 1;
  admission_.enter("one");
  EXPECT_FALSE(admission_.hasRoom("one"));
  EXPECT_TRUE(admission_.hasRoom("another"));
  admission_.leave("one");
  EXPECT_TRUE(admission_.hasRoom("one"));
}

TEST_F(AdmissionTest, WhoComesBeyondTheLimitMayOnlyStop) {
  limits_.connections = 1;
  connect(2);
  EXPECT_FALSE(mayOnlyStop(1));
  EXPECT_TRUE(mayOnlyStop(2));
  leave(1);
  EXPECT_TRUE(mayOnlyStop(2)) << "until it connects again";
  EXPECT_TRUE(admission_.hasRoom("another")) << "the reserve takes no room";
}

TEST_F(AdmissionTest, TheOldestOfTheReserveEndsForTheNewest) {
  limits_.connections = 1;
  connect(17);
  EXPECT_TRUE(ends_.reasons.empty()) << "sixteen are the reserve";
  connect(18);
  EXPECT_EQ(reason(1), "");
  EXPECT_NE(reason(2).find("the server is full, and others wait to stop forces"), std::string::npos)
      << reason(2);
  EXPECT_EQ(reason(3), "");
}

// Also those that do not let go of it.
TEST_F(AdmissionTest, AFloodBeyondTheReserveEndsAtOnce) {
  limits_.connections = 1;
  connect(60);
  std::size_t open = 0;
  for (const auto& [id, session] : sessions_) open += session->ending() ? 0 : 1;
  EXPECT_EQ(open, 17U);
  EXPECT_EQ(ends_.reasons.size(), 43U);
  EXPECT_EQ(reason(44).find("the server is full"), 0U) << reason(44);
  EXPECT_EQ(reason(45), "");
}

TEST_F(AdmissionTest, TheOldestWithoutAGreetingEndsForTheNewest) {
  limits_.unfinishedConnections = 2;
  connect(2);
  admission_.greeted(*sessions_.at(1));
  connect(4);
  EXPECT_EQ(reason(1), "") << "it has greeted";
  EXPECT_NE(reason(2).find("no VRPN greeting so far"), std::string::npos) << reason(2);
  EXPECT_EQ(reason(3), "");
}

TEST_F(AdmissionTest, AHandshakeEndsAfterHalfAMinute) {
  connect(1);
  EXPECT_TRUE(admission_.completedHandshakes(base::now() + 29'000'000'000).empty());
  EXPECT_EQ(reason(1), "");
  admission_.completedHandshakes(base::now() + 31'000'000'000);
  for (int i = 0; i < 20; ++i) loop_.runOnce(1ms);
  EXPECT_EQ(reason(1), "no VRPN greeting within 30 s");
}

}  // namespace
}  // namespace hapticd::server
