// Control of a device by its clients, over real sockets: stop, re-arm, roles, heartbeat, holding the hand,
// batches, shared scenes.
#include <gtest/gtest.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "feeling.h"
#include "hapticd/client.h"
#include "log_lines.h"
#include "running_server.h"
#include "scripted_peer.h"
#include "server/session/refusal_codes.h"

namespace hapticd::test {
namespace {

using Config = server::ServerConfig;

// A force field of 1 N upwards everywhere.

double lastForce(const ScriptedPeer& peer) {
  const auto forces = peer.all<wire::Force>();
  return forces.empty() ? 0
                        : std::hypot(forces.back().force[0], forces.back().force[1], forces.back().force[2]);
}
bool untilForce(ScriptedPeer& peer, double force_N, double tolerance_N = 0.02) {
  return peer.until(
      [&] { return std::abs(lastForce(peer) - force_N) < tolerance_N && peer.count<wire::Force>(); });
}
wire::GuardState lastGuard(const ScriptedPeer& peer) {
  const auto states = peer.all<wire::GuardState>();
  return states.empty() ? wire::GuardState{} : states.back();
}

// Holds the hand still at a position, so that only commanded forces act.
void hold(ScriptedPeer& peer, double x, double y, double z) {
  peer.send(wire::HoldHand{.hold = 1, .position = {x, y, z}});
}

class ControlTest : public ::testing::Test {
 protected:
  void serve(const Config& config = RunningServer::anyPort()) {
    server_ = std::make_unique<RunningServer>(config);
  }
  // Only the first client that commands may do so.
  void serveFirst() {
    Config config = RunningServer::anyPort();
    config.devices[0].control = server::Control::first;
    serve(config);
  }
  std::unique_ptr<ScriptedPeer> peer(const std::string& device = "Phantom") {
    auto peer = std::make_unique<ScriptedPeer>(server_->address(), device);
    EXPECT_TRUE(peer->until([&] { return peer->count<wire::IsTouching>() > 0; }));
    return peer;
  }
  std::unique_ptr<RunningServer> server_;
};

TEST_F(ControlTest, CapabilitiesDescribeTheDevice) {
  serve();
  const auto client = peer();
  client->send(wire::QueryCapabilities{});
  ASSERT_TRUE(client->untilNext<wire::Capabilities>());
  const auto answer = client->all<wire::Capabilities>().at(0);
  EXPECT_EQ(answer.version, 1);
  EXPECT_EQ(answer.features, 127U);
  EXPECT_EQ(answer.servoRate, 1000);
  EXPECT_NEAR(answer.peakForce, 3.3, 1e-12);
  EXPECT_NEAR(answer.workspace[3], 0.08, 1e-12);
}

TEST_F(ControlTest, AnyClientStopsTheForceAndReArmingRestoresIt) {
  serve();
  const auto owner = peer();
  const auto other = peer();
  hold(*owner, 0, 0, 0);
  owner->send(kUp);
  ASSERT_TRUE(untilForce(*owner, 1));
  EXPECT_EQ(lastGuard(*owner).stopped, 0);
  other->send(wire::StopForces{});
  ASSERT_TRUE(owner->until([&] { return lastGuard(*owner).stopped == 1; }));
  ASSERT_TRUE(untilForce(*owner, 0, 1e-9));
  ASSERT_TRUE(owner->until([&] { return owner->count<wire::ForceError>() > 0; }));
  owner->send(wire::RearmForces{});
  ASSERT_TRUE(owner->untilText("stopped the forces; it may re-arm")) << "the text names who stopped";
  EXPECT_EQ(lastGuard(*owner).stopped, 1);
  other->send(wire::RearmForces{});
  ASSERT_TRUE(owner->until([&] { return lastGuard(*owner).stopped == 0; }));
  EXPECT_TRUE(untilForce(*owner, 1));
}

TEST_F(ControlTest, OneClientSteersTheHandToItsTarget) {
  serve();
  auto holder = peer();
  const auto other = peer();
  hold(*holder, 30, 20, 10);
  other->send(wire::Subscribe{.kinds = wire::kReportHip, .rate = 0});
  const auto isAt = [&](double x, double y, double z) {
    const auto poses = other->all<wire::TrackerPosQuat>();
    for (auto pose = poses.rbegin(); pose != poses.rend(); ++pose) {
      if (pose->sensor != server::kSensorHip) continue;
      return std::hypot(pose->position[0] - x, pose->position[1] - y, pose->position[2] - z) < 0.0015;
    }
    return false;
  };
  ASSERT_TRUE(other->until([&] { return isAt(0.03, 0.02, 0.01); }));
  hold(*other, 0, 0, 0);
  EXPECT_TRUE(other->untilText("holds the hand"));
  EXPECT_EQ(other->texts().back().level, static_cast<std::uint32_t>(server::RefusalCode::handHeldByOther));
  holder->close();
  holder.reset();
  ASSERT_TRUE(other->until([&] {
    hold(*other, -20, 0, 0);
    return isAt(-0.02, 0, 0);
  }));
}

TEST_F(ControlTest, AClientThatOptedIntoHeartbeatsIsLostWithoutThem) {
  serve();
  const auto watcher = peer();
  const auto client = peer();
  hold(*watcher, 0, 0, 0);
  client->send(kUp);
  ASSERT_TRUE(untilForce(*watcher, 1));
  client->send(wire::Heartbeat{1});  // from here on the clock runs
  EXPECT_TRUE(client->until([&] { return !client->open(); }));
  EXPECT_TRUE(untilForce(*watcher, 0, 1e-9));
  EXPECT_TRUE(watcher->open());
}

TEST_F(ControlTest, AClientCanOptOutOfHeartbeats) {
  serve();
  const auto client = peer();
  client->send(wire::Heartbeat{1});
  client->send(wire::Heartbeat{0});
  const auto since = client->count<wire::IsTouching>();
  // 1500 reports last 1.5 s.
  EXPECT_TRUE(client->until([&] { return client->count<wire::IsTouching>() > since + 1500; }, 60s));
  EXPECT_TRUE(client->open());
}

TEST_F(ControlTest, OnlyTheFirstClientCommandsUntilItDisconnects) {
  serveFirst();
  auto first = peer();
  const auto second = peer();
  first->send(wire::SetObjectNumber{2});
  hold(*first, 0, 0, 0);
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  second->send(kUp);
  ASSERT_TRUE(second->untilText("vrpn_ForceDevice Force_Field refused: client"));
  EXPECT_EQ(second->texts().back().level, static_cast<std::uint32_t>(server::RefusalCode::notPermitted));
  second->send(wire::StopForces{});  // permitted for every client
  ASSERT_TRUE(first->until([&] { return lastGuard(*first).stopped == 1; }));
  first->send(wire::RearmForces{});
  ASSERT_TRUE(first->untilText("stopped the forces"));
  second->send(wire::RearmForces{});  // undoes its own stop
  ASSERT_TRUE(first->until([&] { return lastGuard(*first).stopped == 0; }));
  first->send(wire::ReleaseControl{});
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  EXPECT_TRUE(second->until([&] {
    second->send(kUp);
    return lastForce(*second) > 0.5;
  }));
}

// The server waits 2 s for it to read the reason: control and hand do not wait with it.
TEST_F(ControlTest, AClientThatTheServerEndsKeepsNeitherControlNorHand) {
  LogLines log;
  serveFirst();
  const auto first = peer();
  const auto second = peer();
  first->send(wire::SetObjectNumber{2});
  hold(*first, 0, 0, 0);
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  first->sendPayload(wire::kindOf<wire::SetVertex>, std::vector<std::byte>(3));  // and does not read
  ASSERT_TRUE(second->until([&] {
    second->send(wire::HoldHand{.hold = 1, .position = {10, 20, 5}});
    second->send(kUp);
    return lastForce(*second) > 0.5;
  }));
  EXPECT_TRUE(untilHandAt(*second, {0.010, 0.020, 0.005}, 2e-3));
  EXPECT_EQ(log.count("disconnected: malformed"), 0U) << log.text();
}

// A client that streams at 1 kHz and reads nothing would be disconnected by its own refusals.
TEST_F(ControlTest, AStreamThatIsNotPermittedHasOneTextASecondOfEachKind) {
  serveFirst();
  auto first = peer();
  const auto second = peer();
  first->send(wire::SetObjectNumber{2});
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  constexpr int kKinds = 3;
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 50; ++i) {
    second->send(wire::HeldForce{.force = {1, 0, 0}, .lifetime = 0.1});
    second->send(wire::RemoteContacts{});
    second->send(wire::HoldHand{.hold = 1});
    second->send(wire::Ping{});
    ASSERT_TRUE(second->untilNext<wire::Pong>());
  }
  const auto seconds =
      std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - begin);
  ASSERT_FALSE(second->texts().empty());
  EXPECT_EQ(second->texts().front().level, static_cast<std::uint32_t>(server::RefusalCode::notPermitted));
  EXPECT_LE(second->texts().size(), static_cast<std::size_t>(kKinds * (1 + seconds.count())));
}

// A client that gets control in the middle of its batch does not get the rest of it.
TEST_F(ControlTest, ABatchIsTakenOrRefusedAsAWhole) {
  serveFirst();
  auto first = peer();
  const auto second = peer();
  hold(*first, 0, 0, 0);
  first->send(wire::SetObjectNumber{1});
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  second->send(wire::BatchBegin{});
  ASSERT_TRUE(second->untilText("Batch_Begin refused: client"));
  EXPECT_EQ(second->texts().back().text.text.find("Batch_Begin"), 0U);  // without the "hapticd " of the wire
  EXPECT_EQ(second->texts().back().level, static_cast<std::uint32_t>(server::RefusalCode::notPermitted));
  first->send(wire::ReleaseControl{});
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  second->send(kUp);
  ASSERT_TRUE(second->untilText("Force_Field refused with its batch: client"));
  EXPECT_EQ(second->texts().back().level, static_cast<std::uint32_t>(server::RefusalCode::batchRefused));
  second->send(wire::BatchCommit{});
  ASSERT_TRUE(second->untilText("Batch_Commit refused with its batch: client"));
  EXPECT_EQ(second->texts().back().level, static_cast<std::uint32_t>(server::RefusalCode::batchRefused));
  // The next one is its own, and keeps control until its commit.
  second->send(wire::BatchBegin{});
  second->send(kUp);
  second->send(wire::ReleaseControl{});
  ASSERT_TRUE(second->untilText("Release_Control refused: a batch is open"));
  second->send(wire::BatchCommit{});
  EXPECT_TRUE(untilForce(*first, 1));
  second->send(wire::ReleaseControl{});
  second->send(wire::Ping{});
  ASSERT_TRUE(second->untilNext<wire::Pong>());
  first->send(wire::ForceField{});
  EXPECT_TRUE(untilForce(*first, 0));
}

// A program that sends one batch after the other learns of each what became of it, and not only of the first
// one in a second.
TEST_F(ControlTest, EachRefusedBatchIsToldAtItsCommitButNoStreamOfThem) {
  serveFirst();
  auto first = peer();
  const auto second = peer();
  first->send(wire::SetObjectNumber{1});
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  const auto commits = [&] {
    return std::count_if(second->texts().begin(), second->texts().end(), [](const wire::Text& text) {
      return text.text.text.find("Batch_Commit refused") != std::string::npos;
    });
  };
  const auto send = [&](int batches) {
    for (int i = 0; i < batches; ++i) {
      second->send(wire::BatchBegin{});
      second->send(kUp);
      second->send(wire::BatchCommit{});
    }
    second->send(wire::Ping{});
    return second->untilNext<wire::Pong>();
  };
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(send(3));
  EXPECT_EQ(commits(), 3);
  ASSERT_TRUE(send(200));
  const auto seconds =
      std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now() - begin);
  EXPECT_LE(commits(), 20 * (1 + seconds.count()));
}

TEST_F(ControlTest, OnlyASceneCommandTakesControl) {
  serveFirst();
  const auto first = peer();
  const auto second = peer();
  first->send(wire::TrackerResetOrigin{});
  hold(*first, 0, 0, 0);
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  second->send(kUp);
  EXPECT_TRUE(second->until([&] { return lastForce(*second) > 0.5; }));
  hold(*first, 10, 0, 0);
  EXPECT_TRUE(first->untilText("is in control"));
}

TEST_F(ControlTest, WhoGivesUpControlLetsGoOfTheHand) {
  serveFirst();
  const auto first = peer();
  const auto second = peer();
  second->send(wire::Subscribe{.kinds = wire::kReportHip, .rate = 0});
  const auto isAt = [&](double x_m) {
    const auto pose = second->last<wire::TrackerPosQuat>(
        [](const wire::TrackerPosQuat& m) { return m.sensor == server::kSensorHip; });
    return pose && std::abs(pose->position[0] - x_m) < 0.0015;
  };
  first->send(wire::SetObjectNumber{2});
  hold(*first, 30, 0, 0);
  ASSERT_TRUE(second->until([&] { return isAt(0.03); }));
  first->send(wire::ReleaseControl{});
  first->send(wire::Ping{});
  ASSERT_TRUE(first->untilNext<wire::Pong>());
  second->send(wire::SetObjectNumber{3});
  hold(*second, -20, 0, 0);
  EXPECT_TRUE(second->until([&] { return isAt(-0.02); }));
  EXPECT_TRUE(second->texts().empty());
}

TEST_F(ControlTest, TheHolderAlwaysMayLetGoOfTheHand) {
  serveFirst();
  const auto holder = peer();
  const auto owner = peer();
  hold(*holder, 0, 0, 0);
  holder->send(wire::Ping{});
  ASSERT_TRUE(holder->untilNext<wire::Pong>());
  owner->send(wire::SetObjectNumber{3});
  hold(*owner, 10, 0, 0);
  ASSERT_TRUE(owner->untilText("holds the hand"));
  hold(*holder, 20, 0, 0);
  ASSERT_TRUE(holder->untilText("is in control"));
  holder->forget();
  holder->send(wire::HoldHand{});
  holder->send(wire::Ping{});
  ASSERT_TRUE(holder->untilNext<wire::Pong>());
  EXPECT_TRUE(holder->texts().empty()) << "refused";
  owner->forget();
  hold(*owner, 10, 0, 0);
  owner->send(wire::Ping{});
  ASSERT_TRUE(owner->untilNext<wire::Pong>());
  EXPECT_TRUE(owner->texts().empty()) << "the hand is free";
}

TEST_F(ControlTest, DevicesOfOneSceneShareItsControl) {
  Config config = RunningServer::anyPort();
  config.devices.resize(2);
  config.devices[0].names = {"Left"};
  config.devices[1].names = {"Right"};
  for (auto& device : config.devices) {
    device.scene = "table";
    device.control = server::Control::first;
  }
  serve(config);
  const auto left = peer("Left");
  const auto right = peer("Right");
  left->send(wire::SetObjectNumber{2});
  left->send(wire::Ping{});
  ASSERT_TRUE(left->untilNext<wire::Pong>());
  right->send(kUp);
  EXPECT_TRUE(right->untilText("is in control"));
}

// The frames of a message, as the client would send them by datagram.
template <wire::WireMessage M>
std::vector<std::byte> datagramOf(ScriptedPeer& peer, const M& message, wire::Time time = {1, 2}) {
  std::vector<std::byte> bytes;
  peer.endpoint().send(time, peer.device(), wire::Message(message), wire::Reliability::kLowLatency);
  peer.endpoint().takeDatagrams(
      [&](wire::ByteView datagram) { bytes.assign(datagram.begin(), datagram.end()); });
  return bytes;
}

class DatagramTest : public ControlTest {
 protected:
  void SetUp() override {
    serve();
    client_ = std::make_unique<ScriptedPeer>(server_->address(), "Phantom", ScriptedPeer::Mode::udp);
    ASSERT_TRUE(client_->until([&] { return client_->datagrams() > 0 && client_->udpPeer().port != 0; }));
    hold(*client_, 0, 0, 0);
  }
  // Whether the server has handled all datagrams and messages before; both sockets of the client are local.
  void settle() {
    for (int i = 0; i < 20; ++i) {
      client_->send(wire::Ping{});
      ASSERT_TRUE(client_->untilNext<wire::Pong>());
    }
  }
  std::unique_ptr<ScriptedPeer> client_;
};

TEST_F(DatagramTest, CountFromTheSourceOfTheFirstOneOnly) {
  net::Loop loop;
  net::UdpSocket stranger(loop, {net::kLoopbackAddress, 0});
  // What counts for nothing does not make a source.
  stranger.sendTo(datagramOf(*client_, wire::StopForces{}), client_->udpPeer());
  stranger.sendTo(std::vector<std::byte>(50), client_->udpPeer());
  settle();
  client_->sendDatagram(datagramOf(*client_, kUp));
  ASSERT_TRUE(untilForce(*client_, 1));
  stranger.sendTo(datagramOf(*client_, wire::ForceField{}), client_->udpPeer());
  settle();
  ASSERT_TRUE(untilTicks(*client_, 100));
  // After a late tick the force is on its ramp again.
  EXPECT_TRUE(untilForce(*client_, 1)) << "the stranger ended it";
  EXPECT_EQ(lastGuard(*client_).stopped, 0);
}

TEST_F(DatagramTest, DoNotOutliveTheResetThatOvertookThem) {
  const auto sendAt = [&](wire::Time time, const auto& message) {
    client_->endpoint().send(time, client_->device(), wire::Message(message), wire::Reliability::kReliable);
    settle();
  };
  client_->sendDatagram(datagramOf(*client_, kUp, {100, 0}));
  ASSERT_TRUE(untilForce(*client_, 1));
  sendAt({100, 500'000}, wire::ResetScene{});
  client_->sendDatagram(datagramOf(*client_, kUp, {100, 400'000}));
  settle();
  ASSERT_TRUE(untilTicks(*client_, 100));
  EXPECT_TRUE(untilForce(*client_, 0));
  // A clock that was set back a minute.
  client_->sendDatagram(datagramOf(*client_, kUp, {40, 0}));
  EXPECT_TRUE(untilForce(*client_, 1));
}

TEST_F(DatagramTest, CarryOnlyWhatStockClientsSendSo) {
  client_->sendDatagram(datagramOf(*client_, kUp));
  ASSERT_TRUE(untilForce(*client_, 1));
  client_->sendDatagram(datagramOf(*client_, wire::StopForces{}));
  client_->sendDatagram(datagramOf(*client_, wire::ResetScene{}));
  client_->sendDatagram(datagramOf(*client_, wire::HoldHand{.hold = 1, .position = {30, 0, 0}}));
  client_->sendDatagram(datagramOf(*client_, wire::SetObjectNumber{9}));
  for (int i = 1; i < 30; ++i) {
    client_->sendDatagram(datagramOf(*client_, wire::HeldForce{i, {0, -3, 0}, {}, 0.1}));
    client_->sendDatagram(datagramOf(*client_, wire::HeldForce{i, {0, -3, 0}, {}, 0.1}));
  }
  settle();
  ASSERT_TRUE(untilTicks(*client_, 100));
  EXPECT_TRUE(untilForce(*client_, 1));
  for (const wire::Force& force : client_->all<wire::Force>()) ASSERT_GT(force.force[1], -0.1) << "held";
  client_->send(wire::StopForces{});
  ASSERT_TRUE(client_->until([&] { return lastGuard(*client_).stopped == 1; }));
  client_->sendDatagram(datagramOf(*client_, wire::RearmForces{}));
  settle();
  EXPECT_EQ(lastGuard(*client_).stopped, 1);
}

// Roles by token, over TCP.
class RolesTest : public ControlTest {
 protected:
  void SetUp() override {
    std::ofstream(file_) << "owner " << kOwner << "\noperator " << kOperator << "\n";
    std::filesystem::permissions(file_, std::filesystem::perms::owner_read);
    Config config = RunningServer::anyPort();
    config.tokens = file_;
    serve(config);
  }
  void TearDown() override { std::filesystem::remove(file_); }
  void present(ScriptedPeer& client, const char* token) {
    client.send(wire::Identify{.token = token, .key = 0});
  }

  static constexpr const char* kOwner = "0123456789abcdef-owner";
  static constexpr const char* kOperator = "0123456789abcdef-operator";
  const std::string file_ = std::filesystem::path(testing::TempDir()) / ("roles-" + std::to_string(getpid()));
};

TEST_F(RolesTest, AnObserverReadsAndStopsOnly) {
  const auto observer = peer();
  const auto owner = peer();
  present(*owner, kOwner);
  hold(*owner, 0, 0, 0);
  owner->send(kUp);
  ASSERT_TRUE(untilForce(*observer, 1));
  observer->send(wire::SetObjectNumber{3});
  ASSERT_TRUE(observer->untilText("your role is observer"));
  hold(*observer, 0, 0, 0);
  ASSERT_TRUE(observer->untilText("Hold_Hand refused"));
  observer->send(wire::StopForces{});
  EXPECT_TRUE(untilForce(*owner, 0, 1e-9));
}

TEST_F(RolesTest, AnOperatorRearmsAndHoldsButLeavesTheSceneAlone) {
  const auto observer = peer();
  const auto person = peer();
  present(*person, kOperator);
  hold(*person, 0, 0, 0);
  person->send(kUp);
  ASSERT_TRUE(person->untilText("your role is operator"));
  observer->send(wire::StopForces{});
  ASSERT_TRUE(person->until([&] { return lastGuard(*person).stopped == 1; }));
  person->send(wire::RearmForces{});
  ASSERT_TRUE(person->until([&] { return lastGuard(*person).stopped == 0; })) << "of another's stop";
  for (const wire::Text& text : person->texts())
    EXPECT_EQ(text.text.text.find("Hold_Hand"), std::string::npos);
}

TEST_F(RolesTest, TenWrongTokensBlockTheAddress) {
  const auto guesser = peer();
  for (int i = 0; i < 10; ++i) present(*guesser, "0123456789abcdef-guess");
  ASSERT_TRUE(guesser->untilText("wrong token"));
  present(*guesser, kOwner);
  ASSERT_TRUE(guesser->untilText("too many wrong tokens"));
  EXPECT_EQ(guesser->texts().back().level, static_cast<std::uint32_t>(server::RefusalCode::tokenRefused));
  guesser->send(wire::StopForces{});
  EXPECT_TRUE(guesser->until([&] { return lastGuard(*guesser).stopped == 1; })) << "a stop needs no role";
}

// The kernel names the user of a Unix socket: that of the server re-arms whoever stopped, also one that left.
TEST_F(ControlTest, TheServersUserRearmsOverTheUnixSocket) {
  Config config = RunningServer::anyPort();
  config.socket =
      std::filesystem::path(testing::TempDir()) / ("hapticd-" + std::to_string(getpid()) + ".sock");
  serve(config);
  const auto watcher = peer();
  {
    const auto stopper = peer();
    stopper->send(wire::StopForces{});
    ASSERT_TRUE(watcher->until([&] { return lastGuard(*watcher).stopped == 1; }));
  }
  ASSERT_TRUE(watcher->until([&] {
    watcher->send(wire::RearmForces{});
    for (const wire::Text& text : watcher->texts()) {
      if (text.text.text.find("and is gone") != std::string::npos) return true;
    }
    return false;
  }));
  Client person("Phantom@unix:" + config.socket);
  person.rearmForces();
  EXPECT_TRUE(watcher->until([&] {
    person.poll(0ms);
    return lastGuard(*watcher).stopped == 0;
  }));
  server_.reset();
  EXPECT_FALSE(std::filesystem::exists(config.socket));
}

TEST_F(ControlTest, OnlyListedAddressesCommand) {
  Config config = RunningServer::anyPort();
  config.devices[0].control = server::Control::list;
  config.devices[0].controlList = {"10.1.2.3"};
  serve(config);
  const auto stranger = peer();
  for (int i = 0; i < 100; ++i) stranger->send(wire::SetVertex{0, i, {}});
  ASSERT_TRUE(stranger->untilText("control_list"));
  server_.reset();
  config.devices[0].controlList = {"127.0.0.1"};
  serve(config);
  const auto known = peer();
  known->send(kUp);
  EXPECT_TRUE(known->until([&] { return lastForce(*known) > 0.5; }));
}

TEST_F(ControlTest, ABatchActsInOneTickOrNotAtAll) {
  serve();
  const auto watcher = peer();
  auto client = peer();
  hold(*watcher, 0, 0, 0);
  watcher->send(wire::Subscribe{.kinds = wire::kReportDefault | wire::kReportTick, .rate = 0});
  ASSERT_TRUE(watcher->until([&] { return watcher->count<wire::TickReport>() > 0; }));
  const auto revision = watcher->all<wire::TickReport>().back().revision;

  client->send(wire::BatchBegin{});
  client->send(kUp);
  client->send(wire::Ping{});
  ASSERT_TRUE(client->untilNext<wire::Pong>());
  client->close();
  client.reset();
  const auto later = watcher->count<wire::TickReport>() + 100;
  ASSERT_TRUE(watcher->until([&] { return watcher->count<wire::TickReport>() > later; }));
  EXPECT_EQ(lastForce(*watcher), 0);

  watcher->send(wire::BatchBegin{});
  watcher->send(wire::SetObjectNumber{3});
  watcher->send(kUp);
  watcher->send(wire::BatchCommit{});
  ASSERT_TRUE(untilForce(*watcher, 1));
  EXPECT_GT(watcher->all<wire::TickReport>().back().revision, revision);
  watcher->send(wire::BatchCommit{});
  EXPECT_TRUE(watcher->untilText("no batch was begun"));
}

// It would act before the commands that its client sent first.
TEST_F(ControlTest, ARearmInAnOpenBatchIsRefused) {
  serve();
  const auto client = peer();
  hold(*client, 0, 0, 0);
  client->send(wire::StopForces{});
  ASSERT_TRUE(client->until([&] { return lastGuard(*client).stopped == 1; }));
  client->send(wire::BatchBegin{});
  client->send(kUp);
  client->send(wire::RearmForces{});
  ASSERT_TRUE(client->untilText("Rearm_Forces refused: a batch is open; commit it first"));
  EXPECT_EQ(client->texts().back().severity, wire::kTextError);
  ASSERT_TRUE(untilTicks(*client, 50));
  EXPECT_EQ(lastGuard(*client).stopped, 1);
  client->send(wire::BatchCommit{});
  client->send(wire::RearmForces{});
  EXPECT_TRUE(untilForce(*client, 1));
}

// The force ramps in after a reset, but only if there is one.
TEST_F(ControlTest, AResetInABatchActsWithItsCommit) {
  serve();
  const auto watcher = peer();
  hold(*watcher, 0, 0, 0);
  watcher->send(wire::Subscribe{.kinds = wire::kReportDefault | wire::kReportTick, .rate = 0});
  watcher->send(kUp);
  const auto untilFull = [&] {
    return watcher->until([&] {
      const auto tick = watcher->last<wire::TickReport>();
      return tick && std::abs(tick->force[1] - 1) < 1e-9;
    });
  };
  // Forgets the past, calls, and says whether the force was full in all of the next ticks.
  const auto staysFull = [&](const std::function<void()>& call) {
    EXPECT_TRUE(untilFull());
    watcher->forget();
    call();
    EXPECT_TRUE(watcher->until([&] { return watcher->count<wire::TickReport>() > 200; }));
    return std::ranges::all_of(watcher->all<wire::TickReport>(),
                               [](const auto& tick) { return std::abs(tick.force[1] - 1) < 1e-9; });
  };
  const auto withoutCommit = [&] {
    const auto client = peer();
    client->send(wire::BatchBegin{});
    client->send(wire::ResetScene{});
    client->send(wire::Ping{});
    EXPECT_TRUE(client->untilNext<wire::Pong>());
  };
  // On a busy machine a late tick ramps the force, too.
  bool stays = false;
  for (int i = 0; i < 10 && !stays; ++i) stays = staysFull(withoutCommit);
  EXPECT_TRUE(stays);
  EXPECT_FALSE(staysFull([&] {
    watcher->send(wire::BatchBegin{});
    watcher->send(wire::ResetScene{});
    watcher->send(kUp);
    watcher->send(wire::BatchCommit{});
  }));
  EXPECT_TRUE(untilFull());
}

TEST_F(ControlTest, ABulkMeshIsRenderedInItsOwnUnit) {
  serve();
  const auto client = peer();
  // A floor at y = 0, 200 mm wide, in two triangles.
  client->send(wire::MeshVertices{0, 0, {{-100, 0, -100, 100, 0, -100, 100, 0, 100, -100, 0, 100}}});
  client->send(wire::MeshTriangles{0, 0, {{0, 2, 1, 0, 3, 2}}});
  hold(*client, 0, 10, 0);
  ASSERT_TRUE(client->until([&] {
    const auto poses = client->all<wire::TrackerPosQuat>();
    return !poses.empty() && poses.back().position[1] > 0.009;
  }));
  client->send(wire::SetHapticProperty{0, "stiffness", 1.0F});
  hold(*client, 0, -5, 0);
  ASSERT_TRUE(client->until([&] {
    const auto depths = client->all<wire::Dop>();
    return !depths.empty() && depths.back().depth > 0.0005;
  }));
  EXPECT_TRUE(client->until([&] {
    const auto forces = client->all<wire::Force>();
    return !forces.empty() && forces.back().force[1] > 0.5;
  }));
}

TEST_F(ControlTest, DevicesOfOneSceneShareItsObjects) {
  Config config = RunningServer::anyPort();
  config.devices.resize(3);
  config.devices[0].names = {"Left"};
  config.devices[1].names = {"Right"};
  config.devices[2].names = {"Apart"};
  config.devices[0].scene = config.devices[1].scene = "table";
  serve(config);
  const auto left = peer("Left");
  const auto right = peer("Right");
  const auto apart = peer("Apart");
  left->send(kUp);
  EXPECT_TRUE(left->until([&] { return lastForce(*left) > 0.5; }));
  EXPECT_TRUE(right->until([&] { return lastForce(*right) > 0.5; }));
  EXPECT_EQ(lastForce(*apart), 0);
  right->send(wire::StopEffect{77});
  EXPECT_TRUE(right->untilText("77"));
  std::size_t texts = 0;
  for (const auto& text : right->all<wire::Text>())
    texts += text.text.text.find("77") != std::string::npos ? 1 : 0;
  EXPECT_EQ(texts, 1U);
}

TEST_F(ControlTest, AMalformedMeshMessageEndsTheConnection) {
  serve();
  const auto client = peer();
  client->send(wire::MeshVertices{0, 0, {{1, 2}}});
  EXPECT_TRUE(client->until([&] { return !client->open(); }));
}

}  // namespace
}  // namespace hapticd::test
