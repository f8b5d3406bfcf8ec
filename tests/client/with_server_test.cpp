// The client and the server of this project together, over real sockets, with the simulated hand.
#include "client/client_tests.h"

#include <cmath>
#include <deque>
#include <thread>

#include "server/running_server.h"

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

// The scripted hand rests at y = 53 mm: that it is above something does not say that it is held.
bool isNear(const std::array<double, 3>& hand_m, double x_m, double y_m) {
  return std::hypot(hand_m[0] - x_m, hand_m[1] - y_m) < 1e-3;
}

class WithServer : public ::testing::TestWithParam<bool> {
 protected:
  std::string name() const {
    return (GetParam() ? "Phantom@tcp://" : "Phantom@") +
           ("127.0.0.1:" + std::to_string(server_.address().port));
  }

  /// A floor 10 mm below the middle, in one batch; the hand waits above it first, so that nothing appears
  /// around it.
  void makeFloor(Client& client) {
    const std::vector<std::array<float, 3>> vertices{
        {-80, -10, -40}, {-80, -10, 40}, {80, -10, 40}, {80, -10, -40}};
    const std::vector<std::array<std::uint32_t, 3>> triangles{{0, 1, 2}, {0, 2, 3}};
    client.subscribe(Reports::all, 1000);
    client.holdHand({{0, 20, 0}});
    ASSERT_TRUE(pollUntil(client, [&] { return isNear(client.latest().tick.hand_m, 0, 0.020); }));
    const std::uint64_t revision = client.latest().tick.revision;
    client.batch([&] {
      client.resetScene();
      client.setSurface(0, {.stiffness = 0.8F});
      client.uploadMesh(0, {vertices, triangles});
    });
    ASSERT_TRUE(pollUntil(client, [&] { return client.latest().tick.revision > revision; }));
  }
  /// Presses into the floor until a force pushes up.
  ::testing::AssertionResult press(Client& client) {
    client.holdHand({{0, -14, 0}});
    if (pollUntil(client, [&] { return client.latest().force.force_N[1] > 0.1; }))
      return ::testing::AssertionSuccess();
    return ::testing::AssertionFailure() << "force " << client.latest().force.force_N[1] << " N";
  }

  RunningServer server_;
};
INSTANTIATE_TEST_SUITE_P(Client, WithServer, ::testing::Bool(),
                         [](const auto& way) { return way.param ? "tcp" : "callback"; });

TEST_P(WithServer, ReceivesTheCapabilities) {
  Client client(name());
  const auto c = client.waitCapabilities();
  ASSERT_TRUE(c);
  EXPECT_TRUE(c->bulkMesh && c->batch && c->subscribe && c->stop && c->heartbeat && c->holdHand);
  EXPECT_EQ(c->servoRate_Hz, 1000);
  EXPECT_GT(c->peakForce_N, 0);
  EXPECT_LT(c->workspaceMin_m[0], c->workspaceMax_m[0]);
}

TEST_P(WithServer, AnIndexedMeshReportsItsContacts) {
  Client client(name());
  std::vector<std::string> texts;
  client.onText([&](const TextReport& r) { texts.push_back(r.text); });
  makeFloor(client);
  ASSERT_TRUE(press(client));
  ASSERT_TRUE(pollUntil(client, [&] { return !client.latest().contacts.contacts.empty(); }));
  const ContactsReport felt = client.latest().contacts;
  ASSERT_EQ(felt.contacts.size(), 1U);
  const Contact& c = felt.contacts[0];
  EXPECT_EQ(c.object, 0);
  EXPECT_NEAR(c.point_m[1], -0.010, 1e-6);
  EXPECT_NEAR(c.normal[1], 1, 1e-9);
  EXPECT_GT(c.force_N[1], 0);
  EXPECT_GT(felt.tick, 0U);
  EXPECT_EQ(client.latest().tick.object, 0);

  client.holdHand({{0, 20, 0}});
  EXPECT_TRUE(pollUntil(client, [&] { return client.latest().contacts.contacts.empty(); }))
      << "an empty list ends the contact";
  for (const std::string& text : texts) EXPECT_THAT(text, testing::Not(HasSubstr("refused")));
}

TEST_P(WithServer, ForcesStopAndComeBack) {
  Client client(name());
  makeFloor(client);
  ASSERT_TRUE(press(client));
  client.stopForces();
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().guard.stopped; }));
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().tick.force_N == Vec3{}; }));
  client.rearmForces();
  ASSERT_TRUE(
      pollUntil(client, [&] { return !client.latest().guard.stopped && client.latest().guard.armed; }));
  EXPECT_TRUE(pollUntil(client, [&] { return client.latest().tick.force_N[1] > 0.1; }));
}

TEST_P(WithServer, AClientThatDoesNotPollIsDisconnectedAndItsForceEnds) {
  Client watcher(name());
  Client client(name());
  watcher.subscribe(Reports::tick, 200);
  client.enableHeartbeat();
  client.setEffect(0, Effect::constant({1, 0, 0}, 1.0));
  client.startEffect(0);
  const auto push = [&] {
    return std::hypot(watcher.latest().tick.force_N[0], watcher.latest().tick.force_N[1]);
  };
  ASSERT_TRUE(pollUntil(watcher, [&] {
    client.poll(0ms);
    return push() > 0.5;
  }));
  // A late tick also ends the force, for less than a thousand ticks.
  std::uint64_t lastWithForce = watcher.latest().tick.tick;
  const auto ended = [&] {
    if (push() > 1e-6) lastWithForce = watcher.latest().tick.tick;
    return watcher.latest().tick.tick > lastWithForce + 1000;
  };
  ASSERT_TRUE(pollUntil(watcher, ended)) << "the client is not polled";
  std::string reason;
  client.onConnection(
      [&](const ConnectionReport& r) { reason += r.connected ? "again" : "lost: " + r.reason + "; "; });
  ASSERT_TRUE(pollUntil(client, [&] { return client.connected() && reason.ends_with("again"); }));
  EXPECT_THAT(reason, HasSubstr("lost"));
}

TEST_P(WithServer, OneClientHoldsTheHand) {
  auto first = std::make_unique<Client>(name());
  Client second(name());
  std::string text;
  second.onText([&](const TextReport& r) { text = r.text; });
  second.subscribe(Reports::all, 1000);
  first->holdHand({{20, 20, 0}});
  ASSERT_TRUE(pollUntil(second, [&] {
    first->poll(0ms);  // completes its connection, where that is not done yet
    return isNear(second.latest().tick.hand_m, 0.020, 0.020);
  }));
  second.holdHand({{0, -20, 0}});
  ASSERT_TRUE(pollUntil(second, [&] { return !text.empty(); }));
  EXPECT_THAT(text, HasSubstr("hand"));
  first.reset();
  ASSERT_TRUE(pollUntil(second,
                        [&] {
                          second.holdHand({{0, -20, 0}});
                          return second.latest().tick.hand_m[1] < -0.015;
                        }))
      << text << " hand at " << second.latest().tick.hand_m[1] << " tick " << second.latest().tick.tick;
}

TEST_P(WithServer, ASubscriptionToNothingLeavesTexts) {
  Client client(name());
  client.subscribe(Reports::none);
  std::string text;
  client.onText([&](const TextReport& r) { text += r.text; });
  client.setTouchable(12345, true);  // no such object
  ASSERT_TRUE(pollUntil(client, [&] { return !text.empty(); }));
  const std::uint64_t before = client.statistics()[ReportKind::pose].count;
  client.runFor(200ms);
  EXPECT_EQ(client.statistics()[ReportKind::pose].count, before);
}

// A client at 60 Hz whose messages take 20 ms each way and get lost, 1 of 100: the delays are in this test.
class BadLine {
 public:
  explicit BadLine(Client& client) : client_(client) {
    client.onHand([this](const HandReport& report) { arriving_.push_back({Clock::now() + kDelay, report}); });
  }
  // Polls and lets through what is due; returns the report that the client knows.
  const HandReport& run() {
    client_.poll(1ms);
    while (!arriving_.empty() && arriving_.front().first <= Clock::now()) {
      known_ = arriving_.front().second;
      arriving_.pop_front();
    }
    if (Clock::now() >= next_) {
      next_ = Clock::now() + 16ms + std::chrono::milliseconds(sent_ * 7 % 11 - 5);
      if (++sent_ % 100 != 0) leaving_.push_back(Clock::now() + kDelay);
    }
    while (!leaving_.empty() && leaving_.front() <= Clock::now()) {
      leaving_.pop_front();
      client_.setRemoteContacts({&wall, 1});
    }
    return known_;
  }
  RemoteContact wall;

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr auto kDelay = 20ms;
  Client& client_;
  std::deque<std::pair<Clock::time_point, HandReport>> arriving_;
  std::deque<Clock::time_point> leaving_;
  HandReport known_;
  Clock::time_point next_{};
  int sent_ = 0;
};

// On a stalled machine the wall may expire and return; it is at rest in between.
TEST_P(WithServer, AStreamedWallIsStiffAcrossABadLine) {
  auto client = std::make_unique<Client>(name());
  client->subscribe(Reports::hand, 250);
  client->holdHand({{0, 10, 0}});
  ASSERT_TRUE(pollUntil(*client, [&] { return client->latest().hand.position_m[1] > 0.008; }));
  BadLine line(*client);
  line.wall.stiffness_N_per_m = 1000;
  for (int i = 0; i < 100; ++i) line.run();
  client->holdHand({{0, -6, 0}});
  // The hand's spring of 300 N/m against 1000 N/m.
  const double depth_m = 0.006 * 300 / 1300;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  int calm = 0;
  std::uint64_t last = 0;
  while (calm < 60 && std::chrono::steady_clock::now() < end) {
    const HandReport& hand = line.run();
    if (hand.tick == last) continue;
    last = hand.tick;
    const bool there = hand.contacts.size() == 1 && std::abs(hand.position_m[1] + depth_m) < 2e-5 &&
                       std::abs(hand.contacts[0].force_N[1] - 1000 * depth_m) < 0.02;
    calm = there ? calm + 1 : 0;
  }
  EXPECT_EQ(calm, 60) << client->latest().hand.position_m[1] << " instead of " << -depth_m;
  EXPECT_GT(client->latest().hand.contactsSent.count(), 0);

  // A second client is refused while the first one streams; then the first one leaves and its wall ends.
  Client other(name());
  std::string text;
  other.onText([&](const TextReport& r) { text += r.text; });
  other.subscribe(Reports::hand, 250);
  ASSERT_TRUE(pollUntil(other, [&] {
    line.run();
    other.setRemoteContacts({});
    return !text.empty();
  }));
  EXPECT_THAT(text, HasSubstr("streams to this device"));
  client.reset();
  EXPECT_TRUE(pollUntil(other, [&] {
    const HandReport& hand = other.latest().hand;
    return hand.tick > 0 && hand.contacts.empty() && std::abs(hand.force_N[1]) < 1e-9;
  }));
}

TEST_P(WithServer, AHeldForceIsFeltAndEndsByItself) {
  Client client(name());
  std::string text;
  client.onText([&](const TextReport& r) { text += r.text; });
  client.subscribe(Reports::hand, 250);
  ASSERT_TRUE(pollUntil(client, [&] {
    client.setForce({0.5, 0, 0}, {0, 0, 0.1});
    return client.latest().hand.heldForce_N[0] > 0.45;
  }));
  EXPECT_THAT(text, HasSubstr("no torque"));
  EXPECT_TRUE(pollUntil(client, [&] { return client.latest().hand.heldForce_N[0] == 0; }));
}

}  // namespace
}  // namespace hapticd::test
