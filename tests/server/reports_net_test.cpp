// Reports to each client over real sockets: rates, kinds, mirrored contact, toggles, origins.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "log_lines.h"
#include "running_server.h"
#include "scripted_peer.h"

namespace hapticd::test {
namespace {

class ReportsTest : public ::testing::Test {
 protected:
  std::unique_ptr<ScriptedPeer> peer(ScriptedPeer::Mode mode = ScriptedPeer::Mode::tcp) {
    auto peer = std::make_unique<ScriptedPeer>(server_.address(), "Phantom", mode);
    EXPECT_TRUE(peer->until([&] { return peer->count<wire::IsTouching>() > 0; }));
    return peer;
  }
  // A floor, with the hand steered into it.
  static void touchFloor(ScriptedPeer& peer) {
    peer.send(wire::HoldHand{.hold = 1, .position = {0, 10, 0}});
    peer.send(
        wire::Plane{.plane = {0, 1, 0, 0}, .stiffness = 0.5F, .damping = 0, .index = 0, .recoveryCycles = 1});
    peer.send(wire::HoldHand{.hold = 1, .position = {0, -3, 0}});
  }
  // Mean number of ticks between two tick reports.
  static double meanTicksBetween(ScriptedPeer& peer) {
    peer.forget();
    EXPECT_TRUE(peer.until([&] { return peer.count<wire::TickReport>() >= 30; }, 60s));
    const auto ticks = peer.all<wire::TickReport>();
    return static_cast<double>(ticks.back().tick - ticks.front().tick) /
           static_cast<double>(ticks.size() - 1);
  }

  LogLines log_;
  RunningServer server_;
};

TEST_F(ReportsTest, EachClientHasItsOwnRate) {
  const auto slow = peer();
  const auto fast = peer();
  slow->send(wire::Subscribe{.kinds = wire::kReportTick, .rate = 100});
  fast->send(wire::Subscribe{.kinds = wire::kReportTick, .rate = 1e6});  // as fast as the servo
  ASSERT_TRUE(slow->until([&] { return slow->count<wire::TickReport>() > 0; }));
  ASSERT_TRUE(fast->until([&] { return fast->count<wire::TickReport>() > 0; }));
  // While the machine stalls, the servo skips ticks and the server skips late reports: wait for a calm time.
  EXPECT_TRUE(slow->until([&] {
    const double ticks = meanTicksBetween(*slow);
    return ticks > 5 && ticks < 10.5;
  }));
  EXPECT_TRUE(fast->until([&] { return meanTicksBetween(*fast) < 3; }));
  slow->send(wire::TrackerSetUpdateRate{500});
  ASSERT_TRUE(slow->until([&] { return meanTicksBetween(*slow) < 3; }));
  slow->forget();
  slow->send(wire::Subscribe{.kinds = wire::kReportDefault, .rate = 0});
  ASSERT_TRUE(slow->untilNext<wire::IsTouching>());
}

// An address that is not its own would make the server send to somebody who did not ask.
TEST_F(ReportsTest, ADescriptionOfAnotherMachinesUdpPortEndsTheDatagrams) {
  const auto client = peer(ScriptedPeer::Mode::udp);
  client->send(wire::Subscribe{.kinds = wire::kReportTick, .rate = 0});
  const auto last = [&](bool byDatagram) {
    return client->until([&] {
      const auto& all = client->messages();
      return std::any_of(all.begin(), all.end(), [&](const auto& message) {
        return message.kind == wire::kindOf<wire::TickReport> && message.byDatagram == byDatagram;
      });
    });
  };
  ASSERT_TRUE(last(true));
  client->forget();
  wire::FrameEncoder description;
  description.addRaw({1, 2}, 9, wire::kUdpDescription, wire::encodeUdpDescription({"127.0.0.99", 9}));
  client->sendBytes(description.bytes());
  EXPECT_TRUE(last(false));
}

TEST_F(ReportsTest, ADescriptionThatIsNoAddressEndsTheDatagrams) {
  const auto client = peer(ScriptedPeer::Mode::udp);
  client->send(wire::Subscribe{.kinds = wire::kReportTick, .rate = 0});
  ASSERT_TRUE(client->until([&] { return client->datagrams() > 0; }));
  wire::FrameEncoder description;
  description.addRaw({1, 2}, 9, wire::kUdpDescription, wire::encodeUdpDescription({"999.0.0.1", 4000}));
  client->sendBytes(description.bytes());
  ASSERT_TRUE(client->until([&] { return log_.count("UDP address refused: ") == 1; })) << log_.text();
  client->forget();
  EXPECT_TRUE(client->until([&] {
    const auto& all = client->messages();
    return std::any_of(all.begin(), all.end(), [](const auto& message) {
      return message.kind == wire::kindOf<wire::TickReport> && !message.byDatagram;
    });
  }));
}

TEST_F(ReportsTest, InvalidRatesAreRefusedByName) {
  const auto client = peer();
  client->send(wire::TrackerSetUpdateRate{std::nan("")});
  EXPECT_TRUE(client->untilText("set_update_rate: rate nan Hz refused"));
  client->send(wire::Subscribe{.kinds = wire::kReportDefault, .rate = -5});
  EXPECT_TRUE(client->untilText("Subscribe: rate -5 Hz refused"));
  EXPECT_TRUE(client->untilNext<wire::IsTouching>());
}

TEST_F(ReportsTest, TicksHaveIncreasingNumbersAndTimes) {
  const auto client = peer();
  client->send(wire::Subscribe{.kinds = wire::kReportTick, .rate = 0});
  ASSERT_TRUE(client->until([&] { return client->count<wire::TickReport>() >= 50; }));
  const auto ticks = client->all<wire::TickReport>();
  for (std::size_t i = 1; i < ticks.size(); ++i) {
    EXPECT_GT(ticks[i].tick, ticks[i - 1].tick);
    EXPECT_GT(ticks[i].time, ticks[i - 1].time);
  }
}

TEST_F(ReportsTest, EveryContactAndItsEndAreListed) {
  const auto client = peer(ScriptedPeer::Mode::udp);
  client->send(wire::Subscribe{.kinds = wire::kReportDefault | wire::kReportContacts, .rate = 0});
  touchFloor(*client);
  ASSERT_TRUE(client->until([&] {
    const auto lists = client->all<wire::ContactList>();
    return !lists.empty() && lists.back().contacts.values.size() == 10 &&
           lists.back().contacts.values[8] > 0.3;
  }));
  const auto contact = client->all<wire::ContactList>().back().contacts.values;
  EXPECT_EQ(contact[0], -1);  // a plane
  EXPECT_NEAR(contact[5], 1, 1e-6);
  client->send(wire::HoldHand{.hold = 1, .position = {0, 10, 0}});
  EXPECT_TRUE(client->until([&] { return client->all<wire::ContactList>().back().contacts.values.empty(); }));
}

// Stock clients take every sensor for the first one and every button for one of the device.
TEST_F(ReportsTest, StockClientsGetSensor0AndTheDevicesButtonsOnly) {
  const auto client = peer();
  touchFloor(*client);
  ASSERT_TRUE(client->until([&] {
    const auto touching = client->all<wire::IsTouching>();
    return !touching.empty() && touching.back().touching == 1;
  }));
  client->send(wire::HoldHand{.hold = 1, .position = {0, 10, 0}, .buttons = 1});
  ASSERT_TRUE(client->until([&] { return client->count<wire::ButtonChange>() >= 1; }));
  ASSERT_TRUE(client->until([&] { return client->all<wire::IsTouching>().back().touching == 0; }));
  for (const auto& pose : client->all<wire::TrackerPosQuat>()) EXPECT_EQ(pose.sensor, 0);
  for (const auto& velocity : client->all<wire::TrackerVelocity>()) EXPECT_EQ(velocity.sensor, 0);
  for (const auto& change : client->all<wire::ButtonChange>()) EXPECT_EQ(change.button, 0);
  EXPECT_EQ(client->all<wire::ButtonStates>().at(0).states.values.size(), 2U);
  EXPECT_EQ(client->count<wire::AnalogChannels>(), 0U);
}

// The question for the capabilities is the mark of a client that knows the extensions.
TEST_F(ReportsTest, AClientThatAsksForCapabilitiesGetsAllSensorsUnlessItChooses) {
  const auto client = peer();
  client->send(wire::QueryCapabilities{});
  EXPECT_TRUE(client->until([&] {
    return client->last<wire::TrackerPosQuat>([](const auto& m) { return m.sensor == 1; }).has_value();
  }));
  client->send(wire::TrackerRequestUnitToSensor{});
  EXPECT_TRUE(client->until([&] { return client->count<wire::TrackerUnitToSensor>() == 3; }));
  const auto other = peer();
  other->send(wire::Subscribe{.kinds = wire::kReportDefault, .rate = 0});
  other->send(wire::QueryCapabilities{});
  ASSERT_TRUE(other->untilNext<wire::Capabilities>());
  other->send(wire::TrackerRequestUnitToSensor{});
  EXPECT_TRUE(other->untilNext<wire::TrackerUnitToSensor>());
  EXPECT_TRUE(other->untilNext<wire::IsTouching>());
  EXPECT_EQ(other->count<wire::TrackerUnitToSensor>(), 1U);
}

TEST_F(ReportsTest, ARateChoosesNoKinds) {
  const auto client = peer();
  client->send(wire::TrackerSetUpdateRate{100});
  client->send(wire::QueryCapabilities{});
  ASSERT_TRUE(client->untilNext<wire::Capabilities>());
  client->send(wire::TrackerRequestUnitToSensor{});
  EXPECT_TRUE(client->until([&] { return client->count<wire::TrackerUnitToSensor>() == 3; }));
}

// Waits until these clients saw contact as channels and as this button, and then its end.
void expectContactMirrored(ScriptedPeer& mirror, ScriptedPeer& hand, std::int32_t button) {
  ASSERT_TRUE(mirror.until([&] {
    const auto channels = mirror.all<wire::AnalogChannels>();
    return !channels.empty() && channels.back().channels.values.at(1) > 0.3 &&
           channels.back().channels.values.at(3) > 0.0005;
  }));
  const auto isTouching = [&](std::int32_t state) {
    const auto change = mirror.last<wire::ButtonChange>([&](const auto& m) { return m.button == button; });
    return change && change->state == state;
  };
  EXPECT_TRUE(mirror.until([&] { return isTouching(1); }));
  hand.send(wire::HoldHand{.hold = 1, .position = {0, 10, 0}});
  EXPECT_TRUE(mirror.until([&] { return isTouching(0); }));
}

TEST_F(ReportsTest, AClientWithOnlyAnalogAndButtonSeesContact) {
  auto config = RunningServer::anyPort();
  config.devices.front().mirrors = true;
  RunningServer server(config);
  ScriptedPeer hand(server.address());
  ScriptedPeer mirror(server.address(), "Phantom.touch");
  ScriptedPeer point(server.address(), "Phantom.contact");
  ScriptedPeer hip(server.address(), "Phantom.hand");
  for (ScriptedPeer* peer : {&hand, &mirror, &point, &hip}) ASSERT_TRUE(peer->untilConnected());
  touchFloor(hand);
  ASSERT_TRUE(point.until([&] { return point.count<wire::TrackerPosQuat>() >= 1; }));
  ASSERT_TRUE(hip.until([&] {
    const auto pose = hip.last<wire::TrackerPosQuat>();
    return pose && pose->position[1] < -0.0005;
  })) << "the HIP is below the floor";
  expectContactMirrored(mirror, hand, 0);
  for (const ScriptedPeer* peer : {&point, &hip}) {
    for (const auto& pose : peer->all<wire::TrackerPosQuat>()) EXPECT_EQ(pose.sensor, 0);
    EXPECT_EQ(peer->count<wire::IsTouching>(), 0U);
  }
  EXPECT_EQ(mirror.count<wire::TrackerPosQuat>(), 0U);
  mirror.forget();
  mirror.send(wire::Ping{});
  ASSERT_TRUE(mirror.until(
      [&] { return mirror.count<wire::Pong>() == 1 && mirror.count<wire::ButtonStates>() == 1; }));
  EXPECT_EQ(mirror.all<wire::ButtonStates>().back().states.values.size(), 1U);
}

TEST_F(ReportsTest, CompatMirrorsPutEverySensorAndTheTouchButtonUnderTheDevice) {
  auto config = RunningServer::anyPort();
  config.devices.front().compatMirrors = true;
  RunningServer server(config);
  ScriptedPeer client(server.address());
  ASSERT_TRUE(client.untilConnected());
  touchFloor(client);
  for (std::int32_t sensor = 0; sensor < server::kSensorCount; ++sensor) {
    EXPECT_TRUE(client.until([&] {
      return client.last<wire::TrackerPosQuat>([&](const auto& m) { return m.sensor == sensor; }).has_value();
    })) << sensor;
  }
  expectContactMirrored(client, client, 2);
}

TEST_F(ReportsTest, AToggleStaysOnWhenItsButtonIsReleased) {
  const auto client = peer();
  const auto watcher = peer();
  const auto button = [](std::uint32_t buttons) {
    return wire::HoldHand{.hold = 1, .position = {}, .buttons = buttons};
  };
  const auto isOn = [](ScriptedPeer& who, std::int32_t state) {
    const auto changes = who.all<wire::ButtonChange>();
    for (auto change = changes.rbegin(); change != changes.rend(); ++change) {
      if (change->button == 0) return change->state == state;
    }
    return false;
  };
  client->send(button(0));
  client->send(wire::ButtonAdmin{0, wire::kButtonToggleOff});
  ASSERT_TRUE(watcher->until([&] { return watcher->count<wire::ButtonAlert>() >= 1; }));
  EXPECT_EQ(watcher->all<wire::ButtonAlert>().back().event, wire::kButtonToggleOff);
  client->send(button(1));
  ASSERT_TRUE(watcher->until([&] { return isOn(*watcher, 1); }));
  ASSERT_TRUE(watcher->until(
      [&] { return watcher->all<wire::ButtonAlert>().back().event == wire::kButtonToggleOn; }));
  client->send(button(0));
  client->send(wire::Ping{});
  ASSERT_TRUE(client->untilNext<wire::Pong>());
  const auto later = client->count<wire::IsTouching>() + 100;
  ASSERT_TRUE(client->until([&] { return client->count<wire::IsTouching>() > later; }));
  EXPECT_TRUE(isOn(*client, 1));
  client->send(button(1));
  EXPECT_TRUE(client->until([&] { return isOn(*client, 0); }));
  client->send(wire::ButtonAdmin{9, wire::kButtonToggleOn});
  EXPECT_TRUE(client->untilText("button 9 refused"));
}

TEST_F(ReportsTest, PosesAreRelativeToTheOriginThatAClientResets) {
  const auto client = peer();
  client->send(wire::Subscribe{.kinds = wire::kReportHip, .rate = 0});
  client->send(wire::HoldHand{.hold = 1, .position = {30, 20, 10}});
  const auto hip = [&](double x, double y, double z) {
    return client->until([&] {
      const auto poses = client->all<wire::TrackerPosQuat>();
      for (auto pose = poses.rbegin(); pose != poses.rend(); ++pose) {
        if (pose->sensor != server::kSensorHip) continue;
        return std::hypot(pose->position[0] - x, pose->position[1] - y, pose->position[2] - z) < 0.0015;
      }
      return false;
    });
  };
  ASSERT_TRUE(hip(0.03, 0.02, 0.01));
  client->send(wire::TrackerResetOrigin{});
  ASSERT_TRUE(hip(0, 0, 0));
  client->send(wire::TrackerRequestToRoom{});
  ASSERT_TRUE(client->untilNext<wire::TrackerToRoom>());
  EXPECT_NEAR(client->all<wire::TrackerToRoom>().at(0).position[0], 0.03, 0.0015);
  client->send(wire::ResetScene{});
  EXPECT_TRUE(hip(0.03, 0.02, 0.01));
}

TEST_F(ReportsTest, ALateClientGetsTheGuardState) {
  const auto client = peer();
  client->send(wire::StopForces{});
  ASSERT_TRUE(client->until([&] {
    const auto states = client->all<wire::GuardState>();
    return !states.empty() && states.back().stopped == 1;
  }));
  const auto late = peer();
  ASSERT_TRUE(late->until([&] { return late->count<wire::GuardState>() > 0; }));
  EXPECT_EQ(late->all<wire::GuardState>().at(0).stopped, 1);
}

}  // namespace
}  // namespace hapticd::test
