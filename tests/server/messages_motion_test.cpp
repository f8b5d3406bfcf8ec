// Objects that start to move beside a resting hand, and objects that appear around it, over the wire.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <map>
#include <thread>

#include "feeling.h"
#include "hands.h"

namespace hapticd::test {
namespace {

class MotionMessages : public testing::Test {
 protected:
  static constexpr double kHeight_m = 0.0215;  // of the hand; the cube's top is at 20 mm

  void SetUp() override { ASSERT_TRUE(peer_.untilConnected()); }
  void move(double up_mm) {
    peer_.send(wire::SetTransformMatrix{
        0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, static_cast<float>(up_mm), 0, 1}});
  }
  static void pause(std::chrono::milliseconds duration) { std::this_thread::sleep_for(duration); }

  const Hand hand_ = Hand::at({0.001, kHeight_m, 0.002});
  RunningServer server_{hand_.config()};
  ScriptedPeer peer_{server_.address()};
};

TEST_F(MotionMessages, ObjectThatStartsToMoveTakesTheHandAlong) {
  sendCube(peer_);
  ASSERT_TRUE(untilApplied(peer_));
  pause(std::chrono::milliseconds(300));
  for (int i = 1; i <= 5; ++i) {
    move(1.6 * i);  // 0.1 m/s
    pause(std::chrono::milliseconds(16));
  }
  EXPECT_TRUE(untilForceAbove(peer_, 0.8));
}

TEST_F(MotionMessages, LonePoseAfterAPauseTakesTheHandAlong) {
  sendCube(peer_);
  ASSERT_TRUE(untilApplied(peer_));
  pause(std::chrono::milliseconds(300));
  move(8);
  EXPECT_TRUE(untilForceAbove(peer_, 0.8));
}

TEST_F(MotionMessages, ObjectAroundTheHandIsReportedAndFeltOnceTheHandHasLeft) {
  sendBox(peer_, 0, Vec3f::Constant(30));
  EXPECT_TRUE(peer_.untilText("Move the device out of the object"));
  ASSERT_TRUE(catchUp(peer_));
  ASSERT_TRUE(untilTicks(peer_, 50));
  const auto force = peer_.last<wire::Force>();
  EXPECT_TRUE(!force || norm(force->force) == 0);
  move(-20);  // the cube leaves the hand
  pause(std::chrono::milliseconds(200));
  move(-5);
  EXPECT_TRUE(untilForceAbove(peer_, 0.3));
}

// A picture of a tick shows the proxy on the object that carries it.
TEST_F(MotionMessages, PosesAreThoseOfTheirTick) {
  peer_.send(wire::Subscribe{wire::kReportDefault | wire::kReportTick | wire::kReportPoses, 1000});
  sendCube(peer_);
  ASSERT_TRUE(untilApplied(peer_));
  pause(std::chrono::milliseconds(300));
  ASSERT_TRUE(untilTicks(peer_, 20));
  EXPECT_EQ(peer_.count<wire::Poses>(), 0U) << "what rests is in the scene's description";
  for (int i = 1; i <= 5; ++i) {
    move(1.6 * i);
    pause(std::chrono::milliseconds(16));
  }
  ASSERT_TRUE(peer_.until([&] {
    const auto poses = peer_.last<wire::Poses>();
    return poses && !poses->poses.values.empty() && std::abs(poses->poses.values.back()) < 1e-9 &&
           std::abs(poses->poses.values[11] - 8) < 1e-9;
  })) << "the last pose is the one that was sent";
  std::map<std::uint64_t, double> height_mm;
  for (const wire::Poses& poses : peer_.all<wire::Poses>()) {
    ASSERT_EQ(poses.poses.values.size(), wire::Poses::kNumbers);
    EXPECT_EQ(poses.poses.values[0], 0);
    height_mm[poses.tick] = poses.poses.values[11];
  }
  int together = 0;
  int apart = 0;
  for (const wire::TickReport& tick : peer_.all<wire::TickReport>()) {
    const auto pose = height_mm.find(tick.tick);
    if (pose == height_mm.end() || tick.object != 0) continue;
    ++(std::abs(1000 * tick.proxy[1] - 20 - pose->second) < 0.05 ? together : apart);
  }
  // Poses are those of the newest scene, which a late tick on a busy machine has not taken over yet.
  EXPECT_GT(together, 5);
  EXPECT_GT(together, 2 * apart);
}

TEST_F(MotionMessages, MarkersReachAllClients) {
  ScriptedPeer other(server_.address());
  ASSERT_TRUE(other.untilConnected());
  ASSERT_TRUE(untilTicks(other, 5));
  peer_.send(wire::Marker{.time = 0, .text = "trial 3 begins"});
  ASSERT_TRUE(other.until([&] { return other.last<wire::Marker>().has_value(); }));
  EXPECT_EQ(other.last<wire::Marker>()->text.text, "trial 3 begins");
  EXPECT_GT(other.last<wire::Marker>()->time, 0) << "the time of the server";
  EXPECT_TRUE(peer_.untilText("this server records nothing"));
  for (int i = 0; i < 300; ++i) peer_.send(wire::Marker{.time = 0, .text = "again"});
  EXPECT_TRUE(peer_.untilText("Marker refused: the server takes 100 in a second from each client"));
  other.send(wire::Marker{.time = 0, .text = "of another"});
  EXPECT_TRUE(other.until([&] { return other.last<wire::Marker>()->text.text == "of another"; }));
  peer_.send(wire::ReplayControl{});
  EXPECT_TRUE(peer_.untilText("Replay_Control refused: this server replays no recording"));
}

TEST_F(MotionMessages, PoseThatJumpsOverTheHandIsReported) {
  sendCube(peer_);
  ASSERT_TRUE(untilApplied(peer_));
  pause(std::chrono::milliseconds(300));
  move(25);
  EXPECT_TRUE(peer_.untilText("Move the device out of the object"));
}

}  // namespace
}  // namespace hapticd::test
