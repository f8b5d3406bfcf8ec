// Messages that make forces without objects, checked by a hand that rests or strokes.
#include <gtest/gtest.h>

#include "feeling.h"
#include "hands.h"

namespace hapticd::test {
namespace {

constexpr double kHandStiffness_N_per_m = 300;  // of the simulated hand

wire::Effect effect(const char* type, std::int32_t index = 0) {
  return {.type = type,
          .index = index,
          .gain = 0.1,
          .magnitude = 1,
          .duration = 0,
          .frequency = 50,
          .position = {10, 0, 0},
          .direction = {1, 0, 0}};
}

// Whether the reported force has changed direction this often, by at least 0.1 N.
bool oscillates(const ScriptedPeer& peer, int axis, int turns = 10) {
  double extreme = 0;
  int direction = 0;
  for (const auto& force : peer.all<wire::Force>()) {
    const double value = force.force[static_cast<std::size_t>(axis)];
    const double step = value - extreme;
    if (direction * step >= 0) {
      extreme = value;
      if (direction == 0 && step != 0) direction = step > 0 ? 1 : -1;
    } else if (std::abs(step) > 0.1) {
      extreme = value;
      direction = -direction;
      --turns;
    }
  }
  return turns <= 0;
}

class ForceMessages : public testing::Test {
 protected:
  void SetUp() override { ASSERT_TRUE(peer_.untilConnected()); }

  const Hand hand_ = Hand::at({0, 0.015, 0});
  RunningServer server_{hand_.config()};
  ScriptedPeer peer_{server_.address()};
};

TEST_F(ForceMessages, ForceFieldPushesUntilItIsZero) {
  peer_.send(wire::ForceField{{}, {0.5F, 0, -0.5F}, {}, 1});
  ASSERT_TRUE(untilForce(peer_, {0.5, 0, -0.5}));
  peer_.send(wire::ForceField{});
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}));
}

TEST_F(ForceMessages, ForceFieldVariesByItsJacobianWithinItsRadius) {
  // 100 N/m towards a point 10 mm away, against the hand of 300 N/m.
  wire::ForceField spring{{0.010F, 0.015F, 0}, {}, {-100, 0, 0, 0, -100, 0, 0, 0, -100}, 0.05F};
  peer_.send(spring);
  ASSERT_TRUE(untilForce(peer_, {0.75, 0, 0}));
  spring.radius = 0.005F;
  peer_.send(spring);
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}));
}

TEST_F(ForceMessages, PlanePushesOutUntilItsNormalIsZero) {
  wire::Plane plane{.plane = {0, 1, 0, -0.020F},
                    .stiffness = 0.3F,
                    .damping = 0,
                    .dynamicFriction = 0,
                    .staticFriction = 0,
                    .index = 0,
                    .recoveryCycles = 1};
  peer_.send(plane);
  // As stiff as the hand: each deflects by 2.5 mm.
  ASSERT_TRUE(untilForce(peer_, {0, 0.0025 * kHandStiffness_N_per_m, 0}));
  EXPECT_EQ(peer_.last<wire::IsTouching>()->touching, 1);
  EXPECT_NEAR(peer_.last<wire::Scp>()->position[1], 0.020, 1e-4);
  plane.plane = {};
  peer_.send(plane);
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}));
}

TEST_F(ForceMessages, Plane2MakesThePlaneBuzz) {
  peer_.send(wire::Plane{.plane = {0, 1, 0, -0.020F},
                         .stiffness = 0.3F,
                         .damping = 0,
                         .dynamicFriction = 0,
                         .staticFriction = 0,
                         .index = 0,
                         .recoveryCycles = 1});
  ASSERT_TRUE(untilForce(peer_, {0, 0.75, 0}));
  ASSERT_TRUE(catchUp(peer_));
  wire::Plane2 detail;
  detail.buzzAmplitude = 0.001F;
  detail.buzzFrequency = 40;
  peer_.send(detail);
  EXPECT_TRUE(peer_.until([&] { return oscillates(peer_, 1); }));
}

TEST(ForceMessagesInMotion, Plane2AdhesionHoldsTheHand) {
  const Hand hand = Hand::stroking();
  RunningServer server(hand.config());
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  peer.send(wire::Plane{.plane = {0, 1, 0, -0.020F},
                        .stiffness = 0.3F,
                        .damping = 0,
                        .dynamicFriction = 0,
                        .staticFriction = 0,
                        .index = 0,
                        .recoveryCycles = 1});
  wire::Plane2 detail;
  detail.normalAdhesion = 1;
  peer.send(detail);
  EXPECT_TRUE(peer.until([&] {
    const auto force = peer.last<wire::Force>();
    return force && force->force[1] < -0.3;
  })) << "a plane without adhesion never pulls";
}

TEST_F(ForceMessages, ConstraintToAPoint) {
  peer_.send(wire::ConstraintMode{1});
  peer_.send(wire::ConstraintPoint{{0.010F, 0.015F, 0}});
  peer_.send(wire::ConstraintStiffness{100});
  peer_.send(wire::ConstraintEnable{1});
  ASSERT_TRUE(untilForce(peer_, {0.75, 0, 0}));
  peer_.send(wire::ConstraintStiffness{300});
  ASSERT_TRUE(untilForce(peer_, {1.5, 0, 0}));
  peer_.send(wire::ConstraintEnable{0});
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}));
}

TEST_F(ForceMessages, ConstraintToALine) {
  peer_.send(wire::ConstraintMode{2});
  peer_.send(wire::ConstraintLinePoint{{0.010F, 0.025F, 0}});
  peer_.send(wire::ConstraintLineDirection{{2, 0, 0}});
  peer_.send(wire::ConstraintStiffness{100});
  peer_.send(wire::ConstraintEnable{1});
  ASSERT_TRUE(untilForce(peer_, {0, 0.75, 0}));
  peer_.send(wire::ConstraintLineDirection{{0, 2, 0}});
  EXPECT_TRUE(untilForce(peer_, {0.75, 0, 0}));
}

TEST_F(ForceMessages, ConstraintToAPlane) {
  peer_.send(wire::ConstraintMode{3});
  peer_.send(wire::ConstraintPlanePoint{{0.010F, 0.025F, 0.030F}});
  peer_.send(wire::ConstraintPlaneNormal{{3, 0, 0}});
  peer_.send(wire::ConstraintStiffness{100});
  peer_.send(wire::ConstraintEnable{1});
  ASSERT_TRUE(untilForce(peer_, {0.75, 0, 0}));
  peer_.send(wire::ConstraintMode{0});
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}));
}

TEST_F(ForceMessages, CustomEffectBuzzesUntilStopped) {
  wire::CustomEffect buzz;
  buzz.effect = 0;
  buzz.parameters.values = {1, 40, 100, 0, 0, 1};
  peer_.send(buzz);
  ASSERT_TRUE(peer_.until([&] { return oscillates(peer_, 2); }));
  wire::CustomEffect stop;
  stop.effect = wire::kStopCustomEffect;
  peer_.send(stop);
  ASSERT_TRUE(untilApplied(peer_));
  ASSERT_TRUE(catchUp(peer_));
  ASSERT_TRUE(peer_.until([&] { return peer_.count<wire::IsTouching>() >= 100; }));
  EXPECT_LE(peer_.count<wire::Force>(), 20U) << "the force still changes";
}

TEST_F(ForceMessages, UnknownCustomEffectIsRefused) {
  wire::CustomEffect unknown;
  unknown.effect = 7;
  peer_.send(unknown);
  EXPECT_TRUE(peer_.untilText("there is no such custom effect"));
}

TEST_F(ForceMessages, EffectActsFromStartToStop) {
  peer_.send(effect("constant"));
  peer_.send(wire::StartEffect{0});
  ASSERT_TRUE(untilForce(peer_, {1, 0, 0}));
  wire::Effect turned = effect("constant");
  turned.direction = {0, 0, -2};
  peer_.send(turned);
  ASSERT_TRUE(untilForce(peer_, {0, 0, -1})) << "a running effect is updated in place";
  peer_.send(wire::StopEffect{0});
  EXPECT_TRUE(untilForce(peer_, {0, 0, 0}));
}

TEST_F(ForceMessages, EffectWithADurationEndsByItself) {
  peer_.send(effect("constant", 1));
  peer_.send(wire::StartEffect{1});
  ASSERT_TRUE(untilForce(peer_, {1, 0, 0})) << "the force ramps in after the start";
  peer_.send(wire::StopEffect{1});
  ASSERT_TRUE(untilForce(peer_, {0, 0, 0}));
  wire::Effect brief = effect("constant");
  brief.duration = 150;
  peer_.send(brief);
  for (int i = 0; i < 2; ++i) {
    // After a late tick the guard ramps for longer than the effect lasts, and nothing is felt: start again.
    ASSERT_TRUE(peer_.until([&] {
      peer_.send(wire::StartEffect{0});
      return peer_.until([&] { return norm(peer_.last<wire::Force>()->force) > 0.5; }, 1s);
    })) << i;
    ASSERT_TRUE(untilForce(peer_, {0, 0, 0})) << i;
  }
}

TEST_F(ForceMessages, EffectSpringPullsToItsPosition) {
  peer_.send(effect("spring"));
  peer_.send(wire::StartEffect{0});
  EXPECT_TRUE(peer_.until([&] {
    const auto force = peer_.last<wire::Force>();
    return force && force->force[0] > 0.2 && force->force[1] < -0.2;
  }));
}

TEST_F(ForceMessages, EffectMotorVibrationRotates) {
  for (const char* name : {"vibrationMotor", "motorVibration"}) {
    ASSERT_TRUE(catchUp(peer_));
    peer_.send(effect(name));
    peer_.send(wire::StartEffect{0});
    EXPECT_TRUE(peer_.until([&] { return oscillates(peer_, 0) && oscillates(peer_, 1); })) << name;
    peer_.send(wire::StopEffect{0});
  }
}

TEST(ForceMessagesInMotion, EffectsThatNeedMotionOrContact) {
  const Hand hand = Hand::stroking();
  RunningServer server(hand.config());
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  for (const char* name : {"viscous", "friction"}) {
    wire::Effect drag = effect(name);
    drag.gain = 0.003;
    peer.send(drag);
    peer.send(wire::StartEffect{0});
    EXPECT_TRUE(peer.until([&] { return oscillates(peer, 1, 4); })) << name << " acts against each stroke";
    peer.send(wire::StopEffect{0});
    ASSERT_TRUE(untilApplied(peer));
    ASSERT_TRUE(catchUp(peer));
  }
  peer.send(effect("vibrationContact"));
  peer.send(wire::StartEffect{0});
  ASSERT_TRUE(untilApplied(peer));
  EXPECT_EQ(peer.texts().size(), 1U) << "the effect is refused";
  sendCube(peer);  // may appear around the hand, which a text says
  EXPECT_TRUE(untilTouchedAt(peer, 0, kCubeTop_m));
}

}  // namespace
}  // namespace hapticd::test
