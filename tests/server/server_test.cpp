// The whole server over real sockets, driven by scripted peers.
#include "server/server.h"

#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <filesystem>
#include <fstream>
#include <functional>
#include <random>
#include <thread>

#include "base/world.h"
#include "feeling.h"
#include "hanging_files.h"
#include "log_lines.h"
#include "running_server.h"
#include "scripted_peer.h"

namespace hapticd::test {
namespace {

bool untilTouched(ScriptedPeer& peer) {
  return peer.until([&] {
    const auto touched = peer.all<wire::TouchedObject>();
    return !touched.empty() && touched.back().object == 0;
  });
}

bool until(const std::function<bool()>& done) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (!done() && std::chrono::steady_clock::now() < end)
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  return done();
}

// The black box of one device waits for the disk; the other device does not.
TEST(Server, ADiskThatHangsLeavesNoDeviceOpen) {
  HangingFiles files;
  const base::World& world = base::world();
  const base::ScopedWorld scoped({world.clock, world.threads, files, world.random});
  const std::filesystem::path folder =
      std::filesystem::path(testing::TempDir()) / ("hanging_" + std::to_string(::getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "fast.csv") << "t_s,x_m,y_m,z_m\n0,0,0,0\n0.01,0.1,0,0\n0.02,0,0,0\n";
  {
    server::ServerConfig config = RunningServer::anyPort();
    config.devices.resize(2, config.devices.front());
    config.devices.back().names = {"Other"};
    server::DeviceConfig& fast = config.devices.front();
    fast.driver = "replay";
    fast.hand = (folder / "fast.csv").string();
    fast.enableForces = true;
    fast.blackBoxDir = folder.string();
    fast.blackBoxKeep = 1;
    RunningServer server(config);
    EXPECT_TRUE(until([&] { return files.asked(); }));
    server.server().stop();
    EXPECT_TRUE(until([&] { return server.server().devicesClosed(); }));
    files.answer();
  }
  std::filesystem::remove_all(folder);
}

TEST(Server, TcpClientReceivesReports) {
  RunningServer server;
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  EXPECT_TRUE(peer.untilNext<wire::TrackerPosQuat>());
  EXPECT_TRUE(peer.until([&] { return peer.count<wire::IsTouching>() >= 50; }));
  EXPECT_GE(peer.count<wire::ButtonStates>(), 1U);
  EXPECT_EQ(peer.datagrams(), 0U);
}

// A reader of the raw protocol, a logger or a filter: it describes "VRPN Control" like every stock client,
// and no device. Nobody else is connected.
void expectEverything(ScriptedPeer::Mode mode) {
  RunningServer server;
  ScriptedPeer listener(server.address(), "VRPN Control", mode);
  ASSERT_TRUE(listener.untilConnected());
  EXPECT_TRUE(listener.until([&] { return listener.count<wire::IsTouching>() >= 50; }));
  EXPECT_TRUE(listener.until([&] { return listener.count<wire::ButtonStates>() >= 1; }))
      << "the present state";
  EXPECT_TRUE(listener.until([&] { return listener.count<wire::GuardState>() >= 1; }));
}

TEST(Server, AClientThatDescribesNothingHearsEverything) {
  expectEverything(ScriptedPeer::Mode::tcp);
}

TEST(Server, AUdpClientThatDescribesNothingHearsEverything) {
  expectEverything(ScriptedPeer::Mode::udp);
}

TEST(Server, UdpClientGetsAReverseConnectionAndDatagrams) {
  RunningServer server;
  ScriptedPeer peer(server.address(), "Phantom", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(peer.untilConnected());
  EXPECT_TRUE(peer.until([&] { return peer.datagrams() >= 20; }));
  // Reliable messages still use TCP.
  peer.send(wire::Ping{});
  EXPECT_TRUE(peer.untilNext<wire::Pong>());
  for (const auto& message : peer.messages()) {
    if (message.kind == wire::kindOf<wire::Pong>) {
      EXPECT_FALSE(message.byDatagram);
    }
  }
}

TEST(Server, StampsAreWallTimesOfTicks) {
  RunningServer server;
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.until([&] { return peer.count<wire::IsTouching>() >= 20; }));
  std::int64_t before = 0;
  for (const auto& message : peer.messages()) {
    if (message.kind != wire::kindOf<wire::IsTouching>) continue;
    const std::int64_t stamp = std::int64_t{message.time.seconds} * 1000000 + message.time.microseconds;
    EXPECT_GE(stamp, before);
    before = stamp;
  }
  EXPECT_NEAR(static_cast<double>(before) * 1e-6, static_cast<double>(time(nullptr)), 60);
}

TEST(Server, PingIsAnsweredWithPongAndButtonStates) {
  RunningServer server;
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  peer.forget();
  peer.send(wire::Ping{});
  EXPECT_TRUE(peer.untilNext<wire::Pong>());
  EXPECT_TRUE(peer.until([&] { return peer.count<wire::ButtonStates>() >= 1; }));
}

TEST(Server, TrackerQueriesAreAnswered) {
  RunningServer server;
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.until([&] { return peer.count<wire::IsTouching>() >= 1; }));
  peer.send(wire::TrackerRequestToRoom{});
  EXPECT_TRUE(peer.until([&] { return peer.count<wire::TrackerToRoom>() == 1; }));
  peer.send(wire::TrackerRequestUnitToSensor{});
  EXPECT_TRUE(peer.until([&] { return peer.count<wire::TrackerUnitToSensor>() == 1; }));
  peer.send(wire::TrackerRequestWorkspace{});
  ASSERT_TRUE(peer.until([&] { return peer.count<wire::TrackerWorkspace>() == 1; }));
  EXPECT_NEAR(peer.all<wire::TrackerWorkspace>()[0].max[0], 0.080,
              1e-12);  // metres, for a world in millimetres
}

TEST(Server, ContactWithAnUploadedMeshBeginsAndEnds) {
  RunningServer server;
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  ASSERT_TRUE(untilTouched(peer));
  EXPECT_TRUE(peer.until([&] {
    const auto forces = peer.all<wire::Force>();
    return !forces.empty() &&
           std::hypot(forces.back().force[0], forces.back().force[1], forces.back().force[2]) > 0.1;
  }));
  EXPECT_GE(peer.count<wire::Dop>(), 1U);
  EXPECT_GE(peer.count<wire::Scp>(), 1U);
  EXPECT_GE(peer.count<wire::Angle>(), 1U);
  // The surface lies 20 mm from the centre: world / 1000 is metres.
  const auto scp = peer.all<wire::Scp>().back().position;
  EXPECT_NEAR(std::max({std::abs(scp[0]), std::abs(scp[1]), std::abs(scp[2])}), 0.020, 1e-6);
  EXPECT_TRUE(peer.until([&] { return peer.all<wire::TouchedObject>().back().object == -1; }));
  EXPECT_EQ(peer.all<wire::Dop>().back().depth, 0);
}

TEST(Server, ALateClientGetsTheContactAtOnce) {
  RunningServer server;
  ScriptedPeer first(server.address());
  ASSERT_TRUE(first.untilConnected());
  sendCube(first);
  ASSERT_TRUE(untilTouched(first));
  ScriptedPeer late(server.address());
  ASSERT_TRUE(late.until([&] { return late.count<wire::ButtonStates>() >= 1; }));
  ASSERT_TRUE(late.untilNext<wire::IsTouching>());
  // All reports between the button states and the next isTouching: sent at once, not on the next change.
  const auto& messages = late.messages();
  const auto kindIs = [](wire::MessageKind kind) { return [kind](const auto& m) { return m.kind == kind; }; };
  const auto begin = std::ranges::find_if(messages, kindIs(wire::kindOf<wire::ButtonStates>));
  const auto end = std::find_if(begin, messages.end(), kindIs(wire::kindOf<wire::IsTouching>));
  for (const auto kind :
       {wire::kindOf<wire::TrackerPosQuat>, wire::kindOf<wire::Force>, wire::kindOf<wire::Dop>,
        wire::kindOf<wire::TouchedObject>, wire::kindOf<wire::Angle>}) {
    EXPECT_NE(std::find_if(begin, end, kindIs(kind)), end) << wire::info(kind).name;
  }
}

TEST(Server, BadValuesGetATextAndDoNotChangeTheScene) {
  RunningServer server;
  ScriptedPeer peer(server.address());
  ASSERT_TRUE(peer.untilConnected());
  sendCube(peer);
  peer.send(wire::SetHapticProperty{7, "stiffness", 1.0F});
  EXPECT_TRUE(peer.untilText("7"));
  peer.send(wire::SetHapticProperty{0, "squishiness", 1.0F});
  EXPECT_TRUE(peer.untilText("squishiness"));
  peer.send(wire::SetTransformMatrix{0, {}});  // singular
  EXPECT_TRUE(peer.until([&] { return peer.count<wire::Text>() >= 3; }));
  EXPECT_TRUE(peer.open());
  EXPECT_TRUE(untilTouched(peer));
}

TEST(Server, AMalformedMessageEndsOnlyItsConnection) {
  RunningServer server;
  ScriptedPeer good(server.address());
  ScriptedPeer bad(server.address());
  ASSERT_TRUE(good.untilConnected());
  ASSERT_TRUE(bad.untilConnected());
  // A setVertex of 19 bytes.
  bad.endpoint().sendRaw({1, 2}, bad.device(), wire::kLocalType<wire::SetVertex>, std::vector<std::byte>(19),
                         wire::Reliability::kReliable);
  bad.flush();
  EXPECT_TRUE(bad.until([&] { return !bad.open(); }));
  EXPECT_TRUE(good.untilNext<wire::IsTouching>());
  EXPECT_TRUE(good.open());
}

TEST(Server, AMalformedDatagramIsIgnored) {
  RunningServer server;
  ScriptedPeer peer(server.address(), "Phantom", ScriptedPeer::Mode::udp);
  ASSERT_TRUE(peer.until([&] { return peer.datagrams() >= 1; }));
  // A plane of 19 bytes: in the stream it would end the connection.
  peer.endpoint().sendRaw({1, 2}, peer.device(), wire::kLocalType<wire::Plane>, std::vector<std::byte>(19),
                          wire::Reliability::kLowLatency);
  peer.flush();
  peer.send(wire::Ping{});
  EXPECT_TRUE(peer.untilNext<wire::Pong>());
  EXPECT_TRUE(peer.untilNext<wire::IsTouching>());
  EXPECT_TRUE(peer.open());
}

TEST(Server, RandomBytesOnBothPortsDoNotDisturbOtherClients) {
  RunningServer server;
  ScriptedPeer good(server.address());
  ASSERT_TRUE(good.untilConnected());

  std::mt19937 random(1);
  std::vector<std::byte> noise(1 << 20);
  for (std::byte& b : noise) b = static_cast<std::byte>(random());
  net::Loop loop;
  bool closed = false;
  auto stranger = net::Connection::connect(loop, server.address(), 2s);
  stranger.start({.onConnected = {}, .onBytes = {}, .onDrained = {}, .onClosed = [&](const std::string&) {
                    closed = true;
                  }});
  stranger.send(std::span<const std::byte>(noise));
  stranger.flush();
  net::UdpSocket udp(loop, {net::kLoopbackAddress, 0});
  for (std::size_t at = 0; at + 1400 < noise.size(); at += 1400) {
    udp.sendTo(std::span<const std::byte>(noise).subspan(at, 1 + random() % 1400), server.address());
  }
  for (int i = 0; i < 1000 && !closed; ++i) loop.runOnce(20ms);
  EXPECT_TRUE(closed);

  const std::string halfCookie = "vrpn: ver. 0";
  auto silent = net::Connection::connect(loop, server.address(), 2s);
  silent.start({});
  silent.send(std::as_bytes(std::span(halfCookie)));
  silent.flush();
  loop.runOnce(20ms);
  EXPECT_TRUE(good.untilNext<wire::IsTouching>());
  EXPECT_TRUE(good.open());
}

TEST(Server, AVanishedClientIsRemovedAndAnotherCanConnect) {
  RunningServer server;
  for (int i = 0; i < 5; ++i) {
    ScriptedPeer peer(server.address());
    ASSERT_TRUE(peer.untilConnected());
    sendCube(peer);
    peer.close();
  }
  ScriptedPeer last(server.address());
  ASSERT_TRUE(last.untilConnected());
  EXPECT_TRUE(last.untilNext<wire::IsTouching>());
}

TEST(Server, EveryNameOfADeviceWorks) {
  server::ServerConfig config = RunningServer::anyPort();
  config.devices[0].names = {"Phantom", "Tracker0"};
  RunningServer server(config);
  ScriptedPeer one(server.address(), "Phantom");
  ScriptedPeer two(server.address(), "Tracker0");
  EXPECT_TRUE(one.untilNext<wire::TrackerPosQuat>());
  EXPECT_TRUE(two.untilNext<wire::TrackerPosQuat>());
  two.send(wire::Ping{});
  EXPECT_TRUE(two.untilNext<wire::Pong>());
}

TEST(Server, TwoDevicesHaveSeparateScenes) {
  server::ServerConfig config = RunningServer::anyPort();
  config.devices.resize(2);
  config.devices[0].names = {"Left"};
  config.devices[1].names = {"Right"};
  RunningServer server(config);
  ScriptedPeer left(server.address(), "Left");
  ScriptedPeer right(server.address(), "Right");
  ASSERT_TRUE(left.untilConnected());
  ASSERT_TRUE(right.untilConnected());
  sendCube(left);
  ASSERT_TRUE(untilTouched(left));
  EXPECT_TRUE(right.untilNext<wire::IsTouching>());
  for (const auto& touching : right.all<wire::IsTouching>()) EXPECT_EQ(touching.touching, 0);
}

TEST(Server, TheSceneIsKeptOrClearedAsConfiguredWhenItsClientDisconnects) {
  for (const auto choice : {server::SceneOnDisconnect::keep, server::SceneOnDisconnect::clear}) {
    server::ServerConfig config = RunningServer::anyPort();
    config.devices[0].sceneOnDisconnect = choice;
    RunningServer server(config);
    {
      ScriptedPeer first(server.address());
      ASSERT_TRUE(first.untilConnected());
      sendCube(first);
      ASSERT_TRUE(untilTouched(first));
    }
    const auto touchedByNext = [&] {
      ScriptedPeer next(server.address());
      next.until(
          [&] { return next.count<wire::IsTouching>() >= 100; });  // the hand has left the removed object
      next.forget();
      return next.until([&] { return next.count<wire::IsTouching>() >= 1000; }) &&
             std::ranges::any_of(next.all<wire::IsTouching>(), [](const auto& m) { return m.touching != 0; });
    };
    EXPECT_EQ(touchedByNext(), choice == server::SceneOnDisconnect::keep);
  }
}

TEST(Server, AReverseConnectionToAnotherHostIsRefused) {
  RunningServer server;
  // A third party listens; a forged request names its address instead of the sender's.
  net::Loop loop;
  bool called = false;
  net::TcpListener victim(loop, {net::kAnyAddress, 0}, [&](net::Connection) { called = true; });
  net::UdpSocket udp(loop, {net::kLoopbackAddress, 0});
  const std::string forged = wire::formatUdpRequest({"192.0.2.1", victim.local().port});
  udp.sendTo(std::as_bytes(std::span(forged)), server.address());
  const std::string lowPort("127.0.0.1 80\0", 13);
  udp.sendTo(std::as_bytes(std::span(lowPort)), server.address());
  // A later valid request is served, so the server has read and refused the others by then.
  ScriptedPeer peer(server.address(), "Phantom", ScriptedPeer::Mode::udp);
  EXPECT_TRUE(peer.untilConnected());
  loop.runOnce(0ms);
  EXPECT_FALSE(called);
}

TEST(Server, TextsOfClientsAreQuotedAndCannotFloodTheLog) {
  LogLines log;
  {
    RunningServer server;
    ScriptedPeer peer(server.address());
    ASSERT_TRUE(peer.untilConnected());
    for (int i = 0; i < 2000; ++i)
      peer.send(wire::Text{.severity = 0, .level = 0, .text = std::string("fine\nforged line")});
    peer.send(wire::Ping{});
    ASSERT_TRUE(peer.untilNext<wire::Pong>());
  }
  EXPECT_GE(log.count("client 1: sent the text \"fine\\x0aforged line\""), 1U);
  EXPECT_LE(log.count("forged"), 200U);
}

TEST(Server, ARequestForAMissingDeviceIsLoggedWithTheAvailableOnes) {
  LogLines log;
  {
    RunningServer server;
    ScriptedPeer peer(server.address(), "Fantom");
    ASSERT_TRUE(peer.untilConnected());
    peer.sendBytes(std::vector<std::byte>(
        24));  // an invalid frame closes the connection after everything before it was read
    ASSERT_TRUE(peer.until([&] { return !peer.open(); }));
  }
  EXPECT_EQ(log.count("requested the device \"Fantom\", which does not exist; available: Phantom"), 1U);
}

TEST(Server, ARequestForAMirrorThatIsOffNamesTheKeyThatOffersIt) {
  LogLines log;
  {
    RunningServer server;
    for (const char* name : {"Phantom.touch", "Fantom.touch"}) {
      ScriptedPeer peer(server.address(), name);
      ASSERT_TRUE(peer.untilConnected());
      peer.sendBytes(std::vector<std::byte>(24));
      ASSERT_TRUE(peer.until([&] { return !peer.open(); }));
    }
  }
  EXPECT_EQ(
      log.count(
          "requested the device \"Phantom.touch\", which does not exist; available: Phantom; 'mirrors = "
          "true' in its [[device]] offers it"),
      1U);
  EXPECT_EQ(log.count("mirrors"), 1U);
}

TEST(Server, AReverseConnectionToTheServerItselfIsRefused) {
  LogLines log;
  {
    RunningServer server;
    net::Loop loop;
    net::UdpSocket udp(loop, net::Endpoint{net::kLoopbackAddress, 0});
    const std::string request = wire::formatUdpRequest({"127.0.0.1", server.address().port});
    udp.sendTo(std::as_bytes(std::span(request)), server.address());
    // The only connection that this request can cause is accepted and closed again.
    ScriptedPeer peer(server.address());
    ASSERT_TRUE(peer.untilConnected());
    ASSERT_TRUE(peer.until([&] { return peer.count<wire::IsTouching>() >= 200; }));
  }
  EXPECT_EQ(log.count("names this server itself"), 1U);
  EXPECT_EQ(log.count("speaks VRPN"), 1U);
}

TEST(Server, AReverseConnectionToAnotherAddressOfTheServerIsRefused) {
  LogLines log;
  {
    server::ServerConfig config = RunningServer::anyPort();
    config.listenAddress = "0.0.0.0";
    config.insecure = true;
    RunningServer server(config);
    const net::Endpoint here{net::kLoopbackAddress, server.address().port};
    net::Loop loop;
    net::UdpSocket udp(loop, net::Endpoint{net::kLoopbackAddress, 0});
    const std::string request = wire::formatUdpRequest({"127.0.0.2", here.port});
    udp.sendTo(std::as_bytes(std::span(request)), here);
    ScriptedPeer peer(here);
    ASSERT_TRUE(peer.untilConnected());
    ASSERT_TRUE(peer.until([&] { return peer.count<wire::IsTouching>() >= 200; }));
  }
  EXPECT_EQ(log.count("names this server itself"), 1U);
  EXPECT_EQ(log.count("speaks VRPN"), 1U);
}

TEST(Server, AFullServerStillTakesAStopAndNothingElse) {
  server::ServerConfig config = RunningServer::anyPort();
  config.limits.connections = 2;
  RunningServer server(config);
  ScriptedPeer first(server.address());
  ScriptedPeer second(server.address());
  ASSERT_TRUE(first.untilConnected());
  ASSERT_TRUE(second.untilConnected());
  ScriptedPeer late(server.address());
  ASSERT_TRUE(late.untilConnected());
  late.send(wire::SetObjectNumber{2});
  EXPECT_TRUE(late.untilText(
      "setObjectNumber refused: the server is full: this connection may only stop and re-arm forces"));
  late.send(wire::Ping{});
  EXPECT_TRUE(late.untilNext<wire::Pong>());
  late.send(wire::StopForces{});
  EXPECT_TRUE(first.until([&] {
    const auto guard = first.last<wire::GuardState>();
    return guard && guard->stopped != 0;
  }));
  // Whoever holds on to the reserve loses it to those that come later.
  std::deque<ScriptedPeer> more;
  for (int i = 0; i < 16; ++i) {
    ASSERT_TRUE(more.emplace_back(server.address()).untilConnected());
  }
  EXPECT_TRUE(late.untilClosed());
  EXPECT_TRUE(first.open() && second.open());
  // A place that is free again is a whole one.
  more.clear();
  second.close();
  EXPECT_TRUE(first.until([&] {
    ScriptedPeer next(server.address());
    if (!next.untilConnected()) return false;
    next.send(wire::SetObjectNumber{-1});
    return next.untilText("setObjectNumber") &&
           next.texts().back().text.text.find("full") == std::string::npos;
  }));
}

TEST(Server, AClientThatSendsMoreThanAllowedIsToldAndClosedAndAStopStillActs) {
  server::ServerConfig config = RunningServer::anyPort();
  config.limits.commandsPerSecond = 1000;
  RunningServer server(config);
  ScriptedPeer other(server.address());
  ScriptedPeer greedy(server.address());
  ASSERT_TRUE(other.untilConnected());
  ASSERT_TRUE(greedy.untilConnected());
  for (int i = 0; i < 5000; ++i) greedy.queue(wire::SetVertex{0, i, {}});
  for (int i = 0; i < 1000; ++i) greedy.queue(wire::StopForces{});
  greedy.send(wire::Ping{});
  EXPECT_TRUE(greedy.untilNext<wire::Pong>()) << "those that fill meshes and stops do not count";
  for (int i = 0; i < 5000; ++i) greedy.queue(wire::Ping{});
  greedy.flush();
  EXPECT_TRUE(greedy.untilText("more than 1000 messages in a second; send fewer; the connection ends"));
  EXPECT_TRUE(greedy.untilClosed());
  other.send(wire::Ping{});
  EXPECT_TRUE(other.untilNext<wire::Pong>());
}

TEST(Server, OfConnectionsWithoutAGreetingTheOldestIsClosed) {
  server::ServerConfig config = RunningServer::anyPort();
  config.limits.unfinishedConnections = 16;
  RunningServer server(config);
  ScriptedPeer greeted(server.address());
  ASSERT_TRUE(greeted.untilConnected());
  // The server has read the greeting, too.
  greeted.send(wire::Ping{});
  ASSERT_TRUE(greeted.untilNext<wire::Pong>());
  std::deque<ScriptedPeer> silent;
  for (int i = 0; i < 17; ++i) {
    silent.emplace_back(server.address(), "Phantom", ScriptedPeer::Mode::tcp, ScriptedPeer::Speech::raw);
    // The server accepts them in order.
    silent.back().sendBytes(std::as_bytes(std::span("v", 1)));
    EXPECT_TRUE(silent.back().until([&] { return silent.back().delivered(); }));
  }
  EXPECT_TRUE(silent.front().untilClosed());
  EXPECT_TRUE(silent.back().open());
  greeted.send(wire::Ping{});
  EXPECT_TRUE(greeted.untilNext<wire::Pong>());
}

TEST(Server, AClientThatUsesMoreMemoryThanAllowedIsClosedAndTheOthersStay) {
  server::ServerConfig config = RunningServer::anyPort();
  config.limits.sendQueue_MB = 1000;  // the memory of the client ends it first
  config.limits.memory_MB = 64;
  config.limits.clientMemory_MB = 32;
  config.limits.commandsPerSecond = 1'000'000'000;
  LogLines log;
  RunningServer server(config);
  ScriptedPeer other(server.address());
  ASSERT_TRUE(other.untilConnected());
  {
    ScriptedPeer greedy(server.address());
    ASSERT_TRUE(greedy.untilConnected());
    greedy.connection().pauseReading();
    const auto end = std::chrono::steady_clock::now() + 60s;
    while (std::chrono::steady_clock::now() < end &&
           log.count("this client uses more than 32 MiB of the server") == 0) {
      for (int i = 0; i < 10'000; ++i) greedy.queue(wire::QueryCapabilities{});
      greedy.flush();
      greedy.poll();
      other.poll();
    }
  }
  EXPECT_GT(log.count("this client uses more than 32 MiB of the server"), 0U);
  other.send(wire::Ping{});
  EXPECT_TRUE(other.untilNext<wire::Pong>());
}

TEST(Server, APortInUseIsReported) {
  RunningServer server;
  server::ServerConfig second = RunningServer::anyPort();
  second.port = server.address().port;
  try {
    server::Server other(second);
    FAIL() << "two servers on one port";
  } catch (const net::Error& error) {
    EXPECT_NE(std::string(error.what()).find(std::to_string(second.port)), std::string::npos) << error.what();
    EXPECT_NE(std::string(error.what()).find("--listen"), std::string::npos) << error.what();
  }
}

// vrpn_ping of VRPN sends "Server, are you there?", a type from before the ping message.
TEST(Server, MessagesOfUnknownTypesAreIgnored) {
  RunningServer server;
  for (const auto mode : {ScriptedPeer::Mode::tcp, ScriptedPeer::Mode::udp}) {
    ScriptedPeer peer(server.address(), "Phantom", mode);
    ASSERT_TRUE(peer.untilConnected());
    peer.sendForeign("Server, are you there?", {});
    peer.sendForeign("vrpn_Dial update", std::vector<std::byte>(16));
    peer.send(wire::Ping{});
    EXPECT_TRUE(peer.untilNext<wire::Pong>());
    EXPECT_TRUE(peer.open());
  }
}

}  // namespace
}  // namespace hapticd::test
