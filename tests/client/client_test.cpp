#include "hapticd/client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <time.h>

#include <limits>
#include <numbers>

#include "client/scripted_server.h"
#include "wire/codec.h"

namespace hapticd {
namespace {

using namespace std::chrono_literals;
using test::ScriptedServer;
using test::Told;
using testing::HasSubstr;

constexpr auto kPatience = 20s;

/// Polls until the condition holds; false when patience ends.
template <class Condition>
bool pollUntil(Client& client, Condition&& condition) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    client.poll(10ms);
  }
  return true;
}

template <class M>
::testing::AssertionResult is(const Told& told, const M& expected) {
  const M* message = std::get_if<M>(&told.message);
  if (!message) {
    return ::testing::AssertionFailure()
           << wire::info(wire::kind(told.message)).name << " instead of " << M::kInfo.name;
  }
  if (!(*message == expected)) return ::testing::AssertionFailure() << M::kInfo.name << " with other fields";
  return ::testing::AssertionSuccess();
}

template <class Failure, class Function>
std::string textOf(Function&& function) {
  try {
    function();
  } catch (const Failure& failure) {
    return failure.what();
  }
  return "nothing was thrown";
}

/// A server and a client of it, in each of VRPN's two ways to connect.
class BothWays : public ::testing::TestWithParam<bool> {
 protected:
  bool tcpOnly() const { return GetParam(); }
  std::string name(const ScriptedServer& server) const {
    return tcpOnly() ? server.tcpName() : server.name();
  }
};
INSTANTIATE_TEST_SUITE_P(Connection, BothWays, ::testing::Bool(),
                         [](const auto& way) { return way.param ? "tcp" : "callback"; });

TEST_P(BothWays, ConnectsAndIsAnswered) {
  ScriptedServer server;
  const Client client(name(server));
  EXPECT_TRUE(client.connected());
  EXPECT_EQ(client.device(), "Phantom");
  EXPECT_EQ(client.server(), "127.0.0.1:" + std::to_string(server.port()));
  EXPECT_EQ(server.connections(), 1U);
  EXPECT_GE(server.pings(), 1U);
  EXPECT_EQ(client.statistics().connections, 1U);
}

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
  client.setEffect(7, {"spring", 1, 2, 3, 4, {5, 6, 7}, {8, 9, 10}});
  client.startEffect(7);
  client.stopEffect(7);
  client.resetScene();
  client.flushAll();

  const auto told = server.waitTold(16);
  ASSERT_EQ(told.size(), 16U);
  EXPECT_TRUE(is(told[0], wire::SetObjectNumber{3}));
  EXPECT_TRUE(is(told[1], wire::SetHapticProperty{1, "stiffness", 0.1F}));
  EXPECT_TRUE(is(told[2], wire::SetHapticProperty{1, "damping", 0.2F}));
  EXPECT_TRUE(is(told[3], wire::SetHapticProperty{1, "static friction", 0.3F}));
  EXPECT_TRUE(is(told[4], wire::SetHapticProperty{1, "dynamic friction", 0.4F}));
  EXPECT_TRUE(is(told[5], wire::SetHapticProperty{1, "popthrough", 0.5F}));
  EXPECT_TRUE(is(told[6], wire::SetHapticProperty{1, "mass", 0.6F}));
  EXPECT_TRUE(is(told[7], wire::SetTransformMatrix{2, m}));
  EXPECT_TRUE(is(told[8], wire::SetObjectIsTouchable{2, 0}));
  EXPECT_TRUE(is(told[9], wire::SetTouchableFace{1}));
  EXPECT_TRUE(is(told[10], wire::SetWorkspaceBoundingBox{m, {1, 2, 3, 4, 5, 6}}));
  EXPECT_TRUE(is(told[11], wire::SetWorkspaceProjectionMatrix{kIdentity, m}));
  EXPECT_TRUE(is(told[12], wire::Effect{"spring", 7, 1, 2, 3, 4, {5, 6, 7}, {8, 9, 10}}));
  EXPECT_TRUE(is(told[13], wire::StartEffect{7}));
  EXPECT_TRUE(is(told[14], wire::StopEffect{7}));
  EXPECT_TRUE(is(told[15], wire::ResetScene{}));
  for (const Told& t : told) {
    EXPECT_EQ(t.sender, "Phantom");
    EXPECT_FALSE(t.by_datagram) << "a definition that is lost cannot be started";
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
  const auto told = server.waitTold(6);
  ASSERT_EQ(told.size(), 6U);
  EXPECT_TRUE(is(told[0], wire::Effect{"constant", 0, 0, 2, 100, 0, {}, {0, 1, 0}}));
  EXPECT_TRUE(is(told[1], wire::Effect{"spring", 1, 0.5, 2, 100, 0, {1, 2, 3}, {}}));
  EXPECT_TRUE(is(told[2], wire::Effect{"viscous", 2, 0.01, 1, 5, 0, {}, {}}));
  EXPECT_TRUE(is(told[3], wire::Effect{"friction", 3, 0.5, 1, 0, 0, {}, {}}));
  EXPECT_TRUE(is(told[4], wire::Effect{"vibrationMotor", 4, 0, 0.5, 0, 80, {}, {}}));
  EXPECT_TRUE(is(told[5], wire::Effect{"vibrationContact", 5, 0, 0.25, 0, 300, {}, {}}));
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
  client.updateMesh(4,
                    {.stiffness = 1, .damping = 0.005F, .static_friction = 0.3F, .dynamic_friction = 0.2F});
  client.transformMesh(4, m);
  client.setMeshType(-1, 1);
  client.clearMesh(4);
  client.setHapticOrigin({1, 2, 3}, {1, 0, 0}, 0.25F);
  client.setHapticScale(2);
  client.setSceneOrigin({3, 2, 1}, {0, 0, 1}, 0.75F);
  client.flushAll();

  const auto told = server.waitTold(17);
  ASSERT_EQ(told.size(), 17U);
  EXPECT_TRUE(is(told[0], wire::AddObject{4, 2}));
  EXPECT_TRUE(is(told[1], wire::AddObjectExScene{5}));
  EXPECT_TRUE(is(told[2], wire::MoveToParent{4, -1}));
  EXPECT_TRUE(is(told[3], wire::RemoveObject{5}));
  EXPECT_TRUE(is(told[4], wire::SetObjectPosition{4, {1, 2, 3}}));
  EXPECT_TRUE(is(told[5], wire::SetObjectOrientation{4, {0, 1, 0}, 0.5F}));
  EXPECT_TRUE(is(told[6], wire::SetObjectScale{4, {2, 3, 4}}));
  EXPECT_TRUE(is(told[7], wire::SetNormal{4, 9, {0, 0, 1}}));
  EXPECT_TRUE(is(told[8], wire::SetTriangle{4, 8, {1, 2, 3}, {4, 5, 6}}));
  EXPECT_TRUE(is(told[9], wire::RemoveTriangle{4, 8}));
  EXPECT_TRUE(is(told[10], wire::UpdateTrimeshChanges{4, 1, 0.005F, 0.3F, 0.2F}));
  EXPECT_TRUE(is(told[11], wire::TransformTrimesh{4, m}));
  EXPECT_TRUE(is(told[12], wire::SetTrimeshType{-1, 1}));
  EXPECT_TRUE(is(told[13], wire::ClearTrimesh{4}));
  EXPECT_TRUE(is(told[14], wire::SetHapticOrigin{{1, 2, 3}, {1, 0, 0}, 0.25F}));
  EXPECT_TRUE(is(told[15], wire::SetHapticScale{2}));
  EXPECT_TRUE(is(told[16], wire::SetSceneOrigin{{3, 2, 1}, {0, 0, 1}, 0.75F}));
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

  const auto told = server.waitTold(14);
  ASSERT_EQ(told.size(), 14U);
  EXPECT_TRUE(is(told[0], wire::Plane{{0, 1, 0, -0.1F}, 0.9F, 0.001F, 0.2F, 0.3F, 1, 12}));
  EXPECT_TRUE(is(told[1], wire::Plane2{1, 2, 3, 4, 5, 6}));
  EXPECT_TRUE(is(told[2], wire::Plane{{}, 0, 0, 0, 0, 1, 0}));
  EXPECT_TRUE(is(told[3], wire::ForceField{{1, 2, 3}, {4, 5, 6}, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 0.5F}));
  EXPECT_TRUE(is(told[4], wire::ForceField{}));
  EXPECT_TRUE(is(told[5], wire::CustomEffect{3, {{1.0F, 2.0F}}}));
  EXPECT_TRUE(is(told[6], wire::CustomEffect{wire::kStopCustomEffect, {}}));
  EXPECT_TRUE(is(told[7], wire::TrackerRequestToRoom{}));
  EXPECT_TRUE(is(told[8], wire::TrackerRequestUnitToSensor{}));
  EXPECT_TRUE(is(told[9], wire::TrackerRequestWorkspace{}));
  EXPECT_TRUE(is(told[10], wire::TrackerSetUpdateRate{500}));
  EXPECT_TRUE(is(told[11], wire::TrackerResetOrigin{}));
  EXPECT_TRUE(is(told[12], wire::ButtonAdmin{-99, 21}));
  EXPECT_TRUE(is(told[13], wire::Text{1, 0, "hello"}));
}

TEST(Client, ConstraintsArriveAndAreReleased) {
  ScriptedServer server;
  Client client(server.tcpName());
  client.constrainToPoint({1, 2, 3}, 100);
  client.constrainToLine({1, 2, 3}, {0, 0, 1}, 200);
  client.constrainToPlane({1, 2, 3}, {0, 1, 0}, 300);
  client.releaseConstraint();
  client.flushAll();
  const auto told = server.waitTold(15);
  ASSERT_EQ(told.size(), 15U);
  EXPECT_TRUE(is(told[0], wire::ConstraintMode{1}));
  EXPECT_TRUE(is(told[1], wire::ConstraintPoint{{1, 2, 3}}));
  EXPECT_TRUE(is(told[2], wire::ConstraintStiffness{100}));
  EXPECT_TRUE(is(told[3], wire::ConstraintEnable{1}));
  EXPECT_TRUE(is(told[4], wire::ConstraintMode{2}));
  EXPECT_TRUE(is(told[5], wire::ConstraintLinePoint{{1, 2, 3}}));
  EXPECT_TRUE(is(told[6], wire::ConstraintLineDirection{{0, 0, 1}}));
  EXPECT_TRUE(is(told[9], wire::ConstraintMode{3}));
  EXPECT_TRUE(is(told[10], wire::ConstraintPlanePoint{{1, 2, 3}}));
  EXPECT_TRUE(is(told[11], wire::ConstraintPlaneNormal{{0, 1, 0}}));
  EXPECT_TRUE(is(told[14], wire::ConstraintEnable{0}));
}

TEST_P(BothWays, ReportsReachTheirCallbacks) {
  ScriptedServer server;
  Client client(name(server));
  std::size_t calls = 0;
  const auto stamp = Time(std::chrono::seconds(1700000000) + 250000us);
  const auto check = [&](const auto& report) {
    EXPECT_EQ(report.time, stamp);
    ++calls;
  };
  client.onPose([&](const PoseReport& r) {
    check(r);
    EXPECT_EQ(r.sensor, 1);
    EXPECT_EQ(r.position_m, (Vec3{1, 2, 3}));
    EXPECT_EQ(r.orientation, (Quaternion{0.1, 0.2, 0.3, 0.9}));
  });
  client.onVelocity([&](const VelocityReport& r) {
    check(r);
    EXPECT_EQ(r.velocity_m_per_s, (Vec3{4, 5, 6}));
    EXPECT_EQ(r.rotation_interval_s, 0.5);
  });
  client.onAcceleration([&](const AccelerationReport& r) {
    check(r);
    EXPECT_EQ(r.acceleration_m_per_s2, (Vec3{7, 8, 9}));
  });
  client.onAnalog([&](const AnalogReport& r) {
    check(r);
    EXPECT_EQ(r.channels, (std::vector<double>{1, 2.5}));
  });
  client.onForce([&](const ForceReport& r) {
    check(r);
    EXPECT_EQ(r.force_N, (Vec3{1, -2, 3}));
  });
  client.onDepth([&](const DepthReport& r) {
    check(r);
    EXPECT_EQ(r.depth_m, 0.004);
  });
  client.onContactPoint([&](const ContactPointReport& r) {
    check(r);
    EXPECT_EQ(r.position_m, (Vec3{3, 2, 1}));
  });
  client.onTouching([&](const TouchingReport& r) {
    check(r);
    EXPECT_TRUE(r.touching);
  });
  client.onTouchedObject([&](const TouchedObjectReport& r) {
    check(r);
    EXPECT_EQ(r.object, 5);
  });
  client.onAngle([&](const AngleReport& r) {
    check(r);
    EXPECT_EQ(r.angle_deg, 45);
    EXPECT_TRUE(r.touching);
  });
  client.onForceError([&](const ForceErrorReport& r) {
    check(r);
    EXPECT_EQ(r.error, ForceError::force);
  });
  client.onText([&](const TextReport& r) {
    check(r);
    EXPECT_EQ(r.severity, Severity::warning);
    EXPECT_EQ(r.text, "stiffness 2 of object 0 clamped to 1");
  });
  client.onToRoom([&](const ToRoomReport& r) {
    check(r);
    EXPECT_EQ(r.position_m, (Vec3{1, 1, 1}));
  });
  client.onUnitToSensor([&](const UnitToSensorReport& r) {
    check(r);
    EXPECT_EQ(r.sensor, 2);
  });
  client.onWorkspace([&](const WorkspaceReport& r) {
    check(r);
    EXPECT_EQ(r.max_m, (Vec3{4, 5, 6}));
  });
  server.say(wire::TrackerPosQuat{1, 0, {1, 2, 3}, {0.1, 0.2, 0.3, 0.9}});
  server.say(wire::TrackerVelocity{1, 0, {4, 5, 6}, {0, 0, 0, 1}, 0.5});
  server.say(wire::TrackerAcceleration{1, 0, {7, 8, 9}, {0, 0, 0, 1}, 0.5});
  server.say(wire::AnalogChannels{{{1, 2.5}}});
  server.say(wire::Force{{1, -2, 3}});
  server.say(wire::Dop{0.004});
  server.say(wire::Scp{{3, 2, 1}, {0, 0, 0, 1}});
  server.say(wire::IsTouching{1});
  server.say(wire::TouchedObject{5});
  server.say(wire::Angle{45, 1});
  server.say(wire::ForceError{2});
  server.say(wire::Text{1, 0, "stiffness 2 of object 0 clamped to 1"});
  server.say(wire::TrackerToRoom{{1, 1, 1}, {0, 0, 0, 1}});
  server.say(wire::TrackerUnitToSensor{2, 0, {}, {0, 0, 0, 1}});
  server.say(wire::TrackerWorkspace{{1, 2, 3}, {4, 5, 6}});
  ASSERT_TRUE(pollUntil(client, [&] { return calls == 15; })) << calls << " of 15";

  const LatestReports& latest = client.latest();
  EXPECT_EQ(latest.pose.at(1).position_m, (Vec3{1, 2, 3}));
  EXPECT_EQ(latest.force.force_N, (Vec3{1, -2, 3}));
  EXPECT_EQ(latest.depth.depth_m, 0.004);
  EXPECT_TRUE(latest.touching.touching);
  EXPECT_EQ(latest.touched_object.object, 5);
  const Statistics statistics = client.statistics();
  EXPECT_EQ(statistics[ReportKind::force].count, 1U);
  EXPECT_EQ(statistics[ReportKind::force].latency.count(), 1U);
  EXPECT_EQ(statistics.messages_damaged, 0U);
  if (tcpOnly()) {
    EXPECT_EQ(statistics.udp_bytes_in, 0U);
  } else {
    EXPECT_GE(statistics.udp_bytes_in, 8U * 24U) << "fast reports come by datagram";
  }
}

TEST(Client, ButtonsAreNewsOnlyWhenTheyChange) {
  ScriptedServer server;
  Client client(server.tcpName());
  std::vector<std::pair<int, bool>> seen;
  client.onButton([&](const ButtonReport& r) { seen.emplace_back(r.button, r.pressed); });
  server.say(wire::ButtonStates{{{0, 1}}});
  server.say(wire::ButtonStates{{{0, 1}}});
  server.say(wire::ButtonChange{1, 0});
  server.say(wire::ButtonStates{{{1, 0}}});
  ASSERT_TRUE(pollUntil(client, [&] { return seen.size() == 3; }));
  EXPECT_EQ(seen, (std::vector<std::pair<int, bool>>{{1, true}, {1, false}, {0, true}}));
}

TEST(Client, ReportsOfOtherDevicesAreNotItsOwn) {
  ScriptedServer server;
  Client client(server.tcpName());
  int forces = 0;
  client.onForce([&](const ForceReport& r) { forces += r.force_N[0] == 1 ? 1 : 100; });
  server.say(wire::Force{{9, 9, 9}}, {}, "OtherDevice");
  server.say(wire::Force{{1, 0, 0}});
  ASSERT_TRUE(pollUntil(client, [&] { return forces > 0; }));
  EXPECT_EQ(forces, 1);
}

TEST(Client, FastCommandsLeaveByDatagram) {
  ScriptedServer server;
  Client client(server.name());
  // The server's description of its UDP port may still be on its way.
  std::vector<Told> told;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  do {
    client.setForceField({{0, 0, 0}, {1, 0, 0}, {}, 1});
    client.poll(5ms);
    told = server.waitTold(1);
  } while (!told.back().by_datagram && std::chrono::steady_clock::now() < end);
  EXPECT_TRUE(told.back().by_datagram);
  EXPECT_GT(client.statistics().udp_bytes_out, 0U);
}

TEST_P(BothWays, ConnectsAgainWhenTheServerIsBack) {
  auto server = std::make_unique<ScriptedServer>();
  const std::uint16_t port = server->port();
  Client client(name(*server));
  std::vector<bool> states;
  std::string reason;
  client.onConnection([&](const ConnectionReport& r) {
    states.push_back(r.connected);
    if (!r.connected) reason = r.reason;
  });
  client.poll(0ms);
  server->say(wire::TouchedObject{5});
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().touched_object.object == 5; }));
  server.reset();
  ASSERT_TRUE(pollUntil(client, [&] { return !client.connected(); }));
  ASSERT_TRUE(pollUntil(client, [&] { return !states.empty() && !states.back(); }));
  EXPECT_EQ(client.latest().touched_object.object, -1) << "what was felt is no longer known";
  EXPECT_FALSE(reason.empty());
  client.startEffect(1);
  EXPECT_EQ(client.statistics().messages_dropped, 1U);

  server = std::make_unique<ScriptedServer>(test::ScriptedServerOptions{.port = port});
  ASSERT_TRUE(pollUntil(client, [&] { return client.connected() && states.back(); }));
  client.startEffect(2);
  client.flush();
  const auto told = server->waitTold(1);
  ASSERT_EQ(told.size(), 1U) << "the command given without a connection is not sent later";
  EXPECT_TRUE(is(told[0], wire::StartEffect{2}));
  EXPECT_EQ(told[0].sender, "Phantom") << "names are described anew";
  EXPECT_EQ(client.statistics().connections, 2U);
}

TEST(Client, DoesNotConnectAgainWhenToldSo) {
  ScriptedServer server;
  Client client(server.tcpName(), {.reconnect = false});
  server.dropClients();
  ASSERT_TRUE(pollUntil(client, [&] { return !client.connected(); }));
  client.poll(600ms);  // more than twice the pause between attempts
  EXPECT_FALSE(client.connected());
  EXPECT_EQ(server.connections(), 1U);
}

TEST(Client, SleepsWhileNothingHappens) {
  ScriptedServer server;
  Client client(server.tcpName());
  while (client.poll(50ms) > 0) {
  }
  const auto cpu = [] {
    timespec t{};
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return std::chrono::seconds(t.tv_sec) + std::chrono::nanoseconds(t.tv_nsec);
  };
  const auto before_cpu = cpu();
  const auto before = std::chrono::steady_clock::now();
  EXPECT_EQ(client.poll(400ms), 0U);
  EXPECT_GE(std::chrono::steady_clock::now() - before, 400ms);
  EXPECT_LT(cpu() - before_cpu, 100ms);
}

TEST(Client, WrongNamesAreQuoted) {
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom"); }), HasSubstr("expected NAME@host"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("@localhost"); }), HasSubstr("expected NAME@host"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@"); }), HasSubstr("expected host"));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@host:70000"); }), HasSubstr("\"70000\""));
  EXPECT_THAT(textOf<std::invalid_argument>([] { Client("Phantom@tcp://host:0"); }), HasSubstr("1 to 65535"));
  EXPECT_THAT(textOf<ConnectError>([] { Client("Phantom@nowhere.invalid"); }), HasSubstr("nowhere.invalid"));
}

TEST_P(BothWays, NothingListens) {
  std::uint16_t port = 0;
  std::string device;
  {
    ScriptedServer server;
    port = server.port();
    device = name(server);
  }
  const std::string text = textOf<ConnectError>([&] { Client(device, {.connect_timeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("nothing listens on 127.0.0.1:" + std::to_string(port)));
  EXPECT_THAT(text, HasSubstr("start `hapticd serve`"));
}

TEST(Client, NoSuchDevice) {
  ScriptedServer server;
  const std::string text = textOf<ConnectError>(
      [&] { Client("Phantm@tcp://127.0.0.1:" + std::to_string(server.port()), {.connect_timeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("no device 'Phantm' answers"));
  EXPECT_THAT(text, HasSubstr("it has Phantom"));
}

TEST(Client, NotAVrpnServer) {
  ScriptedServer server({.greeting_bytes = "HTTP/1.1 400 Bad Request\r\nConnection: close\r\n\r\n"});
  const std::string text =
      textOf<ConnectError>([&] { Client(server.tcpName(), {.connect_timeout = 300ms}); });
  EXPECT_THAT(text, HasSubstr("broke the VRPN protocol"));
}

TEST(Client, KeepsWhatIsCommandedBeforeTheFirstConnection) {
  std::uint16_t port = 0;
  {
    ScriptedServer server;
    port = server.port();
  }
  Client client("Phantom@tcp://127.0.0.1:" + std::to_string(port), {.connect_timeout = 0ms});
  client.setObjectCount(2);
  client.startEffect(4);
  client.poll(0ms);
  EXPECT_FALSE(client.connected());
  ScriptedServer server({.port = port});
  client.waitConnected(kPatience);
  client.flush();
  const auto told = server.waitTold(2);
  ASSERT_EQ(told.size(), 2U);
  EXPECT_TRUE(is(told[0], wire::SetObjectNumber{2}));
  EXPECT_TRUE(is(told[1], wire::StartEffect{4}));
}

TEST(Client, WhatWaitsForTheFirstConnectionIsBounded) {
  Client client("Phantom@tcp://127.0.0.1:1", {.connect_timeout = 0ms, .queue_limit = 100000});
  const auto fill = [&] {
    for (int i = 0; i < 10000; ++i) client.setVertex(0, i, 0, 0, 0);
  };
  EXPECT_THAT(textOf<ConnectError>(fill), HasSubstr("bytes wait to be sent"));
}

// --- uploads

#ifdef HAPTICD_SANITIZED
constexpr std::size_t kManyVertices = 9999;
#else
constexpr std::size_t kManyVertices = 99999;
#endif

TEST_P(BothWays, AHundredThousandVerticesArriveInOrder) {
  ScriptedServer server;
  Client client(name(server));
  std::vector<std::array<float, 3>> corners(kManyVertices);
  for (std::size_t i = 0; i < corners.size(); ++i) corners[i] = {static_cast<float>(i), 1, -2};
  std::vector<std::uint64_t> progress;
  std::uint64_t total = 0;
  client.uploadCorners(3, corners, [&](const UploadProgress& p) {
    progress.push_back(p.bytes_sent);
    total = p.bytes_total;
  });
  ASSERT_FALSE(progress.empty());
  EXPECT_TRUE(std::is_sorted(progress.begin(), progress.end()));
  EXPECT_EQ(total, corners.size() * 48);
  EXPECT_EQ(progress.back(), total);
  EXPECT_GE(client.statistics().tcp_bytes_out, total) << "the system has all of it";

  const auto vertices = server.waitVertices(corners.size());
  ASSERT_EQ(vertices.size(), corners.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    ASSERT_EQ(vertices[i].vertex, static_cast<std::int32_t>(i));
    ASSERT_EQ(vertices[i].object, 3);
    ASSERT_EQ(vertices[i].position, corners[i]);
  }
}

TEST(Client, MeshesAreSentCornerByCorner) {
  ScriptedServer server;
  Client client(server.tcpName());
  const std::vector<std::array<float, 3>> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  const std::vector<std::array<std::uint32_t, 3>> triangles{{0, 1, 2}, {3, 2, 1}};
  client.uploadMesh(0, {vertices, triangles});
  const auto told = server.waitVertices(6);
  ASSERT_EQ(told.size(), 6U);
  EXPECT_EQ(told[3].position, vertices[3]);
  EXPECT_EQ(told[5].vertex, 5);
  EXPECT_EQ(told[5].position, vertices[1]);

  const std::vector<std::array<std::uint32_t, 3>> bad{{0, 1, 2}, {3, 4, 1}};
  EXPECT_THAT(textOf<std::invalid_argument>([&] {
                client.uploadMesh(0, {vertices, bad});
              }),
              HasSubstr("triangle 1 names vertex 4, the mesh has 4"));
}

TEST(Client, AServerThatDoesNotReadHoldsCommandsBackAndThenLosesThem) {
  ScriptedServer server({.reads = false});
  constexpr std::size_t kLimit = 256 * 1024;
  Client client(server.tcpName(), {.connect_timeout = 0ms, .send_timeout = 300ms, .queue_limit = kLimit});
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!client.connected() && std::chrono::steady_clock::now() < end) client.poll(10ms);
  std::uint64_t most_waiting = 0;
  int sent = 0;
  const auto fill = [&] {
    for (; sent < 10'000'000; ++sent) {
      client.setVertex(0, sent, 0, 0, 0);
      if (sent % 1000 == 0) {
        const Statistics s = client.statistics();
        most_waiting =
            std::max(most_waiting, s.messages_out * 48 - std::min(s.messages_out * 48, s.tcp_bytes_out));
      }
    }
  };
  EXPECT_THAT(textOf<ConnectionLost>(fill), testing::AnyOf(HasSubstr("takes no data"), HasSubstr("lost")));
  EXPECT_LT(sent, 10'000'000);
  EXPECT_LE(most_waiting, kLimit + 2 * 64 * 1024) << "memory is bounded";
  EXPECT_FALSE(client.connected());
}

TEST(Client, AServerThatReadsLaterGetsEverything) {
  ScriptedServer server({.reads = false});
  Client client(server.tcpName(), {.connect_timeout = 0ms, .queue_limit = 64 * 1024});
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!client.connected() && std::chrono::steady_clock::now() < end) client.poll(10ms);
  std::vector<std::array<float, 3>> corners(kManyVertices);
  std::thread later([&] {
    std::this_thread::sleep_for(
        50ms);  // so that the upload usually has to wait; the result is the same if not
    server.startReading();
  });
  client.uploadCorners(0, corners);
  later.join();
  EXPECT_EQ(server.waitVertices(corners.size()).size(), corners.size());
}

TEST(Client, AnUploadToAServerThatGoesAwayFails) {
  ScriptedServer server;
  Client client(server.tcpName(), {.queue_limit = 64 * 1024});
  std::vector<std::array<float, 3>> corners(kManyVertices * 5);
  bool dropped = false;
  const auto upload = [&] {
    client.uploadCorners(0, corners, [&](const UploadProgress& p) {
      if (!dropped && p.bytes_sent > 0) {
        server.dropClients();
        dropped = true;
      }
    });
  };
  EXPECT_THAT(textOf<ConnectionLost>(upload), HasSubstr("lost"));
}

// --- callbacks

TEST(Client, ExceptionsOfCallbacksLeavePollAndLoseNothing) {
  ScriptedServer server;
  Client client(server.tcpName());
  int seen = 0;
  client.onTouchedObject([&](const TouchedObjectReport& r) {
    ++seen;
    if (r.object == 1) throw std::runtime_error("mine");
  });
  server.say(wire::TouchedObject{1});
  server.say(wire::TouchedObject{2});
  EXPECT_EQ(textOf<std::runtime_error>([&] { pollUntil(client, [] { return false; }); }), "mine");
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().touched_object.object == 2; }));
  EXPECT_EQ(seen, 2);
  EXPECT_TRUE(client.connected());
}

TEST(Client, CallbacksMayCommandUploadAndPoll) {
  ScriptedServer server;
  Client client(server.tcpName());
  std::vector<int> order;
  const std::vector<std::array<float, 3>> corners(3000);
  client.onTouchedObject([&](const TouchedObjectReport& r) {
    order.push_back(r.object);
    if (r.object != 1) return;
    client.uploadCorners(0, corners);
    client.startEffect(9);
    client.poll(1ms);
    client.flushAll();
    order.push_back(-5);
  });
  server.say(wire::TouchedObject{1});
  server.say(wire::TouchedObject{2});
  ASSERT_TRUE(pollUntil(client, [&] { return order.size() == 3; }));
  EXPECT_EQ(order, (std::vector<int>{1, -5, 2}));
  EXPECT_EQ(server.waitVertices(3000).size(), 3000U);
  EXPECT_TRUE(is(server.waitTold(1).at(0), wire::StartEffect{9}));
}

TEST(Client, CallbacksKeepTheirStateAndMayAddOthers) {
  ScriptedServer server;
  Client client(server.tcpName());
  std::vector<int> counts;
  int late = 0;
  client.onTouchedObject([&, count = 0](const TouchedObjectReport&) mutable {
    counts.push_back(++count);
    for (int i = 0; i < 100; ++i) client.onTouchedObject([&](const TouchedObjectReport&) { ++late; });
  });
  server.say(wire::TouchedObject{1});
  server.say(wire::TouchedObject{2});
  ASSERT_TRUE(pollUntil(client, [&] { return counts.size() == 2; }));
  EXPECT_EQ(counts, (std::vector<int>{1, 2}));
  EXPECT_EQ(late, 100) << "what is added during a report waits for the next";
}

TEST(Client, ErrorsOfTheServerCanBeExceptions) {
  ScriptedServer server;
  Client client(server.tcpName(), {.throw_on_error = true});
  server.say(wire::Text{0, 0, "mesh of object 0: closed"});
  server.say(wire::Text{2, 0, "setTransformMatrix: object 0: element 3 is nan"});
  const std::string text = textOf<ServerError>([&] { pollUntil(client, [] { return false; }); });
  EXPECT_THAT(text, HasSubstr("element 3 is nan"));
  EXPECT_NO_THROW(client.poll(0ms));
}

TEST(Client, DamagedReportsAreCounted) {
  ScriptedServer server;
  Client client(server.tcpName());
  // A Force of 8 bytes: the type's number is that of the table.
  std::string frame(32, '\0');
  auto* bytes = reinterpret_cast<std::byte*>(frame.data());
  wire::storeHeader(bytes, {32, {}, 1, wire::kLocalType<wire::Force>.value, 0});
  server.sayRaw(frame);
  ASSERT_TRUE(pollUntil(client, [&] { return client.statistics().messages_damaged == 1; }));
  EXPECT_TRUE(client.connected());
}

TEST(LatencyHistogram, QuantilesAreWithinABucket) {
  LatencyHistogram histogram;
  EXPECT_EQ(histogram.quantile_us(0.5), 0);
  for (int i = 0; i < 1000; ++i) histogram.add(std::chrono::microseconds(i));
  EXPECT_EQ(histogram.count(), 1000U);
  EXPECT_NEAR(histogram.quantile_us(0.5), 500, 500 * 0.125);
  EXPECT_NEAR(histogram.quantile_us(0.99), 990, 990 * 0.125);
  EXPECT_EQ(histogram.countBelow_us(8), 8U);
  LatencyHistogram earlier = histogram;
  histogram.add(-5us);
  histogram.add(std::chrono::hours(1));
  histogram -= earlier;
  EXPECT_EQ(histogram.count(), 2U);
  EXPECT_EQ(histogram.countBelow_us(1), 1U);
}

}  // namespace
}  // namespace hapticd
