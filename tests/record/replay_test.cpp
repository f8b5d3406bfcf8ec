// A replay over the network: clients receive the recorded reports and cannot change the scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <map>

#include "record/recorded_file.h"
#include "server/time_line.h"

namespace hapticd::test {
namespace {

constexpr base::Nanos kSecond = 1'000'000'000;

void startWithPhantom(record::Recorder& recorder) {
  record::RecordedDevice device;
  device.names = {"Phantom"};
  recorder.addDevice(device);
  recorder.start(0, server::toToml(server::ServerConfig{}));
}

class Replay : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    file_ = std::make_unique<RecordingFile>();
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, file_->path()));
    played_ = playSession(server);
  }
  static void TearDownTestSuite() { file_.reset(); }
  void SetUp() override {
    ASSERT_TRUE(played_);
    for (const record::RecordingEvent& event : eventsOf(file_->path())) {
      const auto* tick = std::get_if<record::TickEvent>(&event);
      if (tick != nullptr && tick->device == 0) ticks_[tick->tick.report.tick] = tick->tick.report;
    }
    auto player = std::make_unique<server::Player>(
        server::ReplayOptions{.file = file_->path(), .speed = 2, .loop = true});
    server::ServerConfig config = player->config();
    config.port = 0;
    server_ = std::make_unique<server::Server>(config, std::move(player));
    thread_ = std::thread([this] { server_->run(); });
  }
  void TearDown() override {
    if (!server_) return;
    server_->stop();
    thread_.join();
  }

  static std::unique_ptr<RecordingFile> file_;
  static bool played_;
  std::map<std::uint64_t, realtime::TickReport> ticks_;
  std::unique_ptr<server::Server> server_;
  std::thread thread_;
};

std::unique_ptr<RecordingFile> Replay::file_;
bool Replay::played_ = false;

TEST_F(Replay, ClientsReceiveTheRecordedTicks) {
  ScriptedPeer peer(server_->address());
  ASSERT_TRUE(peer.untilConnected());
  peer.send(wire::Subscribe{wire::kReportTick, 1000});
  // All ticks, and some of the second round.
  ASSERT_TRUE(peer.until([&] { return peer.count<wire::TickReport>() > ticks_.size() + 100; }));
  std::uint64_t touching = 0;
  std::int64_t last = 0;
  for (const wire::TickReport& heard : peer.all<wire::TickReport>()) {
    ASSERT_EQ(ticks_.count(heard.tick), 1U) << heard.tick;
    const realtime::TickReport& then = ticks_[heard.tick];
    EXPECT_EQ(heard.revision, then.revision);
    // A millimetre of the world is one of the device, turned by nothing, but where a client set another
    // workspace.
    EXPECT_NEAR(norm(heard.force), then.force_N.norm(), 1e-12);
    EXPECT_EQ(heard.object, then.rendering.touching ? then.rendering.touchedObject : -1);
    EXPECT_GT(heard.time, last) << "time stamps are present and increase";
    last = heard.time;
    touching += heard.object >= 0 ? 1 : 0;
  }
  EXPECT_GT(touching, 50U);
}

// Batches and meshes are offered: a client that sends them is told by the server why it refuses them, which
// its own library cannot know.
TEST_F(Replay, OffersNoHandAndNoStreamsOfContacts) {
  ScriptedPeer peer(server_->address());
  ASSERT_TRUE(peer.untilConnected());
  peer.send(wire::QueryCapabilities{});
  ASSERT_TRUE(peer.untilNext<wire::Capabilities>());
  const std::uint32_t features = peer.last<wire::Capabilities>()->features;
  EXPECT_EQ(features & (wire::kFeatureHoldHand | wire::kFeatureRemoteContacts), 0U);
  EXPECT_NE(features & wire::kFeatureSubscribe, 0U);
  EXPECT_NE(features & wire::kFeatureStop, 0U) << "its refusal says why";
}

TEST(ReplayConfig, NeedsNothingOfTheMachineThatRecorded) {
  server::ServerConfig there;
  there.tokens = "/etc/hapticd/tokens";
  there.tls = "/etc/hapticd/certificate.pem";
  there.tlsKey = "/etc/hapticd/key.pem";
  there.socket = "/run/user/1234/hapticd.socket";
  there.ownerUsers = {"somebody"};
  there.callbackHosts = {"there.example"};
  there.devices.front().hand = "/home/somebody/hand.csv";
  there.devices.front().blackBoxDir = "/var/lib/hapticd";
  there.limits.objects = 5;
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    record::RecordedDevice device;
    device.names = {"Phantom"};
    recorder.addDevice(device);
    recorder.start(0, server::toToml(there));
    recorder.finish();
  }
  server::ServerConfig here;
  here.limits = there.limits;
  EXPECT_EQ(server::toToml(server::Player({.file = file.path()}).config()), server::toToml(here));
}

// A client says which faces can be touched: first at once, then in a batch. A seek from the middle of the
// batch to the beginning must not put what it sends first into that batch.
TEST(ReplayConfig, OfOtherDevicesIsRefused) {
  record::RecordingHeader header;
  header.devices.resize(2);
  try {
    server::recordedConfig(header, "my.haptics");
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_STREQ(
        error.what(),
        "'my.haptics' names 1 devices in its configuration but contains 2; the recording is damaged");
  }
}

TEST(ReplaySeek, ABatchThatIsOpenDoesNotStayOpen) {
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    startWithPhantom(recorder);
    const auto send = [&](base::Nanos at, const scene::SceneCommand& command) {
      recorder.recordCommand(0, 1, at, &command);
    };
    send(1 * kSecond, scene::SetObjectNumber{1});
    send(2 * kSecond, scene::SetTouchableFaces{1});
    send(3 * kSecond, scene::BeginBatch{});
    send(4 * kSecond, scene::SetTouchableFaces{0});
    send(5 * kSecond, scene::CommitBatch{});
    recorder.finish();
  }
  scene::SceneBuilder builder{scene::SceneConfig{}};
  std::shared_ptr<const scene::SceneSnapshot> scene;
  std::vector<scene::Notice> notices;
  std::mutex mutex;
  server::Player player({.file = file.path()});
  player.start({.tick = [](std::uint32_t, const realtime::TickReport&) {},
                .command =
                    [&](std::uint32_t, scene::ClientId client, const scene::SceneCommand* command) {
                      const std::lock_guard lock(mutex);
                      if (command != nullptr) {
                        builder.apply(client, scene::SceneCommand(*command), 0, notices);
                      } else {
                        builder.clientGone(client, 0);
                      }
                    },
                .marker = nullptr,
                .restart =
                    [&] {
                      const std::lock_guard lock(mutex);
                      builder.apply(0, scene::ResetScene{}, 0, notices);
                    },
                .ended = [](const std::string&) {}});
  // Where commands come last, the position is that of the last one before.
  const auto facesAt = [&](double position_s) {
    player.order({.paused = true, .speed = 0, .position_s = position_s});
    while (std::abs(player.status().position_s - std::floor(position_s)) > 0.01)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    const std::lock_guard lock(mutex);
    if (const auto changed = builder.publish(0, notices)) scene = changed;
    return scene ? scene->faces : scene::TouchableFaces::both;
  };
  EXPECT_EQ(facesAt(1.5), scene::TouchableFaces::back);
  EXPECT_EQ(facesAt(3.5), scene::TouchableFaces::back) << "the batch is not yet complete";
  EXPECT_EQ(facesAt(1.6), scene::TouchableFaces::back);
  player.stop();
  EXPECT_TRUE(notices.empty()) << notices.front().text;
}

// Anybody may seek, and each time all commands before the place are applied: they must not fill the memory.
TEST(ReplaySeek, CommandsWaitWhileTheSceneIsBehind) {
  constexpr int kCommands = 100;
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    startWithPhantom(recorder);
    for (int i = 0; i < kCommands; ++i) {
      const scene::SceneCommand command = scene::SetObjectNumber{i};
      recorder.recordCommand(0, 1, 1'000'000 * (i + 1), &command);
    }
    recorder.finish();
  }
  constexpr int kTaken = 10;
  std::atomic<int> taken{0};
  std::atomic<int> asked{0};
  std::atomic<bool> catchesUp{false};
  std::atomic<bool> ended{false};
  server::Player player({.file = file.path()});
  player.start({.tick = [](std::uint32_t, const realtime::TickReport&) {},
                .command = [&](std::uint32_t, scene::ClientId, const scene::SceneCommand*) { ++taken; },
                .behind =
                    [&](std::uint32_t) {
                      if (catchesUp || taken < kTaken) return false;
                      ++asked;
                      return true;
                    },
                .marker = nullptr,
                .restart = [] {},
                .ended = [&](const std::string&) { ended = true; }});
  while (asked < 3 && !ended) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  EXPECT_EQ(taken, kTaken);
  catchesUp = true;
  while (!ended) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  player.stop();
  EXPECT_EQ(taken, kCommands) << "none is lost";
}

TEST(ReplayLoop, ARecordingThatTakesNoTimeIsPlayedOnce) {
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    startWithPhantom(recorder);
    const scene::SceneCommand command = scene::SetObjectNumber{1};
    recorder.recordCommand(0, 1, 7, &command);
    recorder.finish();
  }
  std::atomic<int> passes{0};
  std::atomic<bool> ended{false};
  server::Player player({.file = file.path(), .loop = true});
  player.start({.tick = [](std::uint32_t, const realtime::TickReport&) {},
                .command =
                    [&](std::uint32_t, scene::ClientId, const scene::SceneCommand* command) {
                      if (command != nullptr) ++passes;
                    },
                .marker = nullptr,
                .restart = [] {},
                .ended = [&](const std::string&) { ended = true; }});
  while (!ended && passes < 10) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  player.stop();
  EXPECT_EQ(passes, 1);
}

// As after a disk that stood still for three seconds, while a third device gives no ticks.
TEST(ReplayOrder, TicksOfAllDevicesComeAtTheirTimesHoweverLateTheyWereWritten) {
  constexpr std::uint64_t kTicks = 3000;
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    server::ServerConfig config;
    config.devices.resize(3, config.devices.front());
    for (const char* name : {"A", "B", "C"}) {
      config.devices[static_cast<std::size_t>(*name - 'A')].names = {name};
      record::RecordedDevice device;
      device.names = {name};
      recorder.addDevice(device);
    }
    recorder.start(0, server::toToml(config));
    for (std::uint64_t i = 1; i <= kTicks; ++i) {
      realtime::TickRecord tick;
      tick.report.tick = i;
      tick.report.time = static_cast<base::Nanos>(i) * 1'000'000;
      recorder.ring(0).push(tick);
      recorder.ring(1).push(tick);
    }
    recorder.finish();
  }
  std::vector<std::uint64_t> played;
  std::atomic<bool> ended{false};
  server::Player player({.file = file.path(), .speed = 100});
  player.start({.tick = [&](std::uint32_t, const realtime::TickReport& tick) { played.push_back(tick.tick); },
                .command = [](std::uint32_t, scene::ClientId, const scene::SceneCommand*) {},
                .marker = nullptr,
                .restart = [] {},
                .ended = [&](const std::string&) { ended = true; }});
  while (!ended) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  player.stop();
  EXPECT_EQ(played.size(), 2 * kTicks);
  EXPECT_TRUE(std::is_sorted(played.begin(), played.end()));
}

TEST(ReplayOrder, ASpeedThatChangesDuringThePlayCountsFromThere) {
  constexpr int kTicks = 10;
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    startWithPhantom(recorder);
    for (int i = 1; i <= kTicks; ++i) {
      realtime::TickRecord tick;
      tick.report.time = i * kSecond;
      recorder.ring(0).push(tick);
    }
    recorder.finish();
  }
  std::vector<base::Nanos> times;
  std::atomic<int> played{0};
  server::Player player({.file = file.path()});
  player.start({.tick =
                    [&](std::uint32_t, const realtime::TickReport& tick) {
                      times.push_back(tick.time);
                      ++played;
                    },
                .command = [](std::uint32_t, scene::ClientId, const scene::SceneCommand*) {},
                .marker = nullptr,
                .restart = [] {},
                .ended = [](const std::string&) {}});
  while (played < 1) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  player.order({.paused = false, .speed = 100, .position_s = std::nullopt});
  while (played < kTicks) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  player.stop();
  EXPECT_GT(times[1], times[0]);
  for (std::size_t i = 2; i < times.size(); ++i)
    EXPECT_NEAR(static_cast<double>(times[i] - times[i - 1]), 0.01 * kSecond, 2) << i;
}

// 500 short contacts, 80 ms and 400 ms apart in turn.
TEST(ReplayTimeLine, HasMarkersAndJoinsTheNearestOfManyContacts) {
  const RecordingFile file;
  {
    record::Recorder recorder(file.path(), [](record::RecorderProblem, const std::string&) {});
    startWithPhantom(recorder);
    realtime::TickRecord tick;
    tick.report.time = kSecond;
    for (int contact = 0; contact < 500; ++contact) {
      tick.report.rendering.touching = true;
      recorder.ring(0).push(tick);
      tick.report.time += kSecond / 100;
      tick.report.rendering.touching = false;
      recorder.ring(0).push(tick);
      tick.report.time += (contact % 2 == 0 ? 7 : 39) * kSecond / 100;
    }
    recorder.recordMarker(2 * kSecond, "trial 3");
    recorder.finish();
  }
  const server::TimeLine line = server::readTimeLine(file.path(), false);
  ASSERT_EQ(line.markers.size(), 1U);
  EXPECT_NEAR(line.markers[0].first, 1, 1e-9);
  EXPECT_EQ(line.markers[0].second, "trial 3");
  ASSERT_EQ(line.contacts.size(), 250U);
  for (std::size_t i = 0; i < line.contacts.size(); ++i) {
    EXPECT_NEAR(line.contacts[i].first, 0.48 * static_cast<double>(i), 1e-9);
    EXPECT_NEAR(line.contacts[i].second, 0.48 * static_cast<double>(i) + 0.08, 1e-9);
  }
}

TEST_F(Replay, CommandsAreRefused) {
  ScriptedPeer peer(server_->address());
  ASSERT_TRUE(peer.untilConnected());
  peer.send(wire::ResetScene{});
  EXPECT_TRUE(peer.untilText("refused: this server replays a recording"));
  peer.send(wire::StopForces{});
  EXPECT_TRUE(peer.untilText("Stop_Forces refused: this server replays a recording, which has no force"));
}

TEST_F(Replay, ClientsPauseAndSeek) {
  ScriptedPeer peer(server_->address());
  ASSERT_TRUE(peer.untilConnected());
  peer.send(wire::Subscribe{wire::kReportTick, 1000});
  const base::Nanos first = ticks_.begin()->second.time;
  // The recorded time of the newest tick, in seconds.
  const auto position = [&] {
    const auto tick = peer.last<wire::TickReport>();
    return tick ? base::toSeconds(ticks_[tick->tick].time - first) : -1;
  };
  const auto showsAbout = [&](double wanted) {
    return peer.until([&] { return std::abs(position() - wanted) < 0.1; });
  };
  peer.send(wire::ReplayControl{.paused = 1, .speed = 0, .position = 0.6});
  EXPECT_TRUE(showsAbout(0.6));
  peer.send(wire::ReplayControl{.paused = 1, .speed = 0, .position = 0.2});
  EXPECT_TRUE(showsAbout(0.2)) << "backwards";
  peer.send(wire::ReplayControl{.paused = 1, .speed = 0, .position = 0.8});
  EXPECT_TRUE(showsAbout(0.8)) << "forwards";
  for (const double odd : {std::numeric_limits<double>::quiet_NaN(), -2.0})
    peer.send(wire::ReplayControl{.paused = 0, .speed = odd, .position = -1});
  EXPECT_TRUE(peer.until([&] {
    const auto texts = peer.all<wire::Text>();
    return std::count_if(texts.begin(), texts.end(), [](const wire::Text& text) {
             return text.text.text.find("Replay_Control refused: speed") != std::string::npos;
           }) == 2;
  }));
  const std::uint64_t paused = peer.last<wire::TickReport>()->tick;
  peer.send(wire::ReplayControl{.paused = 0, .speed = 1, .position = -1});
  ASSERT_TRUE(peer.until([&] { return peer.last<wire::TickReport>()->tick > paused + 50; }));
  std::uint64_t last = 0;
  for (const wire::TickReport& tick : peer.all<wire::TickReport>()) {
    if (last == paused && tick.tick > paused) {
      EXPECT_LT(tick.tick, paused + 20) << "it goes on where it paused";
    }
    last = tick.tick;
  }
}

TEST_F(Replay, TheSecondDeviceIsReplayed) {
  ScriptedPeer peer(server_->address(), "Second");
  EXPECT_TRUE(peer.until([&] {
    const auto touched = peer.last<wire::TouchedObject>();
    return touched && touched->object == 0;
  }));
}

}  // namespace
}  // namespace hapticd::test
