// Re-rendering a recording gives the recorded forces bit for bit.
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

#include "record/recorded_file.h"
#include "record/rerender.h"
#include "record/scene_event_codec.h"

namespace hapticd::test {
namespace {

using record::RerenderChanges;

struct Compared {
  std::uint64_t ticks = 0;
  std::uint64_t skipped = 0;
  std::uint64_t same = 0;
  std::uint64_t touching = 0;
  std::uint64_t stopped = 0;
  std::set<std::uint64_t> revisions;
  double largest_N = 0;          // as written
  double largestRendered_N = 0;  // before the guard, which on a stalled machine lets little through
  std::string firstDifference;
};

std::vector<Compared> rerender(const std::filesystem::path& file, const RerenderChanges& changes = {}) {
  record::RecordingReader reader(file);
  record::Rerenderer again(reader.header(), changes);
  std::vector<Compared> devices(reader.header().devices.size());
  for (record::RecordingEvent event; reader.next(event);) {
    const realtime::TickReport* now = again.feed(event);
    if (now == nullptr) continue;
    const auto& [device, tick] = std::get<record::TickEvent>(event);
    Compared& compared = devices[device];
    if (!again.comparable(device)) {
      ++compared.skipped;
      continue;
    }
    ++compared.ticks;
    compared.touching += tick.report.rendering.touching ? 1 : 0;
    compared.stopped += tick.report.guard.stopped ? 1 : 0;
    compared.revisions.insert(tick.report.revision);
    compared.largest_N = std::max(compared.largest_N, (now->force_N - tick.report.force_N).norm());
    compared.largestRendered_N =
        std::max(compared.largestRendered_N, (now->rendering.force_N - tick.report.rendering.force_N).norm());
    if (record::sameOutcome(*now, tick.report)) {
      ++compared.same;
    } else if (compared.firstDifference.empty()) {
      std::ostringstream text;
      text << "tick " << tick.report.tick << " revision " << tick.report.revision << "/" << now->revision
           << " force " << tick.report.force_N.transpose() << " / " << now->force_N.transpose();
      compared.firstDifference = text.str();
    }
  }
  EXPECT_EQ(reader.remark(), "");
  return devices;
}

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

TEST_F(Rerender, AllCommandsAreInTheFile) {
  std::map<std::string, int> commands;
  int gone = 0;
  for (const record::RecordingEvent& event : eventsOf(file_->path())) {
    const auto* command = std::get_if<record::SceneEvent>(&event);
    if (command == nullptr) continue;
    if (command->command) {
      ++commands[record::nameOf(*command->command)];
    } else {
      ++gone;
    }
  }
  EXPECT_GE(gone, 1);
  for (const char* name :
       {"SetVertices", "SetSurfaceProperty", "SetTransform", "DefineEffect", "StartEffect", "SetForceField",
        "BeginBatch", "CommitBatch", "AddObject", "SetSceneOrigin", "ResetScene"}) {
    EXPECT_GE(commands[name], 1) << name;
  }
}

// A client ends the recording of the start and begins another: while one hand is held in a touched cube, an
// effect runs and a force field pulls.
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
    const auto hold = [&](double height, bool touches) {
      second.send(wire::HoldHand{.hold = 1, .position = {5, height, 5}});
      return second.until([&] {
        const auto touched = second.last<wire::TouchedObject>();
        return touched && (touched->object == 0) == touches;
      });
    };
    ASSERT_TRUE(hold(18, true));
    peer.send(wire::RecordingControl{.record = 1, .name = std::string_view(name)});
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
    ASSERT_TRUE(untilTicks(second, 300));
    ASSERT_TRUE(hold(18, true));
    animate(peer, 20);
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

}  // namespace
}  // namespace hapticd::test
