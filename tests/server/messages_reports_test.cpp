// Reports of the HIP, the buttons and the contact, and the messages that change them.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "feeling.h"
#include "hands.h"

namespace hapticd::test {
namespace {

class WorkspaceMessages : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(untilHandAt(peer_, kPlace_m)); }

  const Vec3 kPlace_m{0.010, 0.020, 0.005};
  const Hand hand_ = Hand::at(kPlace_m);
  RunningServer server_{hand_.config()};
  ScriptedPeer peer_{server_.address()};
};

// The workspace of the simulated device is 160 x 120 x 70 mm; a view of twice that size doubles every motion.
TEST_F(WorkspaceMessages, SetWorkspaceBoundingBoxFitsTheBox) {
  peer_.send(wire::SetWorkspaceBoundingBox{kIdentity, {-160, -120, -70, 160, 120, 70}});
  EXPECT_TRUE(untilHandAt(peer_, 2 * kPlace_m));
}

TEST_F(WorkspaceMessages, SetWorkspaceProjectionMatrixFitsTheView) {
  peer_.send(wire::SetWorkspaceProjectionMatrix{
      kIdentity, {1.0 / 160, 0, 0, 0, 0, 1.0 / 120, 0, 0, 0, 0, -1.0 / 70, 0, 0, 0, 0, 1}});
  EXPECT_TRUE(untilHandAt(peer_, 2 * kPlace_m));
}

TEST_F(WorkspaceMessages, EachWorkspaceReplacesThePreviousOne) {
  for (int i = 0; i < 3; ++i) {
    peer_.send(wire::SetWorkspaceBoundingBox{kIdentity, {-160, -120, -70, 160, 120, 70}});
  }
  EXPECT_TRUE(untilHandAt(peer_, 2 * kPlace_m));
}

TEST_F(WorkspaceMessages, SetHapticScaleScalesTheMotion) {
  peer_.send(wire::SetHapticScale{3});
  EXPECT_TRUE(untilHandAt(peer_, 3 * kPlace_m));
}

TEST_F(WorkspaceMessages, SetHapticOriginPlacesTheDevice) {
  peer_.send(wire::SetHapticOrigin{{0.1F, 0, 0}, {0, 0, 1}, 1.5707963F});
  EXPECT_TRUE(untilHandAt(peer_, {0.1 - kPlace_m.y(), kPlace_m.x(), kPlace_m.z()}));
}

TEST_F(WorkspaceMessages, ResetSceneRestoresTheInitialWorkspace) {
  peer_.send(wire::SetHapticScale{3});
  ASSERT_TRUE(untilHandAt(peer_, 3 * kPlace_m));
  peer_.send(wire::ResetScene{});
  EXPECT_TRUE(untilHandAt(peer_, kPlace_m));
}

// A datagram could overtake the descriptions that it needs, and a hand at rest is reported only once.
TEST_F(WorkspaceMessages, ALateClientGetsTheRestingPoseByTcp) {
  ScriptedPeer late(server_.address(), "Phantom", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(untilHandAt(late, kPlace_m));
  // While the hand still settles, datagrams follow.
  EXPECT_TRUE(late.until([&] {
    return std::ranges::any_of(late.messages(), [](const auto& message) {
      return message.kind == wire::kindOf<wire::TrackerPosQuat> && !message.byDatagram;
    });
  }));
}

class Reports : public testing::Test {
 protected:
  static constexpr double kTurn_deg = 30;

  void SetUp() override {
    ASSERT_TRUE(peer_.untilConnected());
    sendCube(peer_);
    ASSERT_TRUE(untilTouchedAt(peer_, 0, kCubeTop_m));
  }

  const Hand hand_ = Hand::stroking(kTurn_deg * M_PI / 180);
  RunningServer server_{hand_.config()};
  ScriptedPeer peer_{server_.address()};
};

TEST_F(Reports, ForcePushesOutAndEndsWithTheContact) {
  EXPECT_TRUE(peer_.until([&] {
    const auto force = peer_.last<wire::Force>();
    return force && force->force[1] > 0.5;
  }));
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}, 2e-3));
}

TEST_F(Reports, DopIsTheDepthOfTheHipBelowTheSurface) {
  // The target is 5 mm deep; the hand is a spring of 300 N/m against one of 500 N/m.
  EXPECT_TRUE(peer_.until([&] {
    const auto depth = peer_.last<wire::Dop>();
    return depth && std::abs(depth->depth - 0.005 * 300 / 800) < 2e-4;
  }));
  EXPECT_TRUE(peer_.until([&] { return peer_.last<wire::Dop>()->depth == 0; }));
}

TEST_F(Reports, ScpLiesOnTheSurfaceWithTheStylusOrientation) {
  const wire::Scp scp = *peer_.last<wire::Scp>();
  EXPECT_NEAR(scp.position[0], 0, 1e-4);
  EXPECT_NEAR(scp.position[2], 0, 1e-4);
  EXPECT_NEAR(scp.orientation[2], std::sin(kTurn_deg / 2 * M_PI / 180), 1e-3);
  EXPECT_NEAR(scp.orientation[3], std::cos(kTurn_deg / 2 * M_PI / 180), 1e-3);
}

TEST_F(Reports, AngleIsBetweenStylusAndNormalInDegrees) {
  const auto inContact = [](const auto& m) { return m.touching == 1; };
  ASSERT_TRUE(peer_.until([&] { return peer_.last<wire::Angle>(inContact).has_value(); }));
  EXPECT_NEAR(peer_.last<wire::Angle>(inContact)->angle, kTurn_deg, 0.1);
  ASSERT_TRUE(peer_.until([&] { return peer_.last<wire::Angle>()->touching == 0; }));
  EXPECT_EQ(peer_.last<wire::Angle>()->angle, 0);
}

TEST_F(Reports, TouchedObjectAndIsTouchingReportContactAndItsEnd) {
  for (const std::int32_t object : {-1, 0, -1}) {
    ASSERT_TRUE(peer_.until([&] { return peer_.last<wire::TouchedObject>()->object == object; })) << object;
    ASSERT_TRUE(
        peer_.until([&] { return peer_.last<wire::IsTouching>()->touching == (object >= 0 ? 1 : 0); }));
  }
}

TEST_F(Reports, PosQuatReportsProxyHipAndContact) {
  subscribeToSensors(peer_);
  std::set<std::int32_t> sensors;
  ASSERT_TRUE(peer_.until([&] {
    for (const auto& pose : peer_.all<wire::TrackerPosQuat>()) sensors.insert(pose.sensor);
    return sensors.size() >= 3;
  }));
  EXPECT_EQ(sensors, (std::set<std::int32_t>{0, 1, 2}));
  const auto pose = *peer_.last<wire::TrackerPosQuat>([](const auto& m) { return m.sensor == 1; });
  EXPECT_NEAR(pose.orientation[2], std::sin(kTurn_deg / 2 * M_PI / 180), 1e-3);
  for (const auto& proxy : peer_.all<wire::TrackerPosQuat>()) {
    if (proxy.sensor == 2) {
      EXPECT_NEAR(proxy.position[1], kCubeTop_m, 1e-4);
    }
  }
}

TEST_F(Reports, VelocityIsThatOfTheHip) {
  // 25 mm in 60 ms.
  EXPECT_TRUE(peer_.until([&] {
    const auto velocity = peer_.last<wire::TrackerVelocity>();
    return velocity && velocity->sensor == 0 && std::abs(velocity->velocity[1] + 0.417) < 0.05;
  }));
}

TEST_F(Reports, AccelerationIsNotReported) {
  EXPECT_TRUE(peer_.until([&] { return peer_.count<wire::TrackerVelocity>() >= 50; }));
  EXPECT_EQ(peer_.count<wire::TrackerAcceleration>(), 0U);
}

TEST_F(Reports, ButtonChangeReportsEveryPressAndRelease) {
  std::vector<std::int32_t> states;
  ASSERT_TRUE(peer_.until([&] {
    states.clear();
    for (const auto& change : peer_.all<wire::ButtonChange>()) {
      if (change.button == 0) states.push_back(change.state);
    }
    return states.size() >= 4;
  }));
  for (std::size_t i = 1; i < states.size(); ++i) EXPECT_EQ(states[i], 1 - states[i - 1]);
}

TEST(ReportsOfTrips, ForceErrorReportsATripAndItsEnd) {
  Hand hand = Hand::at({0, 0, 0});
  for (double t_s = 0.5; t_s < 60; t_s += 1) {  // 50 mm in 20 ms is 2.5 m/s
    hand.row(t_s, {0, 0, 0});
    hand.row(t_s + 0.02, {0.05, 0, 0});
    hand.row(t_s + 0.3, {0.05, 0, 0});
    hand.row(t_s + 0.6, {0, 0, 0});
  }
  RunningServer server(hand.config());
  ScriptedPeer peer(server.address());
  const auto reportedError = [&](std::int32_t code) {
    return peer.until([&] {
      return peer.last<wire::ForceError>([&](const auto& m) { return m.code == code; }).has_value();
    });
  };
  EXPECT_TRUE(reportedError(2));
  EXPECT_TRUE(reportedError(4));
}

}  // namespace
}  // namespace hapticd::test
