// Re-rendering a recording gives the recorded forces bit for bit.
#include <gtest/gtest.h>

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "base/clock.h"
#include "device/device.h"
#include "realtime/servo/tick.h"
#include "record/compared.h"
#include "record/recorded_file.h"
#include "record/recording_file.h"
#include "record/recording_reader.h"
#include "record/rerender.h"
#include "record/scene_event_codec.h"
#include "record/tick_codec.h"
#include "scene/commands.h"

namespace hapticd::test {
namespace {

using record::RerenderChanges;

class Rerender : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    file_ = std::make_unique<RecordingFile>();
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, file_->path()));
    played_ = playSession(server);
  }
  static void TearDownTestSuite() { file_.reset(); }
  void SetUp() override { ASSERT_TRUE(played_) << "the session did not go as scripted"; }

  static std::unique_ptr<RecordingFile> file_;
  static bool played_;
};

std::unique_ptr<RecordingFile> Rerender::file_;
bool Rerender::played_ = false;

TEST_F(Rerender, GivesTheRecordedForcesBitForBit) {
  const auto devices = rerender(file_->path());
  ASSERT_EQ(devices.size(), 2U);
  for (const Compared& device : devices) {
    EXPECT_EQ(device.same, device.ticks) << device.firstDifference;
    EXPECT_EQ(device.skipped, 0U);
    EXPECT_EQ(device.largest_N, 0);
    EXPECT_GT(device.touching, 100U);
    EXPECT_GT(device.revisions.size(), 10U);
  }
  EXPECT_GT(devices[0].stopped, 10U);
}

// Stands still, and takes every force.
class Table final : public device::Device {
 public:
  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(base::Nanos /*now*/, device::DeviceState& /*state*/) noexcept override { return true; }
  bool write(const geometry::Vec3& /*force_N*/) noexcept override { return true; }

 private:
  const device::DeviceProfile profile_;
};

TEST(RerenderOfADevice, ThatEndsForcesByItselfGivesWhatTheGuardDid) {
  constexpr base::Nanos kMs = 1'000'000;
  record::RecordedDevice device{.names = {"table"}, .driver = {}, .model = {}, .sceneConfig = {}, .tick = {}};
  device.tick.guard.armed = true;
  device.tick.forceLife = 3 * kMs;
  Table table;
  base::SimulatedClock clock;
  realtime::Tick tick(table, clock, device.tick);
  realtime::RecordRing ring(1024);
  tick.recordTo({.ticks = &ring});
  for (int i = 0; i < 1000; ++i) {
    const bool pause = i == 600 || i == 990;
    clock.sleepUntil(clock.now() + (pause ? 4 * kMs : kMs));
    tick(clock.now());
  }
  record::Rerenderer again({.program = {}, .config = {}, .devices = {device}, .law = {}}, {});
  int expired = 0;
  int same = 0;
  ring.consume([&](const realtime::TickRecord& recorded) {
    record::Bytes bytes;
    record::TickPacker().add(recorded, bytes);
    record::TickEvent event;
    record::TickUnpacker(bytes).next(event.tick);
    expired += event.tick.expired ? 1 : 0;
    const realtime::TickReport* now = again.feed(event);
    same += record::sameOutcome(*now, recorded.report) ? 1 : 0;
  });
  EXPECT_EQ(expired, 2);
  EXPECT_EQ(same, 1000);
  EXPECT_LT(tick.last().guard.gain, 0.1) << "after the pause";
}

TEST_F(Rerender, IsTheSameEveryTime) {
  const RerenderChanges softer{.stiffness_N_per_m = 200};
  const auto once = rerender(file_->path(), softer);
  const auto twice = rerender(file_->path(), softer);
  for (std::size_t i = 0; i < once.size(); ++i) EXPECT_EQ(once[i].largest_N, twice[i].largest_N);
}

TEST_F(Rerender, ChangesChangeForces) {
  for (const RerenderChanges& changes :
       {RerenderChanges{.stiffness_N_per_m = 100}, RerenderChanges{.toolRadius_m = 0.004},
        RerenderChanges{.staticFriction = 0, .dynamicFriction = 0}, RerenderChanges{.raw = true}}) {
    const auto devices = rerender(file_->path(), changes);
    EXPECT_LT(devices[0].same, devices[0].ticks);
    if (!changes.raw) {
      EXPECT_GT(devices[0].largestRendered_N, 0.01);
    }
    // Free of contact nothing changes but without the guard.
    EXPECT_EQ(devices[0].same > 0, !changes.raw);
  }
}

TEST_F(Rerender, ADynamicFrictionAloneRaisesTheStaticOne) {
  const auto alone = rerender(file_->path(), RerenderChanges{.dynamicFriction = 0.8});
  const auto both = rerender(file_->path(), RerenderChanges{.staticFriction = 0.8, .dynamicFriction = 0.8});
  EXPECT_EQ(alone[0].largest_N, both[0].largest_N);
  EXPECT_GT(alone[0].largest_N, 0.01);
}

TEST_F(Rerender, AllCommandsAreInTheFile) {
  std::map<std::string, int> commands;
  std::map<scene::ClientId, base::Nanos> left;
  int gone = 0;
  int owners = 0;
  for (const record::RecordingEvent& event : eventsOf(file_->path())) {
    if (const auto* leaves = std::get_if<record::LeftEvent>(&event)) left[leaves->client] = leaves->time;
    const auto* command = std::get_if<record::SceneEvent>(&event);
    if (command == nullptr) continue;
    if (command->command) {
      ++commands[record::nameOf(*command->command)];
    } else {
      ++gone;
      const auto before = left.find(command->client);
      if (before == left.end()) continue;  // it has commanded nothing
      EXPECT_LE(before->second, command->time) << "the servo knows first";
      left.erase(before);
      ++owners;
    }
  }
  EXPECT_GE(gone, 1);
  EXPECT_GE(owners, 1);
  for (const char* name :
       {"SetVertices", "SetSurfaceProperty", "SetTransform", "DefineEffect", "StartEffect", "SetForceField",
        "BeginBatch", "CommitBatch", "AddObject", "SetSceneOrigin", "ResetScene"}) {
    EXPECT_GE(commands[name], 1) << name;
  }
}

// What the servo knows is in the file once its force has its full gain: 520 ms after a late tick.
bool untilFullGain(ScriptedPeer& peer) {
  peer.send(wire::Ping{});  // what waits to be read is no time
  if (!peer.untilNext<wire::Pong>()) return false;
  std::size_t states = 0;
  std::size_t since = peer.count<wire::IsTouching>();
  return peer.until([&] {
    const std::size_t ticks = peer.count<wire::IsTouching>();
    if (std::exchange(states, peer.count<wire::GuardState>()) != peer.count<wire::GuardState>())
      since = ticks;
    return ticks >= since + 600;
  });
}

// A client ends the recording of the start and begins another: while one hand is held in a touched cube, an
// effect vibrates and a force field pulls.
TEST_F(Rerender, RecordingBegunWhileTheServerRunsReplaysItsScene) {
  const RecordingFile first;
  const std::filesystem::path folder = std::filesystem::path(first.path()).parent_path();
  const std::string name = std::filesystem::path(first.path()).stem().string() + "-2.haptics";
  {
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, first.path()));
    ScriptedPeer peer(server.address());
    ScriptedPeer second(server.address(), "Second");
    ASSERT_TRUE(peer.untilConnected() && second.untilConnected());
    // Outside first: what appears around a hand is not felt.
    second.send(wire::HoldHand{.hold = 1, .position = {5, 40, 5}});
    ASSERT_TRUE(untilTicks(second, 500));
    sendCube(peer);
    peer.send(wire::SetHapticProperty{0, "static friction", 0.4F});
    peer.send(wire::AddObject{7, -1});
    sendBox(peer, 7, {5, 5, 5}, {-50, 40, 0});
    ASSERT_TRUE(untilApplied(peer));
    peer.send(wire::SetSceneOrigin{{0, 0.001F, 0}, {0, 0, 1}, 0.1F});
    peer.send(wire::ForceField{.origin = {0, 0, 0}, .force = {0.3F, 0.2F, 0}, .jacobian = {}, .radius = 10});
    peer.send(wire::Effect{"vibrationMotor", 3, 0, 0.2, 0, 33.3, {}, {1, 0, 0}});
    peer.send(wire::StartEffect{3});
    const auto hold = [&](double height, bool touches) {
      second.send(wire::HoldHand{.hold = 1, .position = {5, height, 5}});
      return second.until([&] {
        const auto touched = second.last<wire::TouchedObject>();
        return touched && (touched->object == 0) == touches;
      });
    };
    ASSERT_TRUE(hold(18, true));
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
    ASSERT_TRUE(
        peer.untilText("already; end that recording first ('hapticd record NAME@HOST --server --end')"));
    peer.forget();
    peer.send(wire::RecordingControl{.record = 0, .name = std::string_view(name)});
    ASSERT_TRUE(peer.untilText("refused: this server records to"));
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("refused: nothing is recorded"));
    for (const char* elsewhere : {"../x.haptics", ".haptics", "x.csv"}) {
      peer.forget();
      peer.send(wire::RecordingControl{.record = 1, .name = elsewhere});
      ASSERT_TRUE(peer.untilText("the name of a recording has")) << elsewhere;
    }
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
    ASSERT_TRUE(peer.untilText("recording to"));
    peer.forget();
    ASSERT_TRUE(untilTicks(second, 100));
    ASSERT_TRUE(hold(40, false));
    ASSERT_TRUE(untilFullGain(second));
    ASSERT_TRUE(hold(18, true));
    animate(peer, 40);
    second.send(wire::HoldHand{.hold = 0, .position = {}});
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
  }
  const auto devices = rerender(folder / name);
  std::filesystem::remove(folder / name);
  ASSERT_EQ(devices.size(), 2U);
  for (const Compared& device : devices) {
    EXPECT_EQ(device.same, device.ticks) << device.firstDifference;
    EXPECT_GT(device.ticks, 0U);
  }
  EXPECT_GT(devices[1].skipped, 0U) << "until the hand was free";
  EXPECT_GT(devices[1].touching, 100U);
  EXPECT_EQ(devices[1].largest_N, 0);
}

// Corner by corner, until the recording begins, and for a while after that. The hand is within, leaves the
// cube and comes back from above.
TEST_F(Rerender, RecordingBegunDuringAnUploadShowsTheMeshWhenItWasShown) {
  const RecordingFile first;
  const std::filesystem::path folder = std::filesystem::path(first.path()).parent_path();
  const std::string name = std::filesystem::path(first.path()).stem().string() + "-2.haptics";
  {
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, first.path()));
    ScriptedPeer peer(server.address());
    ScriptedPeer second(server.address(), "Second");
    ASSERT_TRUE(peer.untilConnected() && second.untilConnected());
    second.send(wire::HoldHand{.hold = 1, .position = {5, 5, 5}});
    peer.send(wire::SetHapticProperty{0, "stiffness", 0.5F});
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
    ASSERT_TRUE(untilFullGain(second));
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
    const std::vector<geometry::Vec3f> corners = boxTriples({20, 20, 20});
    const auto begun = [](const wire::Text& text) {
      return text.text.text.find("recording to") != std::string::npos;
    };
    for (int sent = 0, after = 0; after < 20 && sent < 20'000; ++sent) {
      const auto number = static_cast<std::size_t>(sent) % corners.size();
      geometry::Vec3f corner = corners[number];
      corner.x() += 0.01F * static_cast<float>(sent);
      peer.send(wire::SetVertex{0, static_cast<std::int32_t>(number), {corner.x(), corner.y(), corner.z()}});
      ASSERT_TRUE(untilTicks(peer, 1));
      after += std::any_of(peer.texts().begin(), peer.texts().end(), begun) ? 1 : 0;
    }
    sendCube(peer);
    second.send(wire::HoldHand{.hold = 1, .position = {5, 40, 5}});
    ASSERT_TRUE(untilFullGain(second));
    ASSERT_TRUE(pressFromAbove(second) && catchUp(second) && untilTicks(second, 100));
    peer.forget();  // the text of the first recording
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
  }
  const auto devices = rerender(folder / name);
  std::filesystem::remove(folder / name);
  ASSERT_EQ(devices.size(), 2U);
  for (const Compared& device : devices) EXPECT_EQ(device.same, device.ticks) << device.firstDifference;
  EXPECT_GT(devices[1].touching, 0U) << "how many depends on the speed of the disk";
}

// The time in the name is one of these seconds.
TEST_F(Rerender, RecordingsThatBeginInOneSecondHaveNamesOfTheirOwn) {
  const RecordingFile first;
  const std::filesystem::path folder = first.path().string() + ".d";
  std::filesystem::create_directory(folder);
  const std::time_t now = std::time(nullptr);
  for (std::time_t second = now; second < now + 300; ++second) {
    std::tm local{};
    localtime_r(&second, &local);
    char name[64] = {};
    std::strftime(name, sizeof name, "session-%Y%m%d-%H%M%S.haptics", &local);
    std::ofstream(folder / name) << "kept";
  }
  std::string answer;
  {
    const Hand hand = Hand::stroking();
    RunningServer server(recordingConfig(hand, folder / "first.haptics"));
    ScriptedPeer peer(server.address());
    ASSERT_TRUE(peer.untilConnected());
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
    peer.send(wire::RecordingControl{.record = 1, .name = {}});
    EXPECT_TRUE(peer.untilText("-2.haptics"));
    peer.forget();
    peer.send(wire::RecordingControl{.record = 0, .name = {}});
    ASSERT_TRUE(peer.untilText("recorded "));
  }
  std::filesystem::remove_all(folder);
}

// Without what was streamed the same ticks give other forces: so the file has it, and it counts.
TEST_F(Rerender, StreamedContactsAndForcesAreInTheFile) {
  record::RecordingReader reader(file_->path());
  record::Rerenderer without(reader.header());
  std::size_t streamed = 0;
  std::size_t other = 0;
  double held_N = 0;
  std::uint32_t contacts = 0;
  for (record::RecordingEvent event; reader.next(event);) {
    if (const auto* stream = std::get_if<record::StreamEvent>(&event)) {
      ++streamed;
      EXPECT_EQ(stream->device, 1U);
      contacts = std::max(contacts, stream->stream.input.contacts.count);
      held_N = std::max(held_N, stream->stream.input.force.force_N.norm());
      continue;
    }
    const realtime::TickReport* now = without.feed(event);
    if (now != nullptr && !record::sameOutcome(*now, std::get<record::TickEvent>(event).tick.report)) ++other;
  }
  EXPECT_GT(streamed, 20U);
  EXPECT_EQ(contacts, 1U);
  EXPECT_NEAR(held_N, 0.2, 1e-9);
  EXPECT_GT(other, 50U);
}

#ifndef HAPTICD_SANITIZED
// Address space in use, and little more.
class LittleMemory {
 public:
  LittleMemory() {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    getrlimit(RLIMIT_AS, &before_);
    rlimit little = before_;
    little.rlim_cur = pages * static_cast<std::size_t>(getpagesize()) + (1U << 24U);
    setrlimit(RLIMIT_AS, &little);
  }
  ~LittleMemory() { setrlimit(RLIMIT_AS, &before_); }

 private:
  rlimit before_{};
};

TEST(Rerendering, WithoutMemoryForTheSceneSaysSo) {
  record::RecordingHeader header;
  header.devices.emplace_back();
  record::Rerenderer again(header);
  constexpr std::size_t kMany = 16U << 20U;  // 192 MiB
  const record::RecordingEvent event = record::SceneEvent{
      .client = 1, .command = scene::SetVertices{0, 0, std::vector<geometry::Vec3f>(kMany)}};
  std::string text;
  {
    const LittleMemory little;
    try {
      again.feed(event);
    } catch (const record::RecordingError& error) {
      text = error.what();
    }
  }
  EXPECT_EQ(text, "the recorded scene cannot be rebuilt on this machine: out of memory");
}
#endif

}  // namespace
}  // namespace hapticd::test
