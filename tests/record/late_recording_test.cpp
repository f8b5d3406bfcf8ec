// A recording that begins while the server runs re-renders to the same forces, whatever goes on at its begin.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <functional>
#include <ostream>
#include <string>
#include <variant>
#include <vector>

#include "geometry/triangle_mesh.h"
#include "geometry/types.h"
#include "realtime/remote/remote_input.h"
#include "record/block_file.h"
#include "record/compared.h"
#include "record/difference.h"
#include "record/late_recording.h"
#include "record/recording_file.h"
#include "record/scene_event_codec.h"
#include "scene/commands.h"

namespace hapticd::test {
namespace {

scene::DefineEffect pull(std::int32_t index, double duration_ms) {
  return {"constant", index, 0, 0.4, duration_ms, 0, geometry::Vec3::Zero(), {1, 0, 0}};
}

void pullAndPush(LateRecording& r, scene::ClientId client) {
  r.send(pull(1, 0), client);
  r.send(scene::StartEffect{1}, client);
  r.send(scene::SetForceField{geometry::Vec3::Zero(), {0, 0, 0.3}, {}, 1}, client);
}

// What goes on when the recording begins.
struct GoesOn {
  const char* name;
  std::function<void(LateRecording&)> begin;
  bool touching = false;  // the hand is in the box
};

void PrintTo(const GoesOn& what, std::ostream* out) {
  *out << what.name;
}

realtime::RemoteInput streamed(const LateRecording& r, std::uint64_t number) {
  realtime::RemoteInput input;
  realtime::RemoteContactSet& set = input.contacts;
  set.number = number;
  set.received = set.stated = r.now();
  set.count = 1;
  set.contacts[0].point_m = {0, 0.031, 0};
  set.contacts[0].stiffness_N_per_m = 300;
  return input;
}

const geometry::Vec3 kAbove{1, 30, 2};

const GoesOn kGoesOn[] = {
    {"nothing", [](LateRecording& r) { r.glide(kAbove, 700); }},
    // So near to its place that the proxy does not follow any more.
    {"rest", [](LateRecording& r) { r.glide(kAbove, 1400); }},
    {"contact",
     [](LateRecording& r) {
       r.glide({1, 19, 2}, 700);
     },
     true},
    {"effect",
     [](LateRecording& r) {
       r.send(pull(1, 0));
       r.send(scene::StartEffect{1});
       r.glide(kAbove, 700);
     }},
    {"timedEffect",
     [](LateRecording& r) {
       r.send(pull(1, 900));
       r.send(scene::StartEffect{1});
       r.glide(kAbove, 700);
     }},
    {"vibrationInContact",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 33.3, geometry::Vec3::Zero(), {1, 0, 0}});
       r.send(scene::StartEffect{3});
       r.glide({1, 19, 2}, 313);
       r.send(scene::DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 47.1, geometry::Vec3::Zero(), {1, 0, 0}});
       r.glide({1, 19, 2}, 400);
     },
     true},
    {"frictionInContact",
     [](LateRecording& r) {
       r.send(scene::DefineEffect{"friction", 2, 0.3, 0.5, 0, 0, geometry::Vec3::Zero(),
                                  geometry::Vec3::Zero()});
       r.send(scene::StartEffect{2});
       r.glide({6, 19, 2}, 700);
     },
     true},
    {"buzz",
     [](LateRecording& r) {
       r.send(scene::StartCustomEffect{0, {0.5F, 33.3F, 100, 1, 0, 0}});
       r.glide(kAbove, 700);
     }},
    {"plane",
     [](LateRecording& r) {
       r.send(scene::SetPlane{0, {0, 1, 0, -0.0195}, 0.3, 0.001, 0.2, 0.1, 10});
       r.send(scene::SetPlaneDetail{0, 0, 0.0002, 0.002, 0.0005, 33.3});
       r.glide({1, 19, 2}, 300);
       r.glide(kAbove, 400);
     }},
    {"planePlacedAnew",
     [](LateRecording& r) {
       r.send(scene::SetPlane{0, {0, 1, 0, -0.0195}, 0.3, 0.001, 0.2, 0.1, 10});
       r.send(scene::SetPlaneDetail{0, 0, 0.0002, 0.002, 0.0005, 33.3});
       r.glide({1, 19, 2}, 300);
       r.glide(kAbove, 407);
       r.send(scene::SetPlane{0, {0, 1, 0, -0.0196}, 0.3, 0.001, 0.2, 0.1, 10});
       r.glide(kAbove, 100);
     }},
    {"heat",
     [](LateRecording& r) {
       r.glide({1, 15, 2}, 3037);
       r.glide(kAbove, 700);
     }},
    {"ramp",
     [](LateRecording& r) {
       r.glide(kAbove, 500);
       r.control().rampIn();
       r.glide(kAbove, 1);
     }},
    {"ownerGone",
     [](LateRecording& r) {
       pullAndPush(r, 2);
       r.glide(kAbove, 500);
       r.leave(2);
       r.glide(kAbove, 50);
     }},
    {"stream",
     [](LateRecording& r) {
       r.glide(kAbove, 500);
       for (std::uint64_t i = 1; i < 10; ++i) {
         r.stream(streamed(r, i));
         r.glide(kAbove, 10);
       }
     }},
};

bool knowsPast(const std::filesystem::path& file) {
  std::string remark;
  std::string law;
  return record::compare(file, {}, remark, law).front().knowsPast();
}

class RecordingBegunLate : public testing::TestWithParam<GoesOn> {};

TEST_P(RecordingBegunLate, GivesTheRecordedForcesBitForBit) {
  const RecordingFile file;
  LateRecording r;
  r.glide({1, 18, 2}, 700);
  r.glide(kAbove, 300);
  GetParam().begin(r);
  ASSERT_EQ(r.last().rendering.touching, GetParam().touching);
  r.record(file.path());
  r.glide(GetParam().touching ? geometry::Vec3{1.5, 18.9, 2} : kAbove, 100);
  r.glide({2, 30, 1}, 800);
  r.glide({-2, 16, 1}, 900);
  r.glide({3, 16.5, 1}, 300);
  r.send(scene::SetSurfaceProperty{0, "static friction", 0.1});
  r.glide({3, 24, 1}, 200);
  r.stream(streamed(r, 100));
  r.glide({3, 19.5, 3}, 300);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_EQ(compared.largest_N, 0);
  EXPECT_GT(compared.ticks, 1700U);
  EXPECT_EQ(compared.ticks + compared.skipped, 2600U);
  EXPECT_GT(compared.touching, 800U);
}

// Writes the file again, with the blocks as `change` leaves them, and without those that it refuses.
template <class Change>
void rewrite(const std::filesystem::path& file, const Change& change) {
  record::Bytes changed(record::magic().begin(), record::magic().end());
  record::BlockReader blocks(file);
  for (record::BlockReader::Block block; blocks.next(block);) {
    if (change(block)) record::appendBlock(changed, block.kind, block.content);
  }
  std::ofstream(file, std::ios::binary)
      .write(reinterpret_cast<const char*>(changed.data()), static_cast<std::streamsize>(changed.size()));
}

// As a version wrote the file that did not know this kind of block.
void removeBlocks(const std::filesystem::path& file, record::BlockKind kind) {
  rewrite(file, [kind](const record::BlockReader::Block& block) { return block.kind != kind; });
}

// As a version wrote the file that let effects start anew.
void startEffectsAnew(const std::filesystem::path& file) {
  rewrite(file, [](record::BlockReader::Block& block) {
    record::SceneEvent event;
    std::string error;
    if (block.kind != record::BlockKind::scene || !record::unpackSceneEvent(block.content, event, error) ||
        !event.command)
      return true;
    if (const auto* goesOn = std::get_if<scene::ContinueEffect>(&*event.command)) {
      const scene::SceneCommand start = scene::StartEffect{goesOn->index};
      block.content.clear();
      record::packSceneEvent(block.content, event.scene, event.client, event.time, &start);
    }
    return true;
  });
}

// More ticks than these are compared, and all of them are the same.
void endTheSame(LateRecording& r, const RecordingFile& file, std::uint64_t ticks) {
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, ticks);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
}

// A plane that came above the hand, and later anew, has two times: its buzz counts from the first one.
TEST(RecordingBegunLate, BuzzesAPlaneInTimeThatWasPlacedAnewAboveTheHand) {
  const RecordingFile file;
  LateRecording r;
  const scene::SetPlaneDetail buzz{0, 0, 0, 0, 0.0005, 33.3};
  r.glide(kAbove, 700);
  r.send(scene::SetPlane{0, {0, 1, 0, -0.0295}, 0.3, 0, 0, 0, 10});
  r.glide(kAbove, 107);
  r.send(scene::SetPlane{0, {0, 1, 0, -0.0305}, 0.3, 0, 0, 0, 10});
  r.glide(kAbove, 50);
  r.glide({1, 32, 2}, 300);
  r.record(file.path());
  r.glide({1, 32, 2}, 50);
  r.send(buzz);
  r.glide({1, 29, 2}, 300);
  endTheSame(r, file, 300);
}

// The buzz that is there when the recording begins does not keep it from knowing what the servo knows.
TEST(RecordingBegunLate, KnowsABuzzingPlaneThatWasPlacedAnewAboveTheHand) {
  const RecordingFile file;
  LateRecording r;
  r.glide(kAbove, 700);
  r.send(scene::SetPlane{0, {0, 1, 0, -0.0295}, 0.3, 0, 0, 0, 10});
  r.send(scene::SetPlaneDetail{0, 0, 0, 0, 0.0005, 33.3});
  r.glide(kAbove, 107);
  r.send(scene::SetPlane{0, {0, 1, 0, -0.0305}, 0.3, 0, 0, 0, 10});
  r.glide(kAbove, 50);
  r.glide({1, 32, 2}, 300);
  r.record(file.path());
  r.glide({1, 32, 2}, 50);
  r.glide({1, 29, 2}, 300);
  endTheSame(r, file, 300);
}

// The force ramps in until the effect has ended: so no tick that is compared felt it.
TEST(RecordingBegunLate, EndsATimedEffectWhenItEnded) {
  const RecordingFile file;
  LateRecording r;
  r.send(pull(1, 1000));
  r.send(scene::StartEffect{1});
  r.glide(kAbove, 900);
  r.control().rampIn();
  r.record(file.path());
  r.glide(kAbove, 1000);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, 400U);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  startEffectsAnew(file.path());
  EXPECT_EQ(rerender(file.path()).front().same, compared.ticks) << "of an older version";
}

// Its new definition has no duration, and nobody starts it.
TEST(RecordingBegunLate, DefinesAnEffectThatEndedWithoutStartingIt) {
  const RecordingFile file;
  LateRecording r;
  r.send(pull(1, 1000));
  r.send(scene::StartEffect{1});
  r.glide(kAbove, 800);
  r.record(file.path());
  r.glide(kAbove, 500);
  r.send(pull(1, 0));
  r.glide(kAbove, 500);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  endTheSame(r, file, 900);
}

// A start waits for its definition for one second, also when the recording begins meanwhile.
TEST(RecordingBegunLate, ForgetsAStartWithoutADefinitionWhenItWasForgotten) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::StartEffect{5});
  r.glide(kAbove, 600);
  r.record(file.path());
  r.glide(kAbove, 700);
  r.send(pull(5, 0));
  r.glide(kAbove, 300);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  endTheSame(r, file, 900);
}

TEST(RecordingBegunLate, LeavesABatchRefusedThatWasRefused) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::BeginBatch{}, 2);
  r.send(scene::SetVertices{1, 0, std::vector<geometry::Vec3f>(LateRecording::kBatch_bytes)}, 2);
  r.glide(kAbove, 700);
  r.record(file.path());
  r.glide(kAbove, 50);
  r.send(pull(1, 0), 2);
  r.send(scene::StartEffect{1}, 2);
  r.send(scene::CommitBatch{}, 2);
  r.send(scene::SetTouchableFaces{0});  // for a publication
  r.glide(kAbove, 100);
  EXPECT_EQ(r.last().rendering.force_N.norm(), 0);
  r.send(pull(1, 0), 2);
  r.send(scene::StartEffect{1}, 2);
  r.glide(kAbove, 100);
  EXPECT_NEAR(r.last().rendering.force_N.norm(), 0.4, 1e-9) << "after the batch";
  endTheSame(r, file, 200);
}

// How far the proxy stays off a mesh depends on the size of its shape, not of the shapes before.
TEST(RecordingBegunLate, HasAMeshThatHasDeformed) {
  const RecordingFile file;
  LateRecording r;
  r.glide({1, 60, 2}, 400);
  r.raise(0.03);
  r.glide({1, 60, 2}, 100);
  r.raise(0);
  r.glide(kAbove, 700);
  r.record(file.path());
  r.glide(kAbove, 50);
  r.glide({2, 19, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  endTheSame(r, file, 400);
}

// Triangles around a vertex are joined until a vertex has moved.
TEST(RecordingBegunLate, HasAFanThatHasDeformed) {
  const RecordingFile file;
  LateRecording r;
  constexpr std::uint32_t kRim = 600;
  const auto fan = [](float height_m) {
    std::vector<geometry::Vec3f> points{{0, height_m, 0}};
    for (std::uint32_t i = 0; i < kRim; ++i) {
      const float angle = 6.2831853F * static_cast<float>(i) / kRim;
      points.emplace_back(0.01F * std::cos(angle), 0.03F, -0.01F * std::sin(angle));
    }
    return points;
  };
  std::vector<geometry::Triangle> triangles;
  for (std::uint32_t i = 0; i < kRim; ++i) triangles.push_back({0, 1 + i, 1 + (i + 1) % kRim});
  r.glide({1, 40, 2}, 400);
  r.send(scene::AddObject{1, -1});
  r.send(scene::SetVertices{1, 0, fan(0.032F)});
  r.send(scene::SetTriangles{1, 0, triangles, true});
  r.send(scene::SetSurface{1, 0.8, 0.001, 0.4, 0.3});
  r.glide({1, 40, 2}, 400);
  r.send(scene::SetVertices{1, 0, fan(0.033F)});
  r.glide({1, 40, 2}, 700);
  r.record(file.path());
  r.glide({1, 40, 2}, 50);
  r.glide({2, 30.5, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  r.glide({-2, 30.5, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  endTheSame(r, file, 700);
}

// It deforms in the copy, too, once nothing of it is missing.
TEST(RecordingBegunLate, HasAMeshThatWasSentFromItsEnd) {
  const RecordingFile file;
  LateRecording r;
  const auto floor = [&r](float height_m, std::int32_t first, std::size_t count) {
    const std::vector<geometry::Vec3f> all{{-0.01F, height_m, -0.01F},
                                           {-0.01F, height_m, 0.01F},
                                           {0.01F, height_m, 0.01F},
                                           {0.01F, height_m, -0.01F}};
    r.send(
        scene::SetVertices{1, first, {all.begin() + first, all.begin() + first + static_cast<int>(count)}});
  };
  r.glide({1, 40, 2}, 100);
  r.send(scene::AddObject{1, -1});
  floor(0.03F, 2, 2);
  floor(0.03F, 0, 2);
  r.send(scene::SetTriangles{1, 0, {{0, 1, 2}, {0, 2, 3}}, true});
  r.send(scene::SetSurface{1, 0.8, 0.001, 0.4, 0.3});
  r.glide({1, 40, 2}, 700);
  r.record(file.path());
  r.glide({1, 40, 2}, 50);
  r.glide({1, 29, 2}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  floor(0.0305F, 0, 4);
  r.glide({1, 29, 2}, 200);
  endTheSame(r, file, 600);
}

// What turns together has one path, that of the first.
TEST(RecordingBegunLate, TurnsTheChildrenOfAnObjectInTheirOrder) {
  const RecordingFile file;
  LateRecording r;
  r.glide({1, 40, 2}, 100);
  r.send(scene::ClearMesh{0});
  r.send(scene::AddObject{1, -1});
  for (const std::int32_t child : {3, 2}) {
    const float x = child == 2 ? 0 : 0.05F;
    r.send(scene::AddObject{child, 1});
    r.send(scene::SetVertices{
        child, 0, {{x - 0.02F, 0.02F, -0.02F}, {x, 0.02F, 0.04F}, {x + 0.02F, 0.02F, -0.02F}}});
    r.send(scene::SetSurface{child, 0.8, 0.001, 0.4, 0.3});
    r.send(scene::SetObjectPosition{child, {x, 0, 0}});
  }
  r.glide({1, 30, 2}, 700);
  r.record(file.path());
  r.glide({1, 30, 2}, 50);
  r.glide({1, 19, 2}, 400);
  EXPECT_EQ(r.last().rendering.touchedObject, 2);
  for (int i = 1; i < 10; ++i) {
    r.send(scene::SetObjectOrientation{1, {0, 0, 1}, 0.01 * i});
    r.glide({1, 19, 2}, 20);
  }
  EXPECT_TRUE(r.last().rendering.touching);
  endTheSame(r, file, 500);
}

// New positions alone are shown 4 ms after the last, and 20 ms after the first at the latest. What they
// deform was there before.
TEST(RecordingBegunLate, ShowsNewPositionsWhenTheyWereShown) {
  for (const int at : {0, 1, 3, 7, 12, 19, 26}) {
    for (const int every_ms : {1, 3, 5}) {
      const RecordingFile file;
      LateRecording r;
      r.glide({1, 60, 2}, 700);
      for (int i = 0; i < 30; ++i) {
        r.raise(0.0001 * (30 - i));
        if (i == at) r.record(file.path());
        r.glide({1, 60, 2}, every_ms);
      }
      r.glide(kAbove, 500);
      r.glide({2, 19, 1}, 400);
      EXPECT_TRUE(r.last().rendering.touching);
      SCOPED_TRACE(testing::Message() << "every " << every_ms << " ms, begun at " << at);
      endTheSame(r, file, 400);
    }
  }
}

// Meshes that take long to build are built again after a pause.
TEST(RecordingBegunLate, PausesBetweenBuildsAsLong) {
  const RecordingFile file;
  LateRecording r;
  r.glide(kAbove, 400);
  r.slowDown(100 * LateRecording::kTick);
  r.raise(0.0001);
  r.glide(kAbove, 400);
  r.slowDown(1000);
  r.record(file.path());
  r.glide(kAbove, 450);
  r.glide({2, 19, 1}, 250);
  EXPECT_TRUE(r.last().rendering.touching);
  r.raise(0.002);
  r.glide({2, 19, 1}, 50);
  r.send(pull(1, 0));  // the scene is asked what is new, before the pause ends
  r.glide({2, 19, 1}, 50);
  EXPECT_LT(r.last().rendering.depth_m, 0.0015) << "the pause goes on";
  r.glide({2, 19, 1}, 600);
  EXPECT_GT(r.last().rendering.depth_m, 0.0025);
  endTheSame(r, file, 700);
}

// A mesh of new triangles, too, where one was there before.
TEST(RecordingBegunLate, PausesAnUploadAsLong) {
  for (const int edits : {76, 100}) {
    const RecordingFile file;
    LateRecording r;
    r.glide({1, 60, 2}, 700);
    r.slowDown(7 * LateRecording::kTick);
    r.raise(0.0001);
    r.glide({1, 60, 2}, 10);
    const auto beforeEach = [&](int triangle) {
      if (triangle == 5) r.record(file.path());
    };
    r.upload(0, 0.001, 12, beforeEach, [&] { r.glide({1, 60, 2}, 3); });
    for (int i = 0; i < edits; ++i) {
      r.raise(0.0001 * (edits - i));
      r.glide({1, 60, 2}, 3);
    }
    r.glide(kAbove, 700);
    r.glide({2, 19, 1}, 400);
    EXPECT_TRUE(r.last().rendering.touching);
    SCOPED_TRACE(testing::Message() << edits << " edits");
    endTheSame(r, file, 700);
  }
}

// Nor is a mesh built again for as long as its check asks for.
TEST(RecordingBegunLate, PausesAfterACheckAsLong) {
  for (const int begun_ms : {100, 260}) {
    const RecordingFile file;
    LateRecording r;
    r.glide({1, 60, 2}, 700);
    r.upload(
        0, 0.001, 12, [](int) {}, [] {});
    r.glide({1, 60, 2}, begun_ms);
    r.record(file.path());
    r.slowDown(4 * LateRecording::kTick);
    for (int i = 0; i < 100; ++i) {
      r.raise(0.0001 * (100 - i));
      r.glide({1, 60, 2}, 3);
    }
    r.glide(kAbove, 700);
    r.glide({2, 19, 1}, 400);
    EXPECT_TRUE(r.last().rendering.touching);
    SCOPED_TRACE(testing::Message() << "begun after " << begun_ms << " ms");
    endTheSame(r, file, 700);
  }
}

struct Upload {
  const char* name;
  std::int32_t object;  // 0 has a mesh already
  int every_ms;         // so long that a part is published before the rest has come, or not
  int begin;            // of the recording: before this triangle
  int triangles = 12;
  double height_mm = 30;  // of the hand: in the box, or on the mesh that was there before
};

void PrintTo(const Upload& upload, std::ostream* out) {
  *out << upload.name;
}

const Upload kUploads[] = {
    {"first", 1, 3, 6},
    {"firstAtItsBegin", 1, 3, 0},
    {"firstAtItsEnd", 1, 3, 11},
    {"slow", 1, 19, 6},
    {"slowAfterAPart", 1, 25, 6},
    // After 250 ms all is published, however soon it came.
    {"longUntilShown", 1, 19, 6, 14},
    {"another", 0, 3, 6},
    {"anotherSlow", 0, 19, 6},
    {"anotherLongUntilShown", 0, 19, 6, 14},
    {"anotherOnTheFirst", 0, 19, 0, 14, 18},
};

class RecordingOfAnUpload : public testing::TestWithParam<Upload> {};

// A mesh around the hand does not push it out: the hand leaves to the side and comes back from above.
TEST_P(RecordingOfAnUpload, ShowsTheMeshWhenItWasShown) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::AddObject{1, -1});
  r.send(scene::SetSurface{1, 0.8, 0.001, 0.4, 0.3});
  r.glide(kAbove, 700);
  const auto begin = [&](int triangle) {
    if (triangle == GetParam().begin) r.record(file.path());
  };
  r.upload(GetParam().object, 0.021, GetParam().triangles, begin, [&] {
    r.glide({1, GetParam().height_mm, 2}, GetParam().every_ms);
  });
  r.glide({80, GetParam().height_mm, 2}, 600);
  r.glide({80, 70, 2}, 300);
  r.glide({1, 70, 2}, 400);
  r.glide({2, 38, 1}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_GT(compared.ticks, 900U);
  EXPECT_GT(compared.touching, 200U);
}

// The servo ramps out the forces of a client that left, before the scene does.
TEST(RecordingOfABusyScene, HasTheTimeAtWhichAClientLeft) {
  for (const bool late : {false, true}) {
    const RecordingFile file;
    LateRecording r;
    r.glide(kAbove, 700);
    if (!late) r.record(file.path());
    pullAndPush(r, 2);
    r.glide(kAbove, 300);
    r.leaveBusyScene(2);
    r.glide(kAbove, 20);
    if (late) r.record(file.path());
    r.glide(kAbove, 150);
    r.leave(2);
    pullAndPush(r, 2);  // another client of this number would not be ramped out
    r.glide(kAbove, 400);
    r.end();
    const Compared compared = rerender(file.path()).front();
    EXPECT_GT(compared.ticks, 500U);
    EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
    EXPECT_EQ(compared.largest_N, 0);
    removeBlocks(file.path(), record::BlockKind::left);
    EXPECT_GT(rerender(file.path()).front().largest_N, 0.1) << "without it";
  }
}

// Only the simulated arm goes without one.
TEST(RecordingOfAnArm, HasItsPassivityController) {
  const RecordingFile file;
  LateRecording r(0.1);
  r.glide(kAbove, 700);
  r.record(file.path());
  for (int i = 0; i < 10; ++i) {
    r.glide({1, 18, 2}, 40);
    r.glide({1, 22, 2}, 40);
  }
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_GT(compared.touching, 200U);
  removeBlocks(file.path(), record::BlockKind::passivity);
  EXPECT_GT(rerender(file.path()).front().largest_N, 1e-3) << "without it";
}

// As of one whose heartbeats came late.
TEST(RecordingOfABusyScene, HasTheReturnOfAClientsForces) {
  const RecordingFile file;
  LateRecording r;
  r.glide(kAbove, 700);
  r.record(file.path());
  pullAndPush(r, 2);
  r.glide(kAbove, 300);
  r.leaveBusyScene(2);
  r.glide(kAbove, 300);
  EXPECT_LT(r.last().force_N.norm(), 1e-3);
  r.comeBack(2);
  pullAndPush(r, 2);
  r.glide(kAbove, 300);
  EXPECT_GT(r.last().force_N.norm(), 0.1);
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, 800U);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
}

// Energy that streamed forces and contacts spent before the recording is missing in it, too.
TEST(RecordingBegunLate, HasTheTanksOfStreamedForces) {
  const RecordingFile file;
  LateRecording r;
  std::uint64_t number = 0;
  const auto streamFor = [&](int rounds, const geometry::Vec3& to_mm) {
    for (int i = 0; i < rounds; ++i) {
      realtime::RemoteInput input = streamed(r, ++number);
      input.contacts.contacts[0].point_m.y() = i % 2 == 0 ? 0.031 : 0.036;
      input.force.number = number;
      input.force.received = r.now();
      input.force.lifetime = 100'000'000;
      input.force.force_N = {1.5, 0, 0};
      r.stream(input);
      r.glide(to_mm, 10);
    }
  };
  r.glide(kAbove, 500);
  streamFor(40, {60, 30, 2});
  EXPECT_LT(r.last().remote.energy_J, 0.012) << "it was spent";
  r.glide({60, 30, 2}, 350);
  r.record(file.path());
  r.glide({60, 30, 2}, 50);
  EXPECT_LT(r.last().remote.energy_J, 0.019) << "less than a new one starts with";
  streamFor(40, {120, 30, 2});
  r.glide({120, 30, 2}, 300);
  streamFor(20, {180, 30, 2});
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_GT(compared.ticks, 900U);
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_EQ(compared.largest_N, 0);
  removeBlocks(file.path(), record::BlockKind::remoteMemory);
  EXPECT_GT(rerender(file.path()).front().largest_N, 0.01) << "without it";
}

struct Movement {
  const char* name;
  bool deforms;
  int every_ms;  // before the way, of at most 50 ms, is over, or after
  bool before;   // the recording begins
};

void PrintTo(const Movement& movement, std::ostream* out) {
  *out << movement.name;
}

const Movement kMovements[] = {
    {"quicklyMoved", false, 20, true},        {"slowlyMoved", false, 70, true},
    {"quicklyDeformed", true, 20, true},      {"slowlyDeformed", true, 70, true},
    {"quicklyMovedThen", false, 20, false},   {"slowlyMovedThen", false, 70, false},
    {"quicklyDeformedThen", true, 20, false}, {"slowlyDeformedThen", true, 70, false}};

class RecordingOfMovements : public testing::TestWithParam<Movement> {};

// A recording has its objects at the ends of their ways, and nothing of the intervals at which a client moved
// them, which set the duration of the next way.
TEST_P(RecordingOfMovements, GivesTheRecordedForcesOnceTheSceneHasSettled) {
  const RecordingFile file;
  LateRecording r;
  const auto move = [&](const geometry::Vec3& hand_mm) {
    for (int i = 0; i < 9; ++i) {
      const double y_m = i % 2 == 0 ? 0.004 : 0;
      GetParam().deforms ? r.raise(y_m) : r.move(y_m);
      r.glide(hand_mm, GetParam().every_ms);
    }
  };
  r.glide({1, 21, 2}, 700);
  if (GetParam().before) {
    r.glide(kAbove, 300);
    move(kAbove);
  }
  r.record(file.path());
  r.glide(kAbove, 5);
  move({1, 19, 2});
  r.glide({1, 35, 2}, 300);
  move({1, 19, 2});
  r.end();
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.same, compared.ticks) << compared.firstDifference;
  EXPECT_EQ(compared.largest_N, 0);
  EXPECT_GT(compared.ticks, 200U);
  EXPECT_GT(compared.touching, 80U);
}

// Older versions wrote the same without the memory of the servo.
TEST(RecordingBegunLateByAnOlderVersion, IsReadAndSaysWhatIsMissing) {
  const RecordingFile file;
  LateRecording r;
  r.send(scene::DefineEffect{"vibrationMotor", 3, 0, 0.4, 0, 33.3, geometry::Vec3::Zero(), {1, 0, 0}});
  r.send(scene::StartEffect{3});
  r.glide(kAbove, 713);
  r.record(file.path());
  r.glide(kAbove, 300);
  r.end();
  EXPECT_TRUE(knowsPast(file.path()));
  removeBlocks(file.path(), record::BlockKind::memory);
  EXPECT_FALSE(knowsPast(file.path()));
  const Compared compared = rerender(file.path()).front();
  EXPECT_EQ(compared.ticks, 299U);
  EXPECT_LT(compared.same, compared.ticks) << "the vibration began anew";
}

// The index of the scene keeps room for ways that a copy does not know.
TEST(RecordingBegunLate, DoesNotDependOnBoxesOfEarlierMovement) {
  const RecordingFile file;
  LateRecording r;
  r.glide({1, 40, 2}, 100);
  for (const std::int32_t far : {1, 2}) {
    r.send(scene::AddObject{far, -1});
    r.send(scene::SetVertices{far, 0, {{-0.01F, 0, -0.01F}, {0, 0, 0.01F}, {0.01F, 0, -0.01F}}});
    r.send(scene::SetSurface{far, 0.8, 0.001, 0.4, 0.3});
    r.send(scene::SetObjectPosition{far, {0.5 * far, 0.5, 0}});
  }
  r.glide({1, 40, 2}, 50);
  for (int i = 0; i < 30; ++i) {
    r.send(scene::SetObjectPosition{0, {0.06 - 0.001 * i, 0, 0}});
    r.glide({1, 40, 2}, 10);
  }
  r.send(scene::SetPlane{0, {0, 1, 0, -0.0195}, 0.3, 0.001, 0.2, 0.1, 10});
  r.glide({1, 30, 2}, 700);
  r.record(file.path());
  r.glide({1, 30, 2}, 50);
  r.glide({1, 19, 2}, 400);
  EXPECT_TRUE(r.last().rendering.touching);
  endTheSame(r, file, 400);
}

INSTANTIATE_TEST_SUITE_P(All, RecordingBegunLate, testing::ValuesIn(kGoesOn),
                         [](const auto& param) { return std::string(param.param.name); });
INSTANTIATE_TEST_SUITE_P(All, RecordingOfAnUpload, testing::ValuesIn(kUploads),
                         [](const auto& param) { return std::string(param.param.name); });
INSTANTIATE_TEST_SUITE_P(All, RecordingOfMovements, testing::ValuesIn(kMovements),
                         [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace hapticd::test
