// A scene that is behind: which clients are held back, which messages overtake, and the effect on re-arms,
// heartbeats and disconnections. A description request whose reply waits blocks the scene thread for as long
// as a test needs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <latch>

#include "feeling.h"
#include "log_lines.h"
#include "running_server.h"
#include "scripted_peer.h"

namespace hapticd::test {
namespace {

constexpr std::size_t kMiB = 1U << 20;

class HeldBackTest : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = std::make_unique<RunningServer>();
    watcher_ = peer();
  }
  void TearDown() override { openScene(); }

  std::unique_ptr<ScriptedPeer> peer() {
    auto peer = std::make_unique<ScriptedPeer>(server_->address());
    EXPECT_TRUE(peer->until([&] { return peer->count<wire::IsTouching>() > 0; }));
    return peer;
  }
  // Blocks the scene thread until openScene().
  void closeScene() {
    auto entered = std::make_shared<std::latch>(1);
    server_->server().stations().front()->scene().describe([entered, gate = gate_](const auto&) {
      entered->count_down();
      gate->wait();
    });
    entered->wait();
  }
  void openScene() {
    if (!gate_->try_wait()) gate_->count_down();
  }
  // Sends scene commands of about this many bytes.
  void flood(ScriptedPeer& client, std::size_t bytes) {
    constexpr std::size_t kFloats = 15'000;
    const wire::MeshVertices run{0, 0, {std::vector<float>(kFloats)}};
    for (std::size_t sent = 0; sent < bytes; sent += kFloats * sizeof(float)) client.queue(run);
    client.flush();
  }
  bool stopped() {
    const auto state = watcher_->last<wire::GuardState>();
    return state && state->stopped != 0;
  }
  bool untilStopped() {
    return watcher_->until([&] { return stopped(); });
  }
  // Waits until the watcher has seen `ticks` servo ticks, while `client` is served too.
  bool pass(ScriptedPeer& client, std::size_t ticks) {
    const std::size_t end = watcher_->count<wire::IsTouching>() + ticks;
    return watcher_->until(
        [&] {
          client.poll();
          return watcher_->count<wire::IsTouching>() > end;
        },
        60s);
  }

  LogLines lines_;
  std::shared_ptr<std::latch> gate_ = std::make_shared<std::latch>(1);
  std::unique_ptr<RunningServer> server_;
  std::unique_ptr<ScriptedPeer> watcher_;
};

TEST_F(HeldBackTest, StopPingAndReportsOfOtherClientsDoNotWait) {
  const auto uploader = peer();
  closeScene();
  flood(*uploader, 40 * kMiB);
  uploader->send(wire::QueryCapabilities{});
  ASSERT_TRUE(pass(*uploader, 100));
  watcher_->send(wire::Ping{});
  ASSERT_TRUE(watcher_->until([&] {
    uploader->poll();
    return watcher_->count<wire::Pong>() > 0;
  }));
  watcher_->send(wire::StopForces{});
  EXPECT_TRUE(untilStopped());
  EXPECT_EQ(uploader->count<wire::Capabilities>(), 0U) << "the upload ended before the stop";
  openScene();
  EXPECT_TRUE(uploader->until([&] { return uploader->count<wire::Capabilities>() > 0; }, 60s));
}

TEST_F(HeldBackTest, StopHeartbeatAndPingOvertakeTheClientsSceneCommands) {
  const auto client = peer();
  closeScene();
  flood(*client, 10 * kMiB);  // the queue takes 8 MiB, the backlog the rest
  client->queue(wire::QueryCapabilities{});
  client->queue(wire::Ping{});
  client->send(wire::StopForces{});
  EXPECT_TRUE(watcher_->until([&] {
    client->poll();
    return stopped();
  }));
  EXPECT_TRUE(client->until([&] { return client->count<wire::Pong>() > 0; }));
  EXPECT_EQ(client->count<wire::Capabilities>(), 0U) << "a query is not reordered";
  openScene();
  EXPECT_TRUE(client->until([&] { return client->count<wire::Capabilities>() > 0; }));
}

TEST_F(HeldBackTest, StreamedStateOvertakesTheClientsSceneCommands) {
  const auto client = peer();
  watcher_->send(wire::Subscribe{.kinds = wire::kReportHand | wire::kReportForce, .rate = 0});
  closeScene();
  flood(*client, 10 * kMiB);
  client->send(wire::QueryCapabilities{});
  EXPECT_TRUE(watcher_->until([&] {
    client->send(wire::HeldForce{.time = 0, .force = {0, 0.5, 0}, .torque = {}, .lifetime = 0.1});
    client->poll();
    const auto hand = watcher_->last<wire::HandState>();
    return hand && hand->heldForce[1] > 0.3;
  }));
  EXPECT_EQ(client->count<wire::Capabilities>(), 0U);
  openScene();
  EXPECT_TRUE(client->until([&] { return client->count<wire::Capabilities>() > 0; }));
}

TEST_F(HeldBackTest, ARearmSentBeforeAStopDoesNotUndoIt) {
  const auto client = peer();
  closeScene();
  flood(*client, 10 * kMiB);
  client->queue(wire::RearmForces{});
  client->send(wire::StopForces{});
  ASSERT_TRUE(watcher_->until([&] {
    client->poll();
    return stopped();
  }));
  openScene();
  EXPECT_TRUE(client->untilText("Rearm_Forces ignored"));
  ASSERT_TRUE(pass(*client, 50));
  EXPECT_TRUE(stopped());
}

TEST_F(HeldBackTest, ARearmDoesNotUndoALaterStopOfAnotherClient) {
  const auto client = peer();
  watcher_->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  closeScene();
  client->queue(wire::SetObjectNumber{2});
  client->queue(wire::RearmForces{});
  client->send(wire::Ping{});
  ASSERT_TRUE(client->until([&] { return client->count<wire::Pong>() > 0; }));
  watcher_->send(wire::StopForces{});
  watcher_->send(wire::Ping{});
  ASSERT_TRUE(watcher_->until([&] { return watcher_->count<wire::Pong>() > 0; }));
  openScene();
  EXPECT_TRUE(client->untilText("Rearm_Forces ignored"));
  EXPECT_TRUE(stopped());
}

TEST_F(HeldBackTest, ARearmActsWhenTheCommandsBeforeItArePublished) {
  const auto client = peer();
  client->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  closeScene();
  client->queue(wire::SetObjectNumber{2});
  client->send(wire::RearmForces{});
  ASSERT_TRUE(pass(*client, 50));
  EXPECT_TRUE(stopped());
  openScene();
  EXPECT_TRUE(watcher_->until([&] { return !stopped(); }));
}

// Nobody who asked for forces is there any more; nor may the re-arm vanish without a word.
TEST_F(HeldBackTest, ARearmOfAClientThatLeftMeanwhileIsRefusedAloud) {
  auto client = peer();
  client->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  closeScene();
  client->queue(wire::SetObjectNumber{2});
  client->send(wire::RearmForces{});
  ASSERT_TRUE(client->until([&] { return client->delivered(); }));
  client->end();
  EXPECT_TRUE(watcher_->untilText("before its scene commands were in place"));
  openScene();
  ASSERT_TRUE(untilTicks(*watcher_, 100));
  EXPECT_TRUE(stopped());
  EXPECT_EQ(lines_.count("does not re-arm 'Phantom'"), 1U) << lines_.text();
}

TEST_F(HeldBackTest, ARearmThatIsReadAfterItsClientLeftIsRefusedAloud) {
  auto client = peer();
  client->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  closeScene();
  flood(*client, 11 * kMiB);  // the queue takes 8 MiB, the backlog the rest
  client->send(wire::RearmForces{});
  ASSERT_TRUE(client->until([&] { return client->delivered(); }, 60s));
  client->end();
  ASSERT_TRUE(pass(*client, 100));
  openScene();
  EXPECT_TRUE(watcher_->untilText("before its scene commands were in place"));
  ASSERT_TRUE(untilTicks(*watcher_, 100));
  EXPECT_TRUE(stopped());
}

// The server ends it itself: what the session held back is not read any more, but the re-arm in it is
// reported.
TEST_F(HeldBackTest, ARearmThatIsHeldBackWhenTheServerEndsItsClientIsRefusedAloud) {
  auto client = peer();
  client->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  closeScene();
  flood(*client, 11 * kMiB);  // the queue takes 8 MiB, the session holds the rest
  client->send(wire::RearmForces{});
  client->sendPayload(wire::kindOf<wire::Heartbeat>, {});  // overtakes, and is malformed
  EXPECT_TRUE(watcher_->until(
      [&] {
        client->poll();
        return lines_.count("does not re-arm 'Phantom'") == 1;
      },
      60s));
  EXPECT_TRUE(watcher_->untilText("before its scene commands were in place"));
  openScene();
  ASSERT_TRUE(untilTicks(*watcher_, 100));
  EXPECT_TRUE(stopped());
}

TEST_F(HeldBackTest, ARearmThatArrivesWhileTheServerEndsItsClientIsRefusedAloud) {
  auto client = peer();
  client->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  client->endpoint().sendRaw({1, 2}, client->device(), wire::localType(wire::kindOf<wire::Heartbeat>), {},
                             wire::Reliability::kReliable);
  client->send(wire::RearmForces{});
  EXPECT_TRUE(watcher_->untilText("does not re-arm"));
  ASSERT_TRUE(untilTicks(*watcher_, 100));
  EXPECT_TRUE(stopped());
}

// A marker that is not in the recording, and a recording that does not end, are not missed in silence.
TEST_F(HeldBackTest, OrdersThatAreHeldBackWhenTheServerEndsTheirClientAreInTheLog) {
  for (const bool serverEnds : {false, true}) {
    auto client = peer();
    closeScene();
    flood(*client, 11 * kMiB);  // the queue takes 8 MiB, the session holds the rest
    client->queue(wire::Marker{.text = "trial 3"});
    client->queue(wire::Marker{.text = "trial 4"});
    client->queue(wire::RecordingControl{.record = 0, .name = {}});
    client->send(wire::Ping{});  // overtakes: the server has read all when it answers
    ASSERT_TRUE(client->untilNext<wire::Pong>());
    if (serverEnds) {
      server_->server().stop();
    } else {
      client->sendPayload(wire::kindOf<wire::Heartbeat>, {});  // overtakes, and is malformed
    }
    const std::size_t lines = serverEnds ? 2 : 1;
    EXPECT_TRUE(watcher_->until(
        [&] {
          client->poll();
          return lines_.count("2 hapticd Marker") == lines &&
                 lines_.count("1 hapticd Recording_Control") == lines;
        },
        60s))
        << lines_.text();
    openScene();
    gate_ = std::make_shared<std::latch>(1);
  }
}

// Where nothing is stopped or latched, nothing is lost.
TEST_F(HeldBackTest, ARearmOfAClientThatLeftIsNoNewsWhereNothingIsStopped) {
  auto client = peer();
  closeScene();
  client->queue(wire::SetObjectNumber{2});
  client->send(wire::RearmForces{});
  ASSERT_TRUE(client->until([&] { return client->delivered(); }));
  client->end();
  ASSERT_TRUE(client->untilClosed());
  ASSERT_TRUE(watcher_->until([&] { return lines_.count("disconnected") == 1; }));
  ASSERT_TRUE(untilTicks(*watcher_, 100));
  EXPECT_TRUE(watcher_->texts().empty());
}

TEST_F(HeldBackTest, ARearmOfAClientWithoutCommandsActsAtOnce) {
  const auto uploader = peer();
  watcher_->send(wire::StopForces{});
  ASSERT_TRUE(untilStopped());
  closeScene();
  flood(*uploader, 10 * kMiB);
  watcher_->send(wire::RearmForces{});
  EXPECT_TRUE(watcher_->until([&] {
    uploader->poll();
    return !stopped();
  }));
}

// Its place is one of the world that the client has commanded before.
TEST_F(HeldBackTest, TheHandIsHeldWhereTheClientsWorkspaceHasIt) {
  const auto client = peer();
  watcher_->send(wire::Subscribe{.kinds = wire::kReportHip, .rate = 0});
  const auto untilAt = [&](double x_m) {
    return watcher_->until([&] {
      const auto pose = watcher_->last<wire::TrackerPosQuat>(
          [](const wire::TrackerPosQuat& m) { return m.sensor == server::kSensorHip; });
      return pose && std::abs(pose->position[0] - x_m) < 0.001;
    });
  };
  const auto commandAndHold = [&](const auto& command, double x_mm) {
    closeScene();
    client->queue(command);
    client->send(wire::HoldHand{.hold = 1, .position = {x_mm, 0, 0}});
    client->send(wire::Ping{});
    ASSERT_TRUE(client->untilNext<wire::Pong>());
    openScene();
    gate_ = std::make_shared<std::latch>(1);
    ASSERT_TRUE(client->until([&] {  // the command is published
      client->send(wire::QueryCapabilities{});
      return client->count<wire::Capabilities>() > 50;
    }));
  };
  commandAndHold(wire::SetHapticOrigin{.position = {0.03F, 0, 0}, .axis = {0, 1, 0}}, 20);
  watcher_->forget();
  EXPECT_TRUE(untilAt(0.02)) << "at -10 mm of the device";
  commandAndHold(wire::ResetScene{}, -15);
  watcher_->forget();
  EXPECT_TRUE(untilAt(-0.015));
}

// A query answers of the world as the client has commanded it before, and not of the last tick.
TEST_F(HeldBackTest, TheWorkspaceIsToldAsTheClientsCommandsHaveIt) {
  const auto client = peer();
  client->send(wire::TrackerRequestWorkspace{});
  ASSERT_TRUE(client->untilNext<wire::TrackerWorkspace>());
  const double before = client->last<wire::TrackerWorkspace>()->max[0];
  closeScene();
  client->queue(wire::SetHapticScale{.scale = 2});
  client->queue(wire::TrackerRequestWorkspace{});
  client->send(wire::Ping{});
  ASSERT_TRUE(client->untilNext<wire::Pong>());
  openScene();
  ASSERT_TRUE(client->until([&] { return client->count<wire::TrackerWorkspace>() == 2; }));
  EXPECT_NEAR(client->last<wire::TrackerWorkspace>()->max[0], 2 * before, 1e-9);
}

// A reset takes the origin away; one that the client sets after it stays.
TEST_F(HeldBackTest, TheOriginIsSetInTheWorldOfTheClientsCommands) {
  const auto client = peer();
  watcher_->send(wire::Subscribe{.kinds = wire::kReportTracker, .rate = 0});
  watcher_->send(wire::HoldHand{.hold = 1, .position = {20, 0, 0}});
  ASSERT_TRUE(watcher_->until([&] {
    const auto pose = watcher_->last<wire::TrackerPosQuat>();
    return pose && std::abs(pose->position[0] - 0.020) < 1e-4;
  }));
  closeScene();
  client->queue(wire::ResetScene{});
  client->queue(wire::SetHapticScale{.scale = 2});
  client->queue(wire::TrackerResetOrigin{});
  client->queue(wire::TrackerRequestToRoom{});
  client->send(wire::Ping{});
  ASSERT_TRUE(client->untilNext<wire::Pong>());
  openScene();
  ASSERT_TRUE(client->until([&] { return client->count<wire::TrackerToRoom>() == 1; }));
  EXPECT_NEAR(client->last<wire::TrackerToRoom>()->position[0], 0.040, 8e-3)
      << "the hand swings in for a while";
}

// The newest order counts, although an older one still waits for the scene.
TEST_F(HeldBackTest, AHandThatIsLetGoOfIsNotTakenByAnEarlierHold) {
  const auto client = peer();
  closeScene();
  client->queue(wire::SetHapticScale{.scale = 2});
  client->queue(wire::HoldHand{.hold = 1, .position = {10, 0, 0}});
  client->queue(wire::HoldHand{});
  client->queue(wire::HoldHand{.hold = 1, .position = {20, 0, 0}});
  client->queue(wire::ReleaseControl{});
  client->send(wire::Ping{});
  ASSERT_TRUE(client->untilNext<wire::Pong>());
  openScene();
  const auto other = peer();
  ASSERT_TRUE(untilTicks(*other, 100));
  other->send(wire::HoldHand{.hold = 1, .position = {0, 0, 0}});
  other->send(wire::Ping{});
  ASSERT_TRUE(other->untilNext<wire::Pong>());
  EXPECT_TRUE(other->texts().empty()) << "the hand is free";
  EXPECT_TRUE(client->texts().empty());
}

TEST_F(HeldBackTest, APauseOfTheServerIsNotSilenceOfTheClient) {
  const auto client = peer();
  closeScene();
  // The queue takes 8 MiB. Soon after the heartbeat the server stops reading.
  flood(*client, 10 * kMiB);
  client->queue(wire::Heartbeat{1});
  flood(*client, 30 * kMiB);
  ASSERT_TRUE(pass(*client, 1500));  // three times the limit
  EXPECT_TRUE(client->open());
  openScene();
  EXPECT_TRUE(client->until([&] { return !client->open(); }, 60s))
      << "silent after the server resumed reading";
}

// The pause excuses it for 5 s. Then its forces end, although its scene is behind, until a heartbeat comes.
TEST_F(HeldBackTest, AClientWithoutAHeartbeatInALongPauseFeelsNothingUntilTheNext) {
  const auto client = peer();
  const auto until = [&](const std::function<bool(double)>& felt) {
    return watcher_->until([&] {
      client->poll();
      const auto force = watcher_->last<wire::Force>();
      return force && felt(norm(force->force));
    });
  };
  client->send(kUp);
  ASSERT_TRUE(until([](double force_N) { return force_N > 0.95; }));
  closeScene();
  flood(*client, 10 * kMiB);
  client->queue(wire::Heartbeat{1});
  flood(*client, 30 * kMiB);
  const std::string line =
      "client 2: no heartbeat came through for 5 s, behind its own data or because the scene is behind; its "
      "forces ramp out";
  EXPECT_TRUE(until([&](double force_N) { return force_N < 0.01 && lines_.count(line) > 0; }))
      << lines_.text();
  EXPECT_TRUE(client->open());
  openScene();
  EXPECT_TRUE(until([&](double force_N) {
    client->queue(wire::Heartbeat{1});
    client->send(kUp);
    return force_N > 0.95;
  })) << lines_.text();
  EXPECT_TRUE(
      client->untilText("Heartbeat: none came through for 5 s, and your forces ramped out; they act again"));
}

// What it streams ends, too. The text is one of a device that it uses: stock clients ignore others.
TEST_F(HeldBackTest, AClientOfTheSecondDeviceFeelsAndHearsOfItsHeartbeats) {
  server::ServerConfig config = RunningServer::anyPort();
  config.devices.push_back(config.devices.front());
  config.devices.back().names = {"Second"};
  const RunningServer server(config);
  ScriptedPeer client(server.address(), "Second");
  const auto untilFelt = [&](const std::function<bool(double)>& felt) {
    return client.until([&] {
      client.send(wire::HeldForce{.time = 0, .force = {0, 1, 0}, .torque = {}, .lifetime = 0.1});
      const auto force = client.last<wire::Force>();
      return force && felt(norm(force->force));
    });
  };
  ASSERT_TRUE(client.until([&] { return client.count<wire::IsTouching>() > 0; }));
  client.send(wire::Heartbeat{1});
  ASSERT_TRUE(untilFelt([](double force_N) { return force_N > 0.95; }));
  EXPECT_TRUE(untilFelt([&](double force_N) {
    return force_N < 0.01 && lines_.text().find("no heartbeat came through for 5 s") != std::string::npos;
  })) << lines_.text();
  const std::size_t ticks = client.count<wire::IsTouching>() + 300;
  EXPECT_TRUE(untilFelt([&](double force_N) {
    EXPECT_LT(force_N, 0.01);
    return client.count<wire::IsTouching>() > ticks;
  }));
  client.send(wire::Heartbeat{1});
  EXPECT_TRUE(client.until([&] {
    const std::vector<wire::Text> texts = client.all<wire::Text>();
    return std::any_of(texts.begin(), texts.end(), [](const wire::Text& text) {
      return text.text.text.ends_with("your forces ramped out; they act again");
    });
  }));
  EXPECT_TRUE(untilFelt([&](double force_N) {
    client.queue(wire::Heartbeat{1});
    return force_N > 0.95;
  }));
}

TEST_F(HeldBackTest, CommandsSentBeforeAClientDisconnectsAreApplied) {
  auto client = peer();
  closeScene();
  client->queue(wire::SetObjectNumber{1});
  flood(*client, 11 * kMiB);
  client->queue(wire::MeshVertices{0, 0, {{0, 0, 0, 9, 0, 0, 0, 9, 0}}});
  client->queue(wire::MeshTriangles{0, 0, {{0, 1, 2}}});
  client->queue(wire::SetHapticProperty{0, "stiffness", 1.0F});
  client->send(wire::SetTouchableFace{0});
  ASSERT_TRUE(client->until([&] { return client->delivered(); }, 60s));
  client->end();
  ASSERT_TRUE(pass(*client, 100));
  client.reset();
  openScene();
  EXPECT_TRUE(watcher_->until([&] {
    std::latch answered(1);
    bool has = false;
    server_->server().stations().front()->scene().describe([&](const auto& description) {
      has = !description->objects.empty() && description->objects[0].triangles &&
            description->objects[0].triangles->size() == 1;
      answered.count_down();
    });
    answered.wait();
    return has;
  }));
}

TEST_F(HeldBackTest, TheForcesOfADisconnectedClientEndBeforeItsQueuedCommands) {
  auto client = peer();
  watcher_->send(wire::HoldHand{.hold = 1, .position = {0, 0, 0}});
  client->send(kUp);
  const auto force = [&] {
    const auto last = watcher_->last<wire::Force>();
    return last ? std::hypot(last->force[0], last->force[1], last->force[2]) : 0.0;
  };
  ASSERT_TRUE(watcher_->until([&] { return force() > 0.9; }));
  closeScene();
  flood(*client, 40 * kMiB);
  ASSERT_TRUE(pass(*client, 100));
  client->close();
  client.reset();
  openScene();
  EXPECT_TRUE(watcher_->until([&] { return force() < 1e-9; }));
}

// Some of what it sent waits in the scene's queue, some in the session, some in the socket.
TEST_F(HeldBackTest, NothingThatADisconnectedClientSentIsFeltLater) {
  auto client = peer();
  watcher_->send(wire::HoldHand{.hold = 1, .position = {0, 0, 0}});
  watcher_->send(wire::Subscribe{.kinds = wire::kReportDefault | wire::kReportTick, .rate = 0});
  const auto sendForces = [&] {
    client->queue(wire::Effect{.type = "constant", .index = 0, .magnitude = 1, .direction = {1, 0, 0}});
    client->queue(wire::StartEffect{0});
    client->queue(kUp);
  };
  closeScene();
  flood(*client, 1 * kMiB);
  sendForces();
  flood(*client, 8 * kMiB);
  sendForces();
  flood(*client, 5 * kMiB);
  client->send(wire::HeldForce{.time = 0, .force = {0, 1, 0}, .torque = {}, .lifetime = 0.1});
  ASSERT_TRUE(client->until([&] { return client->delivered(); }, 60s));
  client->end();
  // The server has noticed it, and so long ago that forces which it had would be over.
  ASSERT_TRUE(watcher_->until([&] {
    client->poll();
    return lines_.count("disconnected while its commands wait for the scene") > 0;
  }));
  watcher_->send(wire::Ping{});
  ASSERT_TRUE(watcher_->untilNext<wire::Pong>());
  constexpr base::Nanos kWhole = scene::ForceOwner::kGrace + scene::ForceOwner::kRampOut;
  const auto untilTick = [&](base::Nanos time) {
    return watcher_->until([&] {
      const auto tick = watcher_->last<wire::TickReport>();
      return tick && tick->time > time;
    });
  };
  ASSERT_TRUE(untilTick(base::now() + kWhole));
  client.reset();
  watcher_->forget();
  openScene();
  ASSERT_TRUE(watcher_->until(
      [&] { return lines_.count(") disconnected: ") > 0 && watcher_->count<wire::TickReport>() > 500; }));
  double most = 0;
  for (const auto& tick : watcher_->all<wire::TickReport>())
    most = std::max(most, std::hypot(tick.force[0], tick.force[1], tick.force[2]));
  EXPECT_LT(most, 1e-9);
}

}  // namespace
}  // namespace hapticd::test
