// Every report reaches its callback; what callbacks may do.
#include <limits>

#include "client/client_tests.h"

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

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
    EXPECT_EQ(r.rotationInterval_s, 0.5);
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
    EXPECT_EQ(r.text, "stiffness 2 of object 0 clamped to 1\xef\xbf\xbd[2J") << "a terminal would obey";
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
  server.send(wire::TrackerPosQuat{1, 0, {1, 2, 3}, {0.1, 0.2, 0.3, 0.9}});
  server.send(wire::TrackerVelocity{1, 0, {4, 5, 6}, {0, 0, 0, 1}, 0.5});
  server.send(wire::TrackerAcceleration{1, 0, {7, 8, 9}, {0, 0, 0, 1}, 0.5});
  server.send(wire::AnalogChannels{{{1, 2.5}}});
  server.send(wire::Force{{1, -2, 3}});
  server.send(wire::Dop{0.004});
  server.send(wire::Scp{{3, 2, 1}, {0, 0, 0, 1}});
  server.send(wire::IsTouching{1});
  server.send(wire::TouchedObject{5});
  server.send(wire::Angle{45, 1});
  server.send(wire::ForceError{2});
  server.send(wire::Text{1, 0, "stiffness 2 of object 0 clamped to 1\x1b[2J"});
  server.send(wire::TrackerToRoom{{1, 1, 1}, {0, 0, 0, 1}});
  server.send(wire::TrackerUnitToSensor{2, 0, {}, {0, 0, 0, 1}});
  server.send(wire::TrackerWorkspace{{1, 2, 3}, {4, 5, 6}});
  ASSERT_TRUE(pollUntil(client, [&] { return calls == 15; })) << calls << " of 15";

  const LatestReports& latest = client.latest();
  EXPECT_EQ(latest.pose.at(1).position_m, (Vec3{1, 2, 3}));
  EXPECT_EQ(latest.force.force_N, (Vec3{1, -2, 3}));
  EXPECT_EQ(latest.depth.depth_m, 0.004);
  EXPECT_TRUE(latest.touching.touching);
  EXPECT_EQ(latest.touchedObject.object, 5);
  const Statistics statistics = client.statistics();
  EXPECT_EQ(statistics[ReportKind::force].count, 1U);
  EXPECT_EQ(statistics[ReportKind::force].latency.count(), 1U);
  EXPECT_EQ(statistics.messagesDamaged, 0U);
  if (tcpOnly()) {
    EXPECT_EQ(statistics.udpBytesIn, 0U);
  } else {
    EXPECT_GE(statistics.udpBytesIn, 8U * 24U) << "fast reports come by datagram";
  }
}

TEST(Client, ButtonsAreReportedOnChangeOnly) {
  ScriptedServer server;
  Client client(server.tcpName());
  std::vector<std::pair<int, bool>> seen;
  client.onButton([&](const ButtonReport& r) { seen.emplace_back(r.button, r.pressed); });
  server.send(wire::ButtonStates{{{0, 1}}});
  server.send(wire::ButtonStates{{{0, 1}}});
  server.send(wire::ButtonChange{1, 0});
  server.send(wire::ButtonStates{{{1, 0}}});
  ASSERT_TRUE(pollUntil(client, [&] { return seen.size() == 3; }));
  EXPECT_EQ(seen, (std::vector<std::pair<int, bool>>{{1, true}, {1, false}, {0, true}}));
}

// Otherwise a program holds for ever what its user has let go.
TEST(Client, AButtonThatIsReleasedWhileThereIsNoConnectionIsReportedAfterIt) {
  ScriptedServer server;
  Client client(server.tcpName());
  using Seen = std::vector<std::pair<int, bool>>;
  Seen seen;
  int connections = 0;
  client.onButton([&](const ButtonReport& r) { seen.emplace_back(r.button, r.pressed); });
  client.onConnection([&](const ConnectionReport& r) { connections += r.connected ? 1 : 0; });
  server.send(wire::ButtonStates{{{1, 0, 1, 1, 1}}});
  ASSERT_TRUE(pollUntil(client, [&] { return seen.size() == 4; }));
  seen.clear();
  const std::size_t pings = server.pings();
  server.dropClients();
  ASSERT_TRUE(pollUntil(client, [&] { return connections == 2 && server.pings() > pings; }));
  EXPECT_EQ(seen, Seen{});

  server.send(wire::ButtonChange{3, 0});
  server.send(wire::ButtonStates{{{0, 0, 1, 0}}});
  server.send(wire::ButtonStates{{{0, 0, 1, 0}}});
  server.send(wire::ButtonChange{9, 1});
  ASSERT_TRUE(pollUntil(client, [&] { return !seen.empty() && seen.back().first == 9; }));
  EXPECT_EQ(seen, (Seen{{3, false}, {0, false}, {4, false}, {2, true}, {9, true}}));
}

TEST(Client, ReportsOfOtherDevicesAreIgnored) {
  ScriptedServer server;
  Client client(server.tcpName());
  int forces = 0;
  client.onForce([&](const ForceReport& r) { forces += r.force_N[0] == 1 ? 1 : 100; });
  server.send(wire::Force{{9, 9, 9}}, {}, "OtherDevice");
  server.send(wire::Force{{1, 0, 0}});
  ASSERT_TRUE(pollUntil(client, [&] { return forces > 0; }));
  EXPECT_EQ(forces, 1);
}

TEST(Client, ExceptionsOfCallbacksLeavePollAndLoseNothing) {
  ScriptedServer server;
  Client client(server.tcpName());
  int seen = 0;
  client.onTouchedObject([&](const TouchedObjectReport& r) {
    ++seen;
    if (r.object == 1) throw std::runtime_error("mine");
  });
  server.send(wire::TouchedObject{1});
  server.send(wire::TouchedObject{2});
  EXPECT_EQ(textOf<std::runtime_error>([&] { pollUntil(client, [] { return false; }); }), "mine");
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().touchedObject.object == 2; }));
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
  server.send(wire::TouchedObject{1});
  server.send(wire::TouchedObject{2});
  ASSERT_TRUE(pollUntil(client, [&] { return order.size() == 3; }));
  EXPECT_EQ(order, (std::vector<int>{1, -5, 2}));
  EXPECT_EQ(server.waitVertices(3000).size(), 3000U);
  const auto received = server.waitReceived(2);
  EXPECT_TRUE(is(received.at(0), wire::ClearTrimesh{0})) << "an upload replaces the mesh";
  EXPECT_TRUE(is(received.at(1), wire::StartEffect{9}));
}

// Each callback waits for the next report: poll() returns all the same, and nothing is lost.
TEST(Client, PollInACallbackDoesNotKeepTheOuterPoll) {
  ScriptedServer server;
  Client client(server.tcpName());
  constexpr int kMany = 50;
  std::vector<int> order;
  client.onTouchedObject([&](const TouchedObjectReport& r) {
    order.push_back(r.object);
    if (r.object == kMany) return;
    const auto before = client.statistics().messagesIn;
    server.send(wire::TouchedObject{r.object + 1});
    const auto deadline = std::chrono::steady_clock::now() + 60s;
    while (client.statistics().messagesIn == before && std::chrono::steady_clock::now() < deadline)
      client.poll(1ms);
  });
  server.send(wire::TouchedObject{1});
  while (order.empty()) client.poll(1s);
  EXPECT_LE(order.size(), 2U) << "what waited, and what arrived before the callback";
  const std::size_t before = order.size();
  client.poll(1s);
  EXPECT_EQ(order.size(), before + 1);
  ASSERT_TRUE(pollUntil(client, [&] { return order.size() == kMany; }));
  for (int i = 0; i < kMany; ++i) EXPECT_EQ(order[static_cast<std::size_t>(i)], i + 1);
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
  server.send(wire::TouchedObject{1});
  server.send(wire::TouchedObject{2});
  ASSERT_TRUE(pollUntil(client, [&] { return counts.size() == 2; }));
  EXPECT_EQ(counts, (std::vector<int>{1, 2}));
  EXPECT_EQ(late, 100) << "callbacks added during a report wait for the next";
}

TEST(Client, ErrorsOfTheServerCanBeExceptions) {
  ScriptedServer server;
  Client client(server.tcpName(), {.throwOnError = true});
  server.send(wire::Text{0, 0, "mesh of object 0: closed"});
  server.send(wire::Text{2, 0, "setTransformMatrix: object 0: element 3 is nan"});
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
  server.sendRawBytes(frame);
  ASSERT_TRUE(pollUntil(client, [&] { return client.statistics().messagesDamaged == 1; }));
  wire::HandState hand;
  hand.contacts.values.assign(wire::HandState::kNumbers, std::numeric_limits<double>::quiet_NaN());
  server.send(hand);
  ASSERT_TRUE(pollUntil(client, [&] { return client.statistics().messagesDamaged == 2; }));
  EXPECT_EQ(client.latest().hand.time, Time{});
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
  histogram += earlier;
  histogram += earlier;
  EXPECT_EQ(histogram.count(), 2002U);
  EXPECT_EQ(histogram.countBelow_us(8), 17U);
}

TEST(Statistics, ARateIsThatSinceTheEarlierCopy) {
  Statistics earlier;
  Statistics now;
  earlier.reports[static_cast<std::size_t>(ReportKind::force)].count = 100;
  now.reports[static_cast<std::size_t>(ReportKind::force)].count = 110;
  EXPECT_EQ(now.ratePerSecond(ReportKind::force, earlier), 0) << "no time has passed";
  now.taken = earlier.taken + 2500ms;
  EXPECT_EQ(now.ratePerSecond(ReportKind::force, earlier), 4);
  EXPECT_EQ(now.ratePerSecond(ReportKind::pose, earlier), 0);
}

TEST(Reports, HaveNames) {
  EXPECT_EQ(nameOf(ReportKind::pose), "pose");
  EXPECT_EQ(nameOf(ReportKind::touchedObject), "touched object");
  EXPECT_EQ(nameOf(ReportKind::hand), "hand");
  EXPECT_EQ(nameOf(static_cast<ReportKind>(kReportKinds - 1)), "hand");
  const std::string_view errors[] = {"value out of range", "duty cycle", "force", "other",
                                     "recovered",          "other"};
  for (int i = 0; i < 6; ++i) EXPECT_EQ(nameOf(static_cast<ForceError>(i)), errors[i]);
  EXPECT_EQ(nameOf(Severity::normal), "normal");
  EXPECT_EQ(nameOf(Severity::warning), "warning");
  EXPECT_EQ(nameOf(Severity::error), "error");
}

}  // namespace
}  // namespace hapticd::test
