// Every call of the client arrives as its message.
#include "client/client_tests.h"

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

TEST_P(BothWays, SceneCallsArriveWithTheirFields) {
  ScriptedServer server;
  Client client(name(server));
  Matrix4 m{};
  for (std::size_t i = 0; i < 16; ++i) m[i] = 0.5 + static_cast<double>(i);
  client.setObjectCount(3);
  client.setSurface(1, {0.1F, 0.2F, 0.3F, 0.4F, 0.5F, 0.6F});
  client.setTransform(2, m);
  client.setTouchable(2, false);
  client.setTouchableFaces(Faces::back);
  client.setWorkspaceBox({{1, 2, 3}, {4, 5, 6}}, m);
  client.setWorkspaceProjection(kIdentity, m);
  client.setEffect(7, {EffectType::spring, 1, 2, 3, 4, {5, 6, 7}, {8, 9, 10}});
  client.startEffect(7);
  client.stopEffect(7);
  client.resetScene();
  client.flushAll();

  const auto received = server.waitReceived(16);
  ASSERT_EQ(received.size(), 16U);
  EXPECT_TRUE(is(received[0], wire::SetObjectNumber{3}));
  EXPECT_TRUE(is(received[1], wire::SetHapticProperty{1, "stiffness", 0.1F}));
  EXPECT_TRUE(is(received[2], wire::SetHapticProperty{1, "damping", 0.2F}));
  EXPECT_TRUE(is(received[3], wire::SetHapticProperty{1, "static friction", 0.3F}));
  EXPECT_TRUE(is(received[4], wire::SetHapticProperty{1, "dynamic friction", 0.4F}));
  EXPECT_TRUE(is(received[5], wire::SetHapticProperty{1, "popthrough", 0.5F}));
  EXPECT_TRUE(is(received[6], wire::SetHapticProperty{1, "mass", 0.6F}));
  EXPECT_TRUE(is(received[7], wire::SetTransformMatrix{2, m}));
  EXPECT_TRUE(is(received[8], wire::SetObjectIsTouchable{2, 0}));
  EXPECT_TRUE(is(received[9], wire::SetTouchableFace{1}));
  EXPECT_TRUE(is(received[10], wire::SetWorkspaceBoundingBox{m, {1, 2, 3, 4, 5, 6}}));
  EXPECT_TRUE(is(received[11], wire::SetWorkspaceProjectionMatrix{kIdentity, m}));
  EXPECT_TRUE(is(received[12], wire::Effect{"spring", 7, 1, 2, 3, 4, {5, 6, 7}, {8, 9, 10}}));
  EXPECT_TRUE(is(received[13], wire::StartEffect{7}));
  EXPECT_TRUE(is(received[14], wire::StopEffect{7}));
  EXPECT_TRUE(is(received[15], wire::ResetScene{}));
  for (const Received& t : received) {
    EXPECT_EQ(t.sender, "Phantom");
    EXPECT_FALSE(t.byDatagram) << "a definition that is lost cannot be started";
    EXPECT_GT(t.time.seconds, 1000000000U);
  }
}

TEST(Client, EffectMakersFillTheirFields) {
  ScriptedServer server;
  Client client(server.tcpName());
  client.setEffect(0, Effect::constant({0, 1, 0}, 2, 100));
  client.setEffect(1, Effect::spring({1, 2, 3}, 0.5, 2, 100));
  client.setEffect(2, Effect::viscous(0.01, 1, 5));
  client.setEffect(3, Effect::friction(0.5, 1));
  client.setEffect(4, Effect::motorVibration(80, 0.5));
  client.setEffect(5, Effect::contactVibration(300, 0.25));
  client.flushAll();
  const auto received = server.waitReceived(6);
  ASSERT_EQ(received.size(), 6U);
  EXPECT_TRUE(is(received[0], wire::Effect{"constant", 0, 0, 2, 100, 0, {}, {0, 1, 0}}));
  EXPECT_TRUE(is(received[1], wire::Effect{"spring", 1, 0.5, 2, 100, 0, {1, 2, 3}, {}}));
  EXPECT_TRUE(is(received[2], wire::Effect{"viscous", 2, 0.01, 1, 5, 0, {}, {}}));
  EXPECT_TRUE(is(received[3], wire::Effect{"friction", 3, 0.5, 1, 0, 0, {}, {}}));
  EXPECT_TRUE(is(received[4], wire::Effect{"vibrationMotor", 4, 0, 0.5, 0, 80, {}, {}}));
  EXPECT_TRUE(is(received[5], wire::Effect{"vibrationContact", 5, 0, 0.25, 0, 300, {}, {}}));
}

TEST(Client, StockCallsArriveWithTheirFields) {
  ScriptedServer server;
  Client client(server.tcpName());
  std::array<float, 16> m{};
  for (std::size_t i = 0; i < 16; ++i) m[i] = static_cast<float>(i);
  client.addObject(4, 2);
  client.addObjectOutsideScene(5);
  client.moveToParent(4, -1);
  client.removeObject(5);
  client.setObjectPosition(4, {1, 2, 3});
  client.setObjectOrientation(4, {0, 1, 0}, 0.5F);
  client.setObjectScale(4, {2, 3, 4});
  client.setNormal(4, 9, 0, 0, 1);
  client.setTriangle(4, 8, {1, 2, 3}, {4, 5, 6});
  client.removeTriangle(4, 8);
  client.updateMesh(4, {.stiffness = 1, .damping = 0.005F, .staticFriction = 0.3F, .dynamicFriction = 0.2F});
  client.transformMesh(4, m);
  client.setMeshType(-1, 1);
  client.clearMesh(4);
  client.setHapticOrigin({1, 2, 3}, {1, 0, 0}, 0.25F);
  client.setHapticScale(2);
  client.setSceneOrigin({3, 2, 1}, {0, 0, 1}, 0.75F);
  client.flushAll();

  const auto received = server.waitReceived(17);
  ASSERT_EQ(received.size(), 17U);
  EXPECT_TRUE(is(received[0], wire::AddObject{4, 2}));
  EXPECT_TRUE(is(received[1], wire::AddObjectExScene{5}));
  EXPECT_TRUE(is(received[2], wire::MoveToParent{4, -1}));
  EXPECT_TRUE(is(received[3], wire::RemoveObject{5}));
  EXPECT_TRUE(is(received[4], wire::SetObjectPosition{4, {1, 2, 3}}));
  EXPECT_TRUE(is(received[5], wire::SetObjectOrientation{4, {0, 1, 0}, 0.5F}));
  EXPECT_TRUE(is(received[6], wire::SetObjectScale{4, {2, 3, 4}}));
  EXPECT_TRUE(is(received[7], wire::SetNormal{4, 9, {0, 0, 1}}));
  EXPECT_TRUE(is(received[8], wire::SetTriangle{4, 8, {1, 2, 3}, {4, 5, 6}}));
  EXPECT_TRUE(is(received[9], wire::RemoveTriangle{4, 8}));
  EXPECT_TRUE(is(received[10], wire::UpdateTrimeshChanges{4, 1, 0.005F, 0.3F, 0.2F}));
  EXPECT_TRUE(is(received[11], wire::TransformTrimesh{4, m}));
  EXPECT_TRUE(is(received[12], wire::SetTrimeshType{-1, 1}));
  EXPECT_TRUE(is(received[13], wire::ClearTrimesh{4}));
  EXPECT_TRUE(is(received[14], wire::SetHapticOrigin{{1, 2, 3}, {1, 0, 0}, 0.25F}));
  EXPECT_TRUE(is(received[15], wire::SetHapticScale{2}));
  EXPECT_TRUE(is(received[16], wire::SetSceneOrigin{{3, 2, 1}, {0, 0, 1}, 0.75F}));
}

TEST(Client, ForceAndDeviceCallsArriveWithTheirFields) {
  ScriptedServer server;
  Client client(server.tcpName());
  client.setPlane({{0, 1, 0, -0.1F}, 0.9F, 0.001F, 0.3F, 0.2F, 1, 12});
  client.setPlaneTexture({1, 2, 3, 4, 5, 6});
  client.stopPlane(1);
  client.setForceField({{1, 2, 3}, {4, 5, 6}, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 0.5F});
  client.stopForceField();
  client.startCustomEffect(3, std::array{1.0F, 2.0F});
  client.stopCustomEffect();
  client.requestToRoom();
  client.requestUnitToSensor();
  client.requestWorkspace();
  client.setUpdateRate(500);
  client.resetOrigin();
  client.setButtonMode(Client::kAllButtons, ButtonMode::toggleStartsOn);
  client.sendText("hello", Severity::warning);
  client.flushAll();

  const auto received = server.waitReceived(14);
  ASSERT_EQ(received.size(), 14U);
  EXPECT_TRUE(is(received[0], wire::Plane{{0, 1, 0, -0.1F}, 0.9F, 0.001F, 0.2F, 0.3F, 1, 12}));
  EXPECT_TRUE(is(received[1], wire::Plane2{1, 2, 3, 4, 5, 6}));
  EXPECT_TRUE(is(received[2], wire::Plane{{}, 0, 0, 0, 0, 1, 0}));
  EXPECT_TRUE(is(received[3], wire::ForceField{{1, 2, 3}, {4, 5, 6}, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 0.5F}));
  EXPECT_TRUE(is(received[4], wire::ForceField{}));
  EXPECT_TRUE(is(received[5], wire::CustomEffect{3, {{1.0F, 2.0F}}}));
  EXPECT_TRUE(is(received[6], wire::CustomEffect{wire::kStopCustomEffect, {}}));
  EXPECT_TRUE(is(received[7], wire::TrackerRequestToRoom{}));
  EXPECT_TRUE(is(received[8], wire::TrackerRequestUnitToSensor{}));
  EXPECT_TRUE(is(received[9], wire::TrackerRequestWorkspace{}));
  EXPECT_TRUE(is(received[10], wire::TrackerSetUpdateRate{500}));
  EXPECT_TRUE(is(received[11], wire::TrackerResetOrigin{}));
  EXPECT_TRUE(is(received[12], wire::ButtonAdmin{-99, 21}));
  EXPECT_TRUE(is(received[13], wire::Text{1, 0, "hello"}));
}

TEST(Client, ConstraintsArriveAndAreReleased) {
  ScriptedServer server;
  Client client(server.tcpName());
  client.constrainToPoint({1, 2, 3}, 100);
  client.constrainToLine({1, 2, 3}, {0, 0, 1}, 200);
  client.constrainToPlane({1, 2, 3}, {0, 1, 0}, 300);
  client.releaseConstraint();
  client.flushAll();
  const auto received = server.waitReceived(15);
  ASSERT_EQ(received.size(), 15U);
  EXPECT_TRUE(is(received[0], wire::ConstraintMode{1}));
  EXPECT_TRUE(is(received[1], wire::ConstraintPoint{{1, 2, 3}}));
  EXPECT_TRUE(is(received[2], wire::ConstraintStiffness{100}));
  EXPECT_TRUE(is(received[3], wire::ConstraintEnable{1}));
  EXPECT_TRUE(is(received[4], wire::ConstraintMode{2}));
  EXPECT_TRUE(is(received[5], wire::ConstraintLinePoint{{1, 2, 3}}));
  EXPECT_TRUE(is(received[6], wire::ConstraintLineDirection{{0, 0, 1}}));
  EXPECT_TRUE(is(received[9], wire::ConstraintMode{3}));
  EXPECT_TRUE(is(received[10], wire::ConstraintPlanePoint{{1, 2, 3}}));
  EXPECT_TRUE(is(received[11], wire::ConstraintPlaneNormal{{0, 1, 0}}));
  EXPECT_TRUE(is(received[14], wire::ConstraintEnable{0}));
}

TEST(Client, FastCommandsLeaveByDatagram) {
  ScriptedServer server;
  Client client(server.name());
  // The server's description of its UDP port may still be on its way.
  std::vector<Received> received;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  do {
    client.setForceField({{0, 0, 0}, {1, 0, 0}, {}, 1});
    client.poll(5ms);
    received = server.waitReceived(1);
  } while (!received.back().byDatagram && std::chrono::steady_clock::now() < end);
  EXPECT_TRUE(received.back().byDatagram);
  EXPECT_GT(client.statistics().udpBytesOut, 0U);
}

}  // namespace
}  // namespace hapticd::test
