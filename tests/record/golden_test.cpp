// Recordings that older versions wrote are read as they were meant and, under the same force law, give the
// recorded forces bit for bit.
//
// testdata/recordings/ holds one file of each format version and each force law, and the scene commands in it
// as JSON. To add a file for a new version or law: --gtest_also_run_disabled_tests
// --gtest_filter='*WritesTheFiles', with HAPTICD_GOLDEN_DIR set.
#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

#include "base/clock.h"
#include "record/block_file.h"
#include "record/difference.h"
#include "record/fields.h"
#include "record/recorder.h"
#include "record/recording_file.h"
#include "record/recording_reader.h"
#include "record/rerender.h"
#include "record/scene_event_codec.h"
#include "record/text_fields.h"
#include "scene/builder.h"

namespace hapticd::record {
namespace {

using geometry::Vec3;
using geometry::Vec3f;

constexpr Nanos kPeriod = 1'000'000;

// Strokes along x, just below the top of the box at 20 mm.
class StrokingHand final : public device::Device {
 public:
  StrokingHand(bool gripper, Nanos lost, Nanos found) : gripper_(gripper), lost_(lost), found_(found) {}
  void open() override {}
  void close() noexcept override {}
  const device::DeviceProfile& profile() const noexcept override { return profile_; }
  bool read(Nanos now, device::DeviceState& state) noexcept override {
    if (now >= lost_ && now < found_) return false;
    const double t_s = 1e-9 * static_cast<double>(now);
    state.time = now;
    state.position_m = {0.004 * std::sin(20 * t_s), 0.0195 - 0.0005 * std::cos(11 * t_s), 0.001 * t_s};
    state.velocity_m_per_s = {0.08 * std::cos(20 * t_s), 0.0055 * std::sin(11 * t_s), 0.001};
    state.orientation = geometry::Quat(Eigen::AngleAxisd(0.2 * std::sin(9 * t_s), Vec3::UnitY()));
    state.buttons = now % 100'000'000 < 20'000'000 ? 1 : 0;
    if (gripper_) state.gripper_rad = 0.3 + 0.1 * std::sin(5 * t_s);
    return true;
  }
  bool write(const Vec3&) noexcept override { return true; }

 private:
  const device::DeviceProfile profile_;
  const bool gripper_;
  const Nanos lost_;
  const Nanos found_;
};

std::vector<Vec3f> boxVertices(float half, float top) {
  return {{-half, 0, -half},   {half, 0, -half},   {half, 0, half},   {-half, 0, half},
          {-half, top, -half}, {half, top, -half}, {half, top, half}, {-half, top, half}};
}

std::vector<geometry::Triangle> boxTriangles() {
  return {{0, 1, 2}, {0, 2, 3}, {4, 6, 5}, {4, 7, 6}, {0, 5, 1}, {0, 4, 5},
          {1, 6, 2}, {1, 5, 6}, {2, 7, 3}, {2, 6, 7}, {3, 4, 0}, {3, 7, 4}};
}

constexpr std::array<double, 16> kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

// What clients send before tick `i`: every command of the scene at least once.
std::vector<std::pair<scene::ClientId, std::optional<scene::SceneCommand>>> commandsAt(int i) {
  using namespace scene;
  switch (i) {
    case 0:
      return {{1, SetObjectNumber{2}},
              {1, SetVertices{0, 0, boxVertices(15, 20)}},
              {1, SetTriangles{0, 0, boxTriangles(), false}},
              {1, SetSurface{0, 0.6, 0.001, 0.4, 0.3}},
              {1, SetTouchableFaces{0}}};
    case 20:
      return {{1, SetNormal{0}},
              {1, SetTrimeshType{0, 1}},
              {1, SetTransform{0, {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.5, 0.1, 0, 1}}},
              {1, SetSurfaceProperty{0, "dynamic friction", 0.2}}};
    case 30:
      return {{1, SetVertices{0, 4, {{-15, 20.5F, -15}, {15, 20.5F, -15}, {15, 20, 15}, {-15, 20, 15}}}}};
    case 40:
      return {{2, DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 120, Vec3::Zero(), Vec3::UnitX()}},
              {2, StartEffect{3}},
              {2, SetForceField{{0.001, 0.002, 0.003}, {0.3, 0.2, 0}, {1, 2, 3, 4, 5, 6, 7, 8, 9}, 0.5}},
              {2, DefineEffect{"spring", 4, 0.05, 0.5, 40, 0, {1, 18, 2}, {0, 1, 0}}},
              {2, StartEffect{4}}};
    case 60:
      return {{2, StopEffect{3}},
              {2, SetPlane{0, {0.1, 1, 0, -0.0195}, 0.3, 0.001, 0.2, 0.1, 10}},
              {2, SetPlaneDetail{0.05, 0.02, 0.0002, 0.002, 0.0001, 90}},
              {2, StartCustomEffect{0, {0.3F, 80, 0.02F, 0, 1, 0}}}};
    case 75:
      return {{2, StopCustomEffect{}},
              {2, SetConstraintMode{2}},
              {2, SetConstraintVector{ConstraintVector::linePoint, {0, 0.019, 0}}},
              {2, SetConstraintVector{ConstraintVector::lineDirection, {1, 0.1, 0}}},
              {2, SetConstraintStiffness{80}},
              {2, SetConstraintEnabled{true}}};
    case 90:
      return {{2, std::nullopt}};  // what it owned ramps out
    case 100:
      return {{1, BeginBatch{}},
              {1, AddObject{7, -1}},
              {1, AddObjectExScene{8}},
              {1, MoveToParent{7, 0}},
              {1, SetVertices{7, 0, {{-5, 0, -5}, {0, 0, 6}, {5, 0, -5}}}},
              {1, SetObjectPosition{7, {0, 0.0205, 0}}},
              {1, SetObjectOrientation{7, Vec3::UnitZ(), 0.1}},
              {1, SetObjectScale{7, {2, 1, 2}}},
              {1, TransformMesh{7, {1, 0, 0, 0.0001F, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}}},
              {1, CommitBatch{}}};
    case 125:
      return {{1, SetSceneOrigin{{0, 0.0005, 0}, Vec3::UnitZ(), 0.05}}, {1, RemoveTriangle{0, 5}}};
    case 150:
      return {{1, SetTouchable{7, false}}, {1, ClearMesh{7}}, {1, RemoveObject{8}}};
    case 165:
      return {{1, SetWorkspaceBox{kIdentity, {-90, -70, -40, 90, 70, 40}}},
              {1, SetHapticOrigin{{0, 0.0003, 0}, Vec3::UnitY(), 0.02}},
              {1, SetHapticScale{1.02}}};
    case 185:
      return {{1, SetWorkspaceProjection{kIdentity,
                                         {0.01, 0, 0, 0, 0, 0.012, 0, 0, 0, 0, -0.02, 0, 0, 0, 0, 1}}}};
    case 195:
      return {{1, ResetScene{}},
              {1, SetVertices{0, 0, boxVertices(12, 20)}},
              {1, SetTriangles{0, 0, boxTriangles(), false}},
              {1, SetSurface{0, 0.4, 0, 0, 0}}};
    default:
      return {};
  }
}

Nanos timeOf(int tick) {
  return 1'000'000'000 + tick * kPeriod;
}

// The device gives no state from the tick `lost` to that before `found`.
void writeRecording(const std::filesystem::path& file, bool gripper, int ticks, int lost = 0, int found = 0) {
  base::SimulatedClock clock;
  StrokingHand hand(gripper, timeOf(lost), timeOf(found));
  RecordedDevice device;
  device.names = {"Phantom"};
  device.driver = "simulated";
  device.tick.guard.armed = true;
  device.tick.guard.selfRecover = true;
  Recorder recorder(file, [](RecorderProblem, const std::string& text) { ADD_FAILURE() << text; });
  recorder.addDevice(device);
  scene::SceneConfig config = device.sceneConfig;
  config.stopwatch = [] { return Nanos{0}; };
  scene::SceneBuilder builder(config);
  realtime::Tick tick(hand, clock, device.tick);
  tick.recordTo({.ticks = &recorder.ring(0)});
  recorder.start(1'700'000'000'000'000'000, "");
  std::vector<scene::Notice> notices;
  for (int i = 0; i < ticks; ++i) {
    const Nanos now = timeOf(i);
    const auto commands = commandsAt(i);
    for (const auto& [client, command] : commands) {
      recorder.recordCommand(0, client, now, command ? &*command : nullptr);
      if (command) {
        builder.apply(client, scene::SceneCommand(*command), now, notices);
      } else {
        builder.clientGone(client, now);
      }
    }
    const auto due = builder.nextDeadline();
    if (i == 0 || !commands.empty() || (due && *due <= now)) {
      const auto snapshot = builder.publish(now, notices);
      recorder.recordPublish(0, now, snapshot ? snapshot->revision : 0);
      if (snapshot) tick.snapshots().publish(snapshot);
    }
    if (i == 110) tick.control().stop();
    if (i == 115) tick.control().rearm();
    clock.sleepUntil(now);
    tick(now);
  }
  recorder.finish();
  for (const scene::Notice& notice : notices) std::printf("%s\n", notice.text.c_str());
}

std::string commandsOf(const std::filesystem::path& file) {
  std::string text;
  RecordingReader reader(file);
  for (RecordingEvent event; reader.next(event);) {
    const auto* command = std::get_if<SceneEvent>(&event);
    if (command == nullptr) continue;
    {
      JsonObject object(text);
      object("client", command->client);
      object("time_ns", command->time);
      object("command", std::string(command->command ? nameOf(*command->command) : "ClientGone"));
      object.key("fields");
      JsonObject values(text);
      if (command->command) std::visit([&](const auto& c) { fields(c, values); }, *command->command);
    }
    text += '\n';
  }
  EXPECT_EQ(reader.remark(), "");
  return text;
}

// The same file, marked as of version 1: what has no gripper differs by the number and the law.
void markAsVersion1WithoutLaw(const std::filesystem::path& file) {
  Bytes old(magic().begin(), magic().end());
  BlockReader blocks(file);
  for (BlockReader::Block block; blocks.next(block);) {
    if (block.kind == BlockKind::law) continue;
    if (block.kind == BlockKind::header) wire::storeBig(block.content.data(), std::uint32_t{1});
    appendBlock(old, block.kind, block.content);
  }
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(old.data()), static_cast<std::streamsize>(old.size()));
}

TEST(Golden, DISABLED_WritesTheFiles) {
  const std::filesystem::path folder(std::getenv("HAPTICD_GOLDEN_DIR"));
  writeRecording(folder / "all_commands_v1.haptics", false, 230);
  markAsVersion1WithoutLaw(folder / "all_commands_v1.haptics");
  std::ofstream(folder / "all_commands.jsonl") << commandsOf(folder / "all_commands_v1.haptics");
  writeRecording(folder / "gripper_v2.haptics", true, 130);
  writeRecording(folder / "all_commands_law41.haptics", false, 370, 210, 340);
}

const std::filesystem::path kFolder = std::filesystem::path(HAPTICD_TESTDATA) / "recordings";

struct GoldenName {
  const char* file;
  std::uint32_t law;
};

void PrintTo(const GoldenName& name, std::ostream* out) {
  *out << name.file;
}

class GoldenFile : public testing::TestWithParam<GoldenName> {};

// Contact of law 1 differs: friction, and stiffness where box and plane meet. Without contact, effects of
// laws 1 to 3 may pull at a proxy that is some micrometres away.
TEST_P(GoldenFile, GivesTheRecordedForcesBitForBit) {
  RecordingReader reader(kFolder / GetParam().file);
  ASSERT_EQ(reader.header().law.number, GetParam().law);
  const bool sameLaw = GetParam().law == realtime::kForceLaw;
  EXPECT_EQ(lawDifference(reader.header()),
            sameLaw ? ""
                    : "the recording has force law " + std::to_string(GetParam().law) +
                          ", this program law " + std::to_string(realtime::kForceLaw));
  Rerenderer again(reader.header());
  std::uint64_t same = 0;
  double largest_N = 0;
  std::uint64_t ticks = 0;
  std::uint64_t touching = 0;
  std::set<std::uint64_t> revisions;
  for (RecordingEvent event; reader.next(event);) {
    const realtime::TickReport* now = again.feed(event);
    if (now == nullptr) continue;
    const realtime::TickReport& then = std::get<TickEvent>(event).tick.report;
    if (sameLaw) {
      EXPECT_TRUE(sameOutcome(*now, then)) << "tick " << then.tick << ": " << now->force_N.transpose()
                                           << " N, recorded " << then.force_N.transpose() << " N";
    } else if (!then.rendering.touching) {
      EXPECT_LT((now->rendering.force_N - then.rendering.force_N).norm(), 1e-3) << "tick " << then.tick;
    }
    same += sameOutcome(*now, then) ? 1 : 0;
    largest_N = std::max(largest_N, (now->rendering.force_N - then.rendering.force_N).norm());
    ++ticks;
    touching += then.rendering.touching ? 1 : 0;
    revisions.insert(then.revision);
  }
  EXPECT_LT(largest_N, 2);
  if (!sameLaw) {
    std::printf("%llu of %llu ticks in every bit, largest difference %.3g N\n",
                static_cast<unsigned long long>(same), static_cast<unsigned long long>(ticks), largest_N);
  }
  EXPECT_GE(ticks, 130U);
  EXPECT_GE(touching, 60U);
  EXPECT_GE(revisions.size(), 8U);
}

INSTANTIATE_TEST_SUITE_P(
    EveryVersion, GoldenFile,
    testing::Values(
        GoldenName{"all_commands_v1.haptics", 1}, GoldenName{"gripper_v2.haptics", 1},
        GoldenName{"all_commands_law2.haptics", 2}, GoldenName{"all_commands_law3.haptics", 3},
        GoldenName{"all_commands_law4.haptics", 4}, GoldenName{"all_commands_law5.haptics", 5},
        GoldenName{"all_commands_law6.haptics", 6}, GoldenName{"all_commands_law7.haptics", 7},
        GoldenName{"all_commands_law8.haptics", 8}, GoldenName{"all_commands_law9.haptics", 9},
        GoldenName{"all_commands_law10.haptics", 10}, GoldenName{"all_commands_law11.haptics", 11},
        GoldenName{"all_commands_law12.haptics", 12}, GoldenName{"all_commands_law13.haptics", 13},
        GoldenName{"all_commands_law14.haptics", 14}, GoldenName{"all_commands_law15.haptics", 15},
        GoldenName{"all_commands_law16.haptics", 16}, GoldenName{"all_commands_law17.haptics", 17},
        GoldenName{"all_commands_law18.haptics", 18}, GoldenName{"all_commands_law19.haptics", 19},
        GoldenName{"all_commands_law20.haptics", 20}, GoldenName{"all_commands_law21.haptics", 21},
        GoldenName{"all_commands_law22.haptics", 22}, GoldenName{"all_commands_law23.haptics", 23},
        GoldenName{"all_commands_law24.haptics", 24}, GoldenName{"all_commands_law25.haptics", 25},
        GoldenName{"all_commands_law26.haptics", 26}, GoldenName{"all_commands_law27.haptics", 27},
        GoldenName{"all_commands_law28.haptics", 28}, GoldenName{"all_commands_law29.haptics", 29},
        GoldenName{"all_commands_law30.haptics", 30}, GoldenName{"all_commands_law31.haptics", 31},
        GoldenName{"all_commands_law32.haptics", 32}, GoldenName{"all_commands_law33.haptics", 33},
        GoldenName{"all_commands_law34.haptics", 34}, GoldenName{"all_commands_law35.haptics", 35},
        GoldenName{"all_commands_law36.haptics", 36}, GoldenName{"all_commands_law37.haptics", 37},
        GoldenName{"all_commands_law38.haptics", 38}, GoldenName{"all_commands_law39.haptics", 39},
        GoldenName{"all_commands_law40.haptics", 40}, GoldenName{"all_commands_law41.haptics", 41}),
    [](const auto& file) {
      const std::string name = file.param.file;
      return name.substr(0, name.find('.'));
    });

TEST(Golden, CommandsAreReadAsTheyWereMeant) {
  std::ifstream in(kFolder / "all_commands.jsonl");
  std::stringstream expected;
  expected << in.rdbuf();
  ASSERT_FALSE(expected.str().empty());
  EXPECT_EQ(commandsOf(kFolder / "all_commands_v1.haptics"), expected.str());
}

TEST(Golden, EveryCommandOfTheSceneIsThere) {
  std::set<std::size_t> seen;
  RecordingReader reader(kFolder / "all_commands_v1.haptics");
  for (RecordingEvent event; reader.next(event);) {
    const auto* command = std::get_if<SceneEvent>(&event);
    if (command != nullptr && command->command) seen.insert(command->command->index());
  }
  EXPECT_EQ(seen.size(), 40U) << "of the commands that version 1 knew";
}

TEST(Golden, GrippersAreRead) {
  std::uint64_t ticks = 0;
  RecordingReader reader(kFolder / "gripper_v2.haptics");
  for (RecordingEvent event; reader.next(event);) {
    const auto* tick = std::get_if<TickEvent>(&event);
    if (tick == nullptr) continue;
    ASSERT_TRUE(tick->tick.report.device.gripper_rad);
    EXPECT_NEAR(*tick->tick.report.device.gripper_rad, 0.3, 0.1);
    ++ticks;
  }
  EXPECT_EQ(ticks, 130U);
}

}  // namespace
}  // namespace hapticd::record
