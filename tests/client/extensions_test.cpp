// The extensions, with servers that support them and servers that do not.
#include "client/client_tests.h"

#include <limits>

namespace hapticd::test {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;
using testing::HasSubstr;

ScriptedServerOptions able() {
  ScriptedServerOptions options;
  options.capabilities = allCapabilities();
  return options;
}

ScriptedServerOptions ableBut(std::uint32_t features) {
  ScriptedServerOptions options = able();
  options.capabilities->features &= ~features;
  return options;
}

bool waitReconnected(Client& client, const ScriptedServer& server, std::size_t connections) {
  return pollUntil(client, [&] { return client.connected() && server.connections() >= connections; });
}

TEST_P(BothWays, ReceivesTheCapabilities) {
  ScriptedServer server(able());
  Client client(name(server));
  const auto c = client.waitCapabilities();
  ASSERT_TRUE(c);
  EXPECT_EQ(c->version, 1);
  EXPECT_TRUE(c->bulkMesh && c->batch && c->subscribe && c->stop && c->heartbeat && c->holdHand);
  EXPECT_TRUE(c->remoteContacts);
  EXPECT_EQ(c->servoRate_Hz, 1000);
  EXPECT_EQ(c->reportRate_Hz, 250);
  EXPECT_EQ(c->peakForce_N, 3.3);
  EXPECT_EQ(c->buttons, 2);
  EXPECT_THAT(c->workspaceMin_m, ElementsAre(-0.08, -0.06, -0.035));
  EXPECT_THAT(c->workspaceMax_m, ElementsAre(0.08, 0.06, 0.035));
  EXPECT_TRUE(client.capabilities());

  server.dropClients();
  ASSERT_TRUE(pollUntil(client, [&] { return !client.connected(); }));
  EXPECT_FALSE(client.capabilities()) << "without a server";
  ASSERT_TRUE(waitReconnected(client, server, 2));
  EXPECT_TRUE(client.waitCapabilities()) << "asked again";
}

TEST(Extensions, ErrorsNameAServerWithoutExtensions) {
  ScriptedServer server;
  Client client(server.tcpName());
  EXPECT_FALSE(client.waitCapabilities());
  const auto refused = [&](auto&& call) {
    EXPECT_THAT(textOf<Unsupported>(call), HasSubstr(client.server() + " is a VRPN server without"));
  };
  bool called = false;
  refused([&] { client.batch([&] { called = true; }); });
  EXPECT_FALSE(called);
  refused([&] { client.subscribe(Reports::tick); });
  refused([&] { client.rearmForces(); });
  refused([&] { client.enableHeartbeat(); });
  refused([&] { client.holdHand({}); });
  refused([&] { client.releaseHand(); });
  refused([&] { client.stopForces(); });
  refused([&] { client.mark("trial 3 begins"); });
  client.setObjectCount(1);
  client.flushAll();
  const auto received = server.waitReceived(4);
  ASSERT_EQ(received.size(), 4U);
  EXPECT_EQ(received[0].message.kind(), wire::kindOf<wire::Identify>);
  EXPECT_TRUE(is(received[1], wire::StopForces{})) << "a stop does not wait for an answer";
  EXPECT_TRUE(is(received[2], wire::Marker{0, "trial 3 begins"})) << "nor does a marker";
  EXPECT_TRUE(is(received[3], wire::SetObjectNumber{1}));
}

TEST(Extensions, ErrorsNameADeviceWithoutTheFeature) {
  ScriptedServer server(ableBut(wire::kFeatureHoldHand));
  Client client(server.tcpName());
  EXPECT_THAT(textOf<Unsupported>([&] { client.holdHand({}); }),
              HasSubstr("cannot hold the hand: device 'Phantom' at"));
}

TEST(Extensions, ABatchIsFramedAndSentAsOne) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  client.batch([&] {
    client.setObjectCount(2);
    client.setTransform(1, translation(1, 2, 3));
    client.flush();
    client.poll(1ms);
  });
  client.setTouchable(1, false);
  client.flushAll();
  const auto received = server.waitReceived(5);
  ASSERT_EQ(received.size(), 5U);
  EXPECT_TRUE(is(received[0], wire::BatchBegin{}));
  EXPECT_TRUE(is(received[1], wire::SetObjectNumber{2}));
  EXPECT_TRUE(is(received[2], wire::SetTransformMatrix{1, translation(1, 2, 3)}));
  EXPECT_TRUE(is(received[3], wire::BatchCommit{}));
  EXPECT_TRUE(is(received[4], wire::SetObjectIsTouchable{1, 0}));
  for (const Received& t : received) EXPECT_EQ(t.sender, "Phantom");
}

TEST(Extensions, ABatchThatThrowsSendsNothing) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  const auto broken = [&] {
    client.batch([&] {
      client.setObjectCount(7);
      throw std::domain_error("changed my mind");
    });
  };
  EXPECT_THAT(textOf<std::domain_error>(broken), HasSubstr("changed my mind"));
  EXPECT_THAT(textOf<std::logic_error>([&] { client.batch([&] { client.batch([] {}); }); }),
              HasSubstr("do not nest"));
  client.setObjectCount(1);
  client.flushAll();
  const auto received = server.waitReceived(1);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_TRUE(is(received[0], wire::SetObjectNumber{1}));
}

TEST(Extensions, ABatchDoesNotOutliveItsConnection) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  const auto late = [&] {
    client.batch([&] {
      client.setObjectCount(7);
      server.dropClients();
      waitReconnected(client, server, 2);
    });
  };
  EXPECT_THAT(textOf<ConnectionLost>(late), HasSubstr("nothing of it was sent"));
  client.setObjectCount(1);
  client.flushAll();
  const auto received = server.waitReceived(1);
  ASSERT_FALSE(received.empty());
  EXPECT_TRUE(is(received[0], wire::SetObjectNumber{1}));
}

TEST(Extensions, AMeshIsSentInBulkMessagesWithinABatch) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  std::vector<std::array<float, 3>> vertices(5001);
  for (std::size_t i = 0; i < vertices.size(); ++i) vertices[i] = {static_cast<float>(i), 1, 2};
  const std::vector<std::array<std::uint32_t, 3>> triangles(5002, {5000, 1, 2});
  UploadProgress progress;
  client.uploadMesh(3, {vertices, triangles}, [&](const UploadProgress& p) { progress = p; });
  EXPECT_EQ(progress.bytesSent, progress.bytesTotal);
  EXPECT_GE(progress.bytesTotal, (vertices.size() + triangles.size()) * 12);

  auto received = server.waitReceived(7);
  ASSERT_EQ(received.size(), 7U);
  EXPECT_TRUE(is(received[0], wire::BatchBegin{}));
  EXPECT_TRUE(is(received[1], wire::ClearTrimesh{3})) << "it replaces the mesh that the object has";
  received.erase(received.begin());
  const auto* first = received[1].message.as<wire::MeshVertices>();
  const auto* second = received[2].message.as<wire::MeshVertices>();
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->object, 3);
  EXPECT_EQ(first->first, 0);
  ASSERT_EQ(first->positions.values.size(), 15000U);
  EXPECT_EQ(first->positions.values[14997], 4999);
  EXPECT_TRUE(is(received[2], wire::MeshVertices{3, 5000, {{5000, 1, 2}}}));
  const auto* faces = received[3].message.as<wire::MeshTriangles>();
  ASSERT_TRUE(faces);
  EXPECT_EQ(faces->vertices.values.size(), 15000U);
  EXPECT_TRUE(is(received[4], wire::MeshTriangles{3, 5000, {{5000, 1, 2, 5000, 1, 2}}}));
  EXPECT_TRUE(is(received[5], wire::BatchCommit{}));
}

TEST(Extensions, AServerWithoutBatchesGetsAMeshWithoutOne) {
  ScriptedServer server(ableBut(wire::kFeatureBatch));
  Client client(server.tcpName());
  const std::vector<std::array<float, 3>> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<std::array<std::uint32_t, 3>> triangles{{2, 1, 0}};
  client.uploadMesh(3, {vertices, triangles});
  const auto received = server.waitReceived(3);
  ASSERT_EQ(received.size(), 3U);
  EXPECT_TRUE(is(received[0], wire::ClearTrimesh{3}));
  EXPECT_TRUE(is(received[1], wire::MeshVertices{3, 0, {{0, 0, 0, 1, 0, 0, 0, 1, 0}}}));
  EXPECT_TRUE(is(received[2], wire::MeshTriangles{3, 0, {{2, 1, 0}}}));
}

TEST(Extensions, AMeshWithoutTrianglesIsNoListOfCorners) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  const std::vector<std::array<float, 3>> vertices{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  client.uploadMesh(3, {vertices, {}});
  auto received = server.waitReceived(3);
  ASSERT_EQ(received.size(), 3U);
  EXPECT_TRUE(is(received[0], wire::BatchBegin{}));
  EXPECT_TRUE(is(received[1], wire::ClearTrimesh{3}));
  EXPECT_TRUE(is(received[2], wire::BatchCommit{}));
}

TEST(Extensions, ATokenHas16To128Characters) {
  Client client("Phantom@tcp://127.0.0.1:1", {.connectTimeout = 0ms});
  for (const std::size_t size : {1U, 15U, 129U}) {
    EXPECT_THAT(textOf<std::invalid_argument>([&] { client.presentToken(std::string(size, 't')); }),
                HasSubstr(std::to_string(size) + " characters; a token has 16 to 128"));
  }
  for (const std::size_t size : {0U, 16U, 128U}) EXPECT_NO_THROW(client.presentToken(std::string(size, 't')));
}

TEST(Extensions, AMeshInsideABatchBelongsToIt) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  const std::vector<std::array<float, 3>> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  client.batch([&] {
    client.uploadCorners(0, corners);
    client.setVertices(0, 1, std::span(corners).first(1));
  });
  client.flushAll();
  auto received = server.waitReceived(5);
  ASSERT_EQ(received.size(), 5U);
  EXPECT_TRUE(is(received[0], wire::BatchBegin{}));
  EXPECT_TRUE(is(received[1], wire::ClearTrimesh{0}));
  received.erase(received.begin());
  EXPECT_TRUE(is(received[1], wire::MeshVertices{0, 0, {{0, 0, 0, 1, 0, 0, 0, 1, 0}}}));
  EXPECT_TRUE(is(received[2], wire::MeshVertices{0, 1, {{0, 0, 0}}}));
  EXPECT_TRUE(is(received[3], wire::BatchCommit{}));
}

TEST(Extensions, VerticesAreSentOneByOneWithoutBulkMessages) {
  ScriptedServer server(ableBut(wire::kFeatureBulkMesh));
  Client client(server.tcpName());
  const std::vector<std::array<float, 3>> corners{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  client.uploadMesh(0, {corners, std::vector<std::array<std::uint32_t, 3>>{{2, 1, 0}}});
  client.setVertices(4, 7, corners);
  client.flushAll();
  const auto vertices = server.waitVertices(6);
  ASSERT_EQ(vertices.size(), 6U);
  EXPECT_EQ(vertices[0].position, corners[2]);
  EXPECT_EQ(vertices[5].object, 4);
  EXPECT_EQ(vertices[5].vertex, 9);
}

TEST(Extensions, ASubscriptionIsRepeatedOnTheNextConnection) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  client.subscribe(Reports::usual | Reports::contacts, 500);
  ASSERT_EQ(server.waitReceived(1).size(), 1U);
  server.dropClients();
  ASSERT_TRUE(waitReconnected(client, server, 2));
  const auto received = server.waitReceived(2);
  ASSERT_EQ(received.size(), 2U);
  constexpr std::uint32_t kKinds =
      wire::kReportDefault | wire::kReportHip | wire::kReportContactPoint | wire::kReportContacts;
  for (const Received& t : received) EXPECT_TRUE(is(t, wire::Subscribe{kKinds, 500}));

  for (const double rate : {-1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_THAT(textOf<std::invalid_argument>([&] { client.subscribe(Reports::all, rate); }),
                HasSubstr("report rate"));
  }
}

TEST(Extensions, ARateIsRepeatedOnTheNextConnectionUnlessASubscriptionReplacesIt) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  client.setUpdateRate(20);
  client.flushAll();
  ASSERT_EQ(server.waitReceived(1).size(), 1U);
  server.dropClients();
  ASSERT_TRUE(waitReconnected(client, server, 2));
  for (const Received& t : server.waitReceived(2)) EXPECT_TRUE(is(t, wire::TrackerSetUpdateRate{20}));
  constexpr std::uint32_t kUsual = wire::kReportDefault | wire::kReportHip | wire::kReportContactPoint;
  client.subscribe(Reports::usual, 500);
  ASSERT_EQ(server.waitReceived(3).size(), 3U);
  server.dropClients();
  ASSERT_TRUE(waitReconnected(client, server, 3));
  const auto received = server.waitReceived(4);
  ASSERT_EQ(received.size(), 4U);
  for (std::size_t i = 2; i < 4; ++i) EXPECT_TRUE(is(received[i], wire::Subscribe{kUsual, 500}));
}

TEST(Extensions, ASubscriptionMayPrecedeTheConnection) {
  ScriptedServer server(able());
  Client client(server.tcpName(), {.connectTimeout = 0ms});
  client.subscribe(Reports::tick);
  client.setObjectCount(4);
  client.waitConnected(kPatience);
  client.flushAll();
  const auto received = server.waitReceived(2);
  ASSERT_EQ(received.size(), 2U);
  EXPECT_TRUE(is(received[0], wire::Subscribe{wire::kReportTick, 0}));
}

TEST(Extensions, TicksContactsAndGuardStatesArriveAsPlainValues) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  std::vector<TickReport> ticks;
  std::vector<ContactsReport> contacts;
  std::vector<GuardReport> guards;
  client.onTick([&](const TickReport& r) { ticks.push_back(r); });
  client.onContacts([&](const ContactsReport& r) { contacts.push_back(r); });
  client.onGuard([&](const GuardReport& r) { guards.push_back(r); });
  server.send(wire::TickReport{
      7, 7000001, 3, {1, 2, 3}, {4, 5, 6}, {7, 8, 9}, {0, 0, 1, 0}, {10, 11, 12}, 0.5, 2, 1, 4, 8});
  server.send(
      wire::ContactList{7, 7000001, {{2, .1, .2, .3, 0, 1, 0, 1, 2, 3, -1, .4, .5, .6, 1, 0, 0, 4, 5, 6}}});
  server.send(wire::ContactList{8, 8000001, {{1e300, 0, 0, 0, 0, 0, 0, 0, 0, 0, 99}}});
  server.send(wire::ContactList{9, 9000001, {}});
  server.send(wire::GuardState{1, 2, 1, 0});
  ASSERT_TRUE(pollUntil(client, [&] { return !guards.empty(); }));

  ASSERT_EQ(ticks.size(), 1U);
  EXPECT_EQ(ticks[0].tick, 7U);
  EXPECT_EQ(ticks[0].tickTime, 7000001ns);
  EXPECT_EQ(ticks[0].revision, 3U);
  EXPECT_THAT(ticks[0].hand_m, ElementsAre(1, 2, 3));
  EXPECT_THAT(ticks[0].proxy_m, ElementsAre(4, 5, 6));
  EXPECT_THAT(ticks[0].velocity_m_per_s, ElementsAre(7, 8, 9));
  EXPECT_THAT(ticks[0].orientation, ElementsAre(0, 0, 1, 0));
  EXPECT_THAT(ticks[0].force_N, ElementsAre(10, 11, 12));
  EXPECT_EQ(ticks[0].depth_m, 0.5);
  EXPECT_EQ(ticks[0].object, 2);
  EXPECT_EQ(ticks[0].buttons, 1U);
  EXPECT_EQ(ticks[0].guardActive, Trips(Trip::thermal));
  EXPECT_EQ(ticks[0].guardLatched, Trips(Trip::slew));

  ASSERT_EQ(contacts.size(), 3U);
  ASSERT_EQ(contacts[0].contacts.size(), 2U);
  EXPECT_EQ(contacts[0].contacts[0].object, 2);
  EXPECT_THAT(contacts[0].contacts[0].point_m, ElementsAre(.1, .2, .3));
  EXPECT_THAT(contacts[0].contacts[0].normal, ElementsAre(0, 1, 0));
  EXPECT_THAT(contacts[0].contacts[0].force_N, ElementsAre(1, 2, 3));
  EXPECT_EQ(contacts[0].contacts[1].object, -1);
  ASSERT_EQ(contacts[1].contacts.size(), 1U) << "an incomplete contact is ignored";
  EXPECT_EQ(contacts[1].contacts[0].object, -1) << "not an object number";
  EXPECT_TRUE(contacts[2].contacts.empty());
  EXPECT_EQ(contacts[2].tick, 9U);

  EXPECT_EQ(guards[0].active, Trips(Trip::notFinite));
  EXPECT_EQ(guards[0].latched, Trips(Trip::peakForce));
  EXPECT_TRUE(guards[0].armed);
  EXPECT_FALSE(guards[0].stopped);
  EXPECT_EQ(client.latest().tick.tick, 7U);
  EXPECT_EQ(client.latest().contacts.tick, 9U);
  EXPECT_TRUE(client.latest().guard.armed);
  EXPECT_EQ(client.statistics()[ReportKind::contacts].count, 3U);
}

TEST(Extensions, MarkersAndNamesAreSent) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  client.mark("trial 3 begins");
  client.setObjectName(2, "part.stl");
  client.flushAll();
  const auto received = server.waitReceived(2);
  ASSERT_EQ(received.size(), 2U);
  EXPECT_TRUE(is(received[0], wire::Marker{0, "trial 3 begins"}));
  EXPECT_TRUE(is(received[1], wire::SetObjectName{2, "part.stl"}));
}

TEST(Extensions, TextsThatTheWireWouldCutAreRefused) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  EXPECT_THAT(textOf<std::invalid_argument>([&] { client.mark(std::string(256, 'm')); }), HasSubstr("255"));
  EXPECT_THAT(textOf<std::invalid_argument>([&] { client.setObjectName(0, std::string(65, 'n')); }),
              HasSubstr("64"));
  EXPECT_THAT(textOf<std::invalid_argument>([&] { client.sendText(std::string(1024, 't')); }),
              HasSubstr("1023"));
  EXPECT_THAT(textOf<std::invalid_argument>([&] { client.setSurfaceProperty(0, std::string(21, 's'), 1); }),
              HasSubstr("20"));
  constexpr std::string_view kCut("stiff\0ness, 16 bytes",
                                  21);  // the receiver would take the NUL for the end
  const auto isCut = [&](auto&& command) {
    EXPECT_THAT(textOf<std::invalid_argument>(command), HasSubstr("a NUL character"));
  };
  isCut([&] { client.mark(kCut); });
  isCut([&] { client.setObjectName(0, kCut); });
  isCut([&] { client.sendText(kCut); });
  isCut([&] { client.setSurfaceProperty(0, kCut.substr(0, 10), 1); });
  isCut([&] { client.presentToken(kCut); });
  client.mark(std::string(255, 'm'));
  client.setObjectName(0, std::string(64, 'n'));
  client.flushAll();
  const auto received = server.waitReceived(2);
  ASSERT_EQ(received.size(), 2U);
  EXPECT_TRUE(is(received[0], wire::Marker{0, std::string(255, 'm')}));
  EXPECT_TRUE(is(received[1], wire::SetObjectName{0, std::string_view(std::string(64, 'n'))}));
}

TEST(Extensions, AStopOvertakesABatchAndNeedsAConnection) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  client.batch([&] {
    client.setObjectCount(1);
    client.stopForces();
    client.rearmForces();
  });
  client.flushAll();
  const auto received = server.waitReceived(7);
  ASSERT_EQ(received.size(), 7U);
  EXPECT_TRUE(is(received[1], wire::StopForces{})) << "after the key of the program";
  EXPECT_TRUE(is(received[3], wire::RearmForces{}));
  EXPECT_TRUE(is(received[4], wire::BatchBegin{}));

  Client nobody("Phantom@tcp://127.0.0.1:1", {.connectTimeout = 0ms});
  EXPECT_THAT(textOf<ConnectionLost>([&] { nobody.stopForces(); }), HasSubstr("forces not stopped"));
}

TEST(Extensions, HeartbeatsContinueWhilePolledAndOnTheNextConnection) {
  ScriptedServer server(able());
  Client client(server.tcpName());
  EXPECT_EQ(server.heartbeats(), 0U);
  client.enableHeartbeat();
  ASSERT_TRUE(pollUntil(client, [&] { return server.heartbeats() >= 5; }));
  server.dropClients();
  ASSERT_TRUE(waitReconnected(client, server, 2));
  const std::size_t before = server.heartbeats();
  ASSERT_TRUE(pollUntil(client, [&] { return server.heartbeats() >= before + 3; }));

  client.enableHeartbeat(false);
  client.flushAll();
  const auto received = server.waitReceived(1);
  ASSERT_EQ(received.size(), 1U);
  EXPECT_TRUE(is(received[0], wire::Heartbeat{0}));
  const std::size_t after = server.heartbeats();
  client.runFor(350ms);
  EXPECT_EQ(server.heartbeats(), after);
}

TEST(Extensions, TheHandIsHeldAndReleasedInOrder) {
  ScriptedServer server(able());
  Client client(server.name());  // this connection also has datagrams, which could overtake
  client.holdHand({{1, 2, 3}, {0, 0, 1, 0}, 3});
  client.holdHand({{4, 5, 6}});
  client.releaseHand();
  const auto received = server.waitReceived(3);
  ASSERT_EQ(received.size(), 3U);
  EXPECT_TRUE(is(received[0], wire::HoldHand{1, {1, 2, 3}, {0, 0, 1, 0}, 3}));
  EXPECT_TRUE(is(received[1], wire::HoldHand{1, {4, 5, 6}, {0, 0, 0, 1}, 0}));
  EXPECT_TRUE(is(received[2], wire::HoldHand{}));
  for (const Received& t : received) EXPECT_FALSE(t.byDatagram);
}

TEST_P(BothWays, StreamedStateIsSentAtOnce) {
  ScriptedServer server(able());
  Client client(name(server));
  ASSERT_TRUE(client.waitCapabilities());
  RemoteContact contact;
  contact.id = 7;
  contact.shape = RemoteShape::cylinder;
  contact.point_m = {1, 2, 3};
  contact.normal = {4, 5, 6};
  contact.radius_m = 7;
  contact.axis = {8, 9, 10};
  contact.velocity_m_per_s = {11, 12, 13};
  contact.angularVelocity_rad_per_s = {14, 15, 16};
  contact.stiffness_N_per_m = 17;
  contact.damping_Ns_per_m = 18;
  contact.staticFriction = 19;
  contact.dynamicFriction = 20;
  contact.lifetime = 21ms;
  contact.yields = true;
  client.batch([&] {
    client.setVertex(0, 0, 1, 2, 3);
    client.setRemoteContacts({&contact, 1});
    client.setForce({1, 2, 3}, {4, 5, 6}, 50ms);
    const auto received = server.waitReceived(2);  // before the batch
    ASSERT_EQ(received.size(), 2U);
    const auto* contacts = received[0].message.as<wire::RemoteContacts>();
    ASSERT_NE(contacts, nullptr);
    EXPECT_GT(contacts->time, 0);
    EXPECT_THAT(contacts->contacts.values, ElementsAre(7, 2, 7, 1, 2, 3, 4, 5, 6, 8, 9, 10, 11, 12, 13, 14,
                                                       15, 16, 17, 18, 19, 20, 0.021, 1));
    const auto* force = received[1].message.as<wire::HeldForce>();
    ASSERT_NE(force, nullptr);
    EXPECT_GE(force->time, contacts->time);
    EXPECT_THAT(force->force, ElementsAre(1, 2, 3));
    EXPECT_THAT(force->torque, ElementsAre(4, 5, 6));
    EXPECT_DOUBLE_EQ(force->lifetime, 0.05);
    // What renders forces counts by TCP only.
    for (const Received& r : received) EXPECT_FALSE(r.byDatagram);
  });
  const std::vector<RemoteContact> many(17);
  EXPECT_THAT(textOf<std::invalid_argument>([&] { client.setRemoteContacts(many); }), HasSubstr("17"));
}

TEST(Extensions, RemoteContactsNameNoStateOfAnEarlierServer) {
  ScriptedServer server({.capabilities = allCapabilities()});
  Client client(server.tcpName());
  wire::HandState state;
  state.time = 77;
  server.send(state);
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().hand.tickTime.count() == 77; }));
  server.dropClients();
  EXPECT_THROW(client.stopForces(), ConnectionLost);
  client.waitConnected(kPatience);  // without a poll: the loss is not reported yet
  client.setRemoteContacts({});
  state.time = 99;
  server.send(state);
  ASSERT_TRUE(pollUntil(client, [&] { return client.latest().hand.tickTime.count() == 99; }));
  client.setRemoteContacts({});
  std::vector<std::int64_t> times;
  for (const Received& one : server.waitReceived(2)) {
    if (const auto* contacts = one.message.as<wire::RemoteContacts>()) times.push_back(contacts->stateTime);
  }
  EXPECT_EQ(times, (std::vector<std::int64_t>{0, 99}));
}

TEST(Extensions, WithoutRemoteContactsTheCallsThrow) {
  ScriptedServer server(ableBut(wire::kFeatureRemoteContacts));
  Client client(server.name());
  EXPECT_THROW(client.setRemoteContacts({}), Unsupported);
  EXPECT_THROW(client.setForce({}), Unsupported);
}

}  // namespace
}  // namespace hapticd::test
