// Objects that start to move beside a resting hand, and objects that appear around it, over the wire.
#include <gtest/gtest.h>

#include <chrono>
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

TEST_F(MotionMessages, PoseThatJumpsOverTheHandIsReported) {
  sendCube(peer_);
  ASSERT_TRUE(untilApplied(peer_));
  pause(std::chrono::milliseconds(300));
  move(25);
  EXPECT_TRUE(peer_.untilText("Move the device out of the object"));
}

}  // namespace
}  // namespace hapticd::test
