// Commands, snapshots, sharing and batches.
#include <gmock/gmock.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using ::testing::HasSubstr;
using Severity = Notice::Severity;

using Builder = SceneTest;

TEST_F(Builder, FirstSnapshotIsTheInitialScene) {
  ASSERT_TRUE(scene_);
  EXPECT_EQ(scene_->revision, 1U);
  EXPECT_TRUE(scene_->objects.empty());
  ASSERT_TRUE(scene_->objectIndex);
  EXPECT_EQ(scene_->objectIndex->size(), 0U);
  EXPECT_EQ(scene_->faces, TouchableFaces::both);
  EXPECT_DOUBLE_EQ(scene_->workspace.worldUnitsPerMetre, 1000);
  EXPECT_FALSE(publish()) << "nothing changed";
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
}

TEST_F(Builder, ObjectWithoutStiffnessOrTrianglesIsNotFelt) {
  say(SetVertices{0, 0, oneTriangle()});
  wait(20 * kMillisecond);
  publish();
  EXPECT_EQ(object(0), nullptr);
  say(SetSurfaceProperty{0, "stiffness", 0.5});
  EXPECT_TRUE(publish());
  ASSERT_NE(object(0), nullptr);
  EXPECT_DOUBLE_EQ(object(0)->surface.stiffness_N_per_m, 250);
  say(ClearMesh{0});
  EXPECT_TRUE(publish());
  EXPECT_EQ(object(0), nullptr);
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Builder, MovingOneObjectSharesEverythingElse) {
  makeTouchable(0);
  makeTouchable(1);
  makeTouchable(2);
  const auto before = scene_;
  say(SetTransform{1, columns(at(5, 0, 0))});
  ASSERT_TRUE(publish());
  ASSERT_EQ(scene_->objects.size(), 3U);
  EXPECT_EQ(scene_->objects[0], before->objects[0]);
  EXPECT_NE(scene_->objects[1], before->objects[1]);
  EXPECT_EQ(scene_->objects[2], before->objects[2]);
  EXPECT_EQ(scene_->objects[1]->mesh, before->objects[1]->mesh);
}

TEST_F(Builder, StartingAnEffectSharesAllObjectsAndTheIndex) {
  makeTouchable(0);
  makeTouchable(1);
  const auto before = scene_;
  say(DefineEffect{.type = "constant", .index = 1, .magnitude_N = 1, .direction = Vec3::UnitX()});
  say(StartEffect{1});
  ASSERT_TRUE(publish());
  EXPECT_EQ(scene_->objects, before->objects);
  EXPECT_EQ(scene_->objectIndex, before->objectIndex);
  EXPECT_EQ(scene_->effects.size(), 1U);
}

TEST_F(Builder, TouchableFlagTakesAnObjectOutAndBringsItBack) {
  makeTouchable(0);
  const auto mesh = object(0)->mesh;
  say(SetTouchable{0, false});
  ASSERT_TRUE(publish());
  EXPECT_EQ(object(0), nullptr);
  say(SetTouchable{0, true});
  ASSERT_TRUE(publish());
  ASSERT_NE(object(0), nullptr);
  EXPECT_EQ(object(0)->mesh, mesh);
}

TEST_F(Builder, ObjectsAreListedByAscendingIdAndTheIndexFindsThem) {
  for (const int id : {4, 0, 2}) {
    makeTouchable(id);
    say(SetTransform{id, columns(at(100.0 * id, 0, 0))});
  }
  ASSERT_TRUE(publish());
  ASSERT_EQ(scene_->objects.size(), 3U);
  EXPECT_EQ(scene_->objects[0]->id, 0);
  EXPECT_EQ(scene_->objects[1]->id, 2);
  EXPECT_EQ(scene_->objects[2]->id, 4);
  for (std::uint32_t position = 0; position < 3; ++position) {
    int found = 0;
    const Vec3 corner(100.0 * scene_->objects[position]->id, 0, 0);
    scene_->objectIndex->visitNear(corner, 1, [&](std::uint32_t i) { found += i == position ? 1 : 0; });
    EXPECT_EQ(found, 1) << position;
  }
}

TEST_F(Builder, FacesFollowTheWire) {
  for (const auto& [wire, faces] : {std::pair{0, TouchableFaces::front}, std::pair{1, TouchableFaces::back},
                                    std::pair{2, TouchableFaces::both}, std::pair{3, TouchableFaces::both},
                                    std::pair{-1, TouchableFaces::both}}) {
    say(SetTouchableFaces{wire});
    ASSERT_TRUE(publish());
    EXPECT_EQ(scene_->faces, faces) << wire;
  }
}

TEST_F(Builder, BatchIsOneRevisionAndItsMeshesAreFeltAtOnce) {
  say(BeginBatch{});
  say(SetObjectNumber{2});
  say(SetVertices{1, 0, oneTriangle()});
  say(SetSurfaceProperty{1, "stiffness", 1});
  say(SetTransform{1, columns(at(1, 2, 3))});
  say(SetSurfaceProperty{0, "mass", 1}, kClient + 1);  // others are not held back
  publish();
  EXPECT_EQ(object(1), nullptr);
  const auto revision = scene_->revision;
  say(CommitBatch{});
  ASSERT_TRUE(publish());
  EXPECT_EQ(scene_->revision, revision + 1);
  ASSERT_NE(object(1), nullptr);
  EXPECT_EQ(object(1)->motion.at(now_).translation(), Vec3(1, 2, 3));
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Builder, BatchOfAClientThatLeavesNeverHappens) {
  say(BeginBatch{});
  say(SetTouchableFaces{0});
  builder_.clientGone(kClient, now_);
  run(500 * kMillisecond);
  EXPECT_EQ(scene_->faces, TouchableFaces::both);
  say(CommitBatch{});
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("no batch was begun"));
}

TEST_F(Builder, ResetBringsTheInitialSceneAndOldNumbersNeverComeBack) {
  makeTouchable(0);
  makeTouchable(3);
  const std::uint32_t jumps = object(0)->motion.jumps();
  const std::uint64_t topology = object(0)->mesh->topology;
  say(SetTouchableFaces{1});
  say(SetWorkspaceBox{columns(Affine(Affine::Identity())), {-1, -1, -1, 1, 1, 1}});
  publish();
  say(ResetScene{});
  ASSERT_TRUE(publish());
  EXPECT_TRUE(scene_->objects.empty());
  EXPECT_EQ(scene_->faces, TouchableFaces::both);
  EXPECT_DOUBLE_EQ(scene_->workspace.worldUnitsPerMetre, 1000);
  say(SetVertices{3, 0, oneTriangle()});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("no such object"));
  makeTouchable(0);
  ASSERT_NE(object(0), nullptr);
  EXPECT_GT(object(0)->motion.jumps(), jumps);
  EXPECT_NE(object(0)->mesh->topology, topology);
}

// Every refusal names the call and leaves the scene as it was: no new snapshot comes of it.
TEST_F(Builder, RefusalsLeaveTheSceneAsItWas) {
  makeTouchable(0);
  makeTouchable(1);
  say(DefineEffect{.type = "spring", .index = 3, .gain = 0.1, .magnitude_N = 1});
  say(StartEffect{3});
  publish();
  const double nan = std::nan("");
  const double inf = INFINITY;
  geometry::Mat4 projective = geometry::Mat4::Identity();
  projective(3, 0) = 0.5;
  geometry::Mat4 singular = geometry::Mat4::Identity();
  singular(1, 1) = 0;
  geometry::Mat4 notFinite = geometry::Mat4::Identity();
  notFinite(0, 3) = nan;
  std::array<float, 16> zeros{};
  const auto identity = columns(Affine(Affine::Identity()));
  const std::pair<const char*, SceneCommand> cases[] = {
      {"setObjectNumber", SetObjectNumber{-1}},
      {"setObjectNumber", SetObjectNumber{10'001}},
      {"setObjectVertex", SetVertices{2, 0, oneTriangle()}},
      {"setObjectVertex", SetVertices{-1, 0, oneTriangle()}},
      {"setObjectVertex", SetVertices{0, -1, oneTriangle()}},
      {"setObjectVertex", SetVertices{0, 0x7FFFFFFF, oneTriangle()}},
      {"setObjectVertex", SetVertices{0, 1, {Vec3f(1, NAN, 1)}}},
      {"setObjectVertex", SetVertices{0, 7, {Vec3f(1, NAN, 1)}}},
      {"setTriangle", SetTriangles{9, 0, {Triangle{0, 1, 2}}}},
      {"setTriangle", SetTriangles{0, -5, {Triangle{0, 1, 2}}}},
      {"setTriangle", SetTriangles{0, 0x7FFFFFFF, {Triangle{0, 1, 2}}}},
      {"setTriangle", SetTriangles{0, 0, {Triangle{0, 1, 0xFFFFFFFF}}}},
      {"removeTriangle", RemoveTriangle{0, 0}},
      {"clearTrimesh", ClearMesh{77}},
      {"transformTrimesh", TransformMesh{0, zeros}},
      {"addObject", AddObject{-1, -1}},
      {"addObject", AddObject{10'000, -1}},
      {"addObject", AddObject{5, 6}},
      {"addObjectExScene", AddObjectExScene{-3}},
      {"moveToParent", MoveToParent{0, 5}},
      {"moveToParent", MoveToParent{0, 0}},
      {"removeObject", RemoveObject{5}},
      {"setTransformMatrix", SetTransform{2, identity}},
      {"setTransformMatrix", SetTransform{0, columns(projective)}},
      {"setTransformMatrix", SetTransform{0, columns(singular)}},
      {"setTransformMatrix", SetTransform{0, columns(notFinite)}},
      {"setObjectPosition", SetObjectPosition{0, Vec3(nan, 0, 0)}},
      {"setObjectPosition", SetObjectPosition{4, Vec3(1, 0, 0)}},
      {"setObjectOrientation", SetObjectOrientation{0, Vec3::Zero(), 1}},
      {"setObjectOrientation", SetObjectOrientation{0, Vec3::UnitX(), inf}},
      {"setObjectScale", SetObjectScale{0, Vec3(1, 0, 1)}},
      {"setObjectIsTouchable", SetTouchable{2, false}},
      {"setHapticProperty", SetSurfaceProperty{2, "stiffness", 0.1}},
      {"setHapticProperty", SetSurfaceProperty{0, "stiffness", nan}},
      {"updateTrimeshChanges", SetSurface{2}},
      {"updateTrimeshChanges", SetSurface{0, nan, 0, 0, 0}},
      {"setSceneOrigin", SetSceneOrigin{Vec3(inf, 0, 0)}},
      {"setWorkspaceProjectionMatrix", SetWorkspaceProjection{identity, columns(singular)}},
      {"setWorkspaceProjectionMatrix", SetWorkspaceProjection{columns(singular), identity}},
      {"setWorkspaceBoundingBox", SetWorkspaceBox{identity, {0, 0, 0, 0, 0, 0}}},
      {"setWorkspaceBoundingBox", SetWorkspaceBox{identity, {0, 0, nan, 1, 1, 1}}},
      {"setWorkspaceBoundingBox", SetWorkspaceBox{columns(notFinite), {0, 0, 0, 1, 1, 1}}},
      {"setHapticOrigin", SetHapticOrigin{Vec3(nan, 0, 0)}},
      {"setHapticScale", SetHapticScale{0}},
      {"setHapticScale", SetHapticScale{-2}},
      {"setEffect", DefineEffect{.type = "magnet", .index = 1}},
      {"setEffect", DefineEffect{.type = "spring", .index = -1}},
      {"setEffect", DefineEffect{.type = "spring", .index = 1, .gain = nan}},
      {"setEffect", DefineEffect{.type = "constant", .index = 1, .direction = Vec3(nan, 0, 0)}},
      {"sendSurface", SetPlane{.index = -1, .plane = {0, 1, 0, 0}}},
      {"sendSurface", SetPlane{.index = kMaxPlanes, .plane = {0, 1, 0, 0}}},
      {"sendSurface", SetPlane{.index = 0, .plane = {0, 1, 0, nan}}},
      {"sendSurface", SetPlane{.index = 0, .plane = {0, 1, 0, 0}, .stiffness = inf}},
      {"sendSurface", SetPlaneDetail{.buzzFrequency_Hz = -1}},
      {"sendForceField", SetForceField{.force_N = Vec3(nan, 0, 0)}},
      {"constraint_mode", SetConstraintMode{4}},
      {"constraint", SetConstraintVector{ConstraintVector::lineDirection, Vec3::Zero()}},
      {"constraint_KSpring", SetConstraintStiffness{-1}},
      {"startEffect", StartCustomEffect{0, {NAN}}},
  };
  for (const auto& [name, command] : cases) {
    notices_.clear();
    SceneCommand copy = command;
    builder_.apply(kClient, std::move(copy), now_, notices_);
    ASSERT_EQ(notices_.size(), 1U) << name << " #" << (&command - &cases[0].second);
    EXPECT_EQ(notices_[0].severity, Severity::error) << notices_[0].text;
    EXPECT_THAT(notices_[0].text, ::testing::StartsWith(name));
    EXPECT_EQ(notices_[0].client, kClient);
    wait(2'000 * kMillisecond);  // past every throttle and every deadline
    EXPECT_FALSE(publish()) << notices_[0].text;
  }
}

TEST_F(Builder, IgnoredCallsSayWhy) {
  say(SetNormal{0});
  EXPECT_THAT(onlyNotice(Severity::normal), HasSubstr("follow from the triangles"));
  say(SetTrimeshType{-1, 1});
  EXPECT_THAT(onlyNotice(Severity::normal), HasSubstr("one way to collide"));
  EXPECT_FALSE(publish());
}

TEST_F(Builder, SameComplaintAgainAndAgainIsCounted) {
  for (int i = 0; i < 1000; ++i) say(SetTransform{50, columns(at(i, 0, 0))});
  EXPECT_EQ(notices_.size(), 1U);
  for (int id = 100; id < 1100; ++id) say(SetTransform{id, columns(at(0, 0, 0))});
  EXPECT_LE(notices_.size(), 10U);
  const std::size_t shown = notices_.size();
  say(SetTransform{50, columns(at(0, 0, 0))}, kClient + 1);
  EXPECT_EQ(notices_.size(), shown + 1) << "another client hears of its own";
  notices_.clear();
  ASSERT_TRUE(builder_.nextDeadline());
  run(1'000 * kMillisecond);
  ASSERT_EQ(notices_.size(), 1U);
  EXPECT_EQ(notices_[0].text,
            std::to_string(2000 - shown) +
                " more like this; the last: setTransformMatrix object 1099: refused: there is no "
                "such object; call setObjectNumber or addObject first");
  run(2'000 * kMillisecond);
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
}

#ifndef HAPTICD_SANITIZED  // which keep freed memory
double resident_MB() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmRSS:")) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

// As a server: its memory is locked, so that the heap cannot give back what it does not need.
TEST_F(Builder, BatchOfAClientThatLeavesKeepsNoMemory) {
  const bool locked = ::mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) == 0;
  say(BeginBatch{}, 2);
  const double before = resident_MB();
  for (int i = 0; i < 300'000; ++i) {
    say(SetVertices{0, i, {Vec3f::Zero()}}, 2);
    if (i % 100 == 0) say(SetVertices{0, i % 60'000, {Vec3f::Zero()}});  // lives on between the others
  }
  const double during = resident_MB();
  ASSERT_GT(during, before + 30);
  builder_.clientGone(2, now_);
  EXPECT_LT(resident_MB(), before + (during - before) / 2) << (locked ? "locked" : "not locked");
  if (locked) ::munlockall();
}

// The address space that the process has is all that it gets.
class NoFurtherMemory {
 public:
  NoFurtherMemory() {
    std::size_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    getrlimit(RLIMIT_AS, &before_);
    rlimit now = before_;
    now.rlim_cur = pages * static_cast<std::size_t>(getpagesize());
    EXPECT_EQ(setrlimit(RLIMIT_AS, &now), 0);
  }
  ~NoFurtherMemory() { setrlimit(RLIMIT_AS, &before_); }

 private:
  rlimit before_{};
};

TEST_F(Builder, BatchThatFindsNoMemoryIsRefusedAsAWhole) {
  builder_.apply(1, BeginBatch{}, now_, notices_);
  {
    const NoFurtherMemory limit;
    builder_.apply(1, SetTouchableFaces{0}, now_, notices_);
  }
  builder_.apply(1, SetTouchableFaces{1}, now_, notices_);
  builder_.apply(1, CommitBatch{}, now_, notices_);
  ASSERT_EQ(notices_.size(), 1U);
  EXPECT_THAT(notices_[0].text, HasSubstr("out of memory"));
  EXPECT_FALSE(publish()) << "nothing of it is carried out";
  say(BeginBatch{});
  say(SetTouchableFaces{1});
  say(CommitBatch{});
  EXPECT_TRUE(publish());
}
#endif

TEST_F(Builder, BatchThatIsTooLongIsRefusedAsAWhole) {
  SceneConfig config = simulated({});
  config.limits.batch_bytes = 10'000;
  SceneBuilder builder(config);
  builder.publish(now_, notices_);
  builder.apply(1, BeginBatch{}, now_, notices_);
  for (int i = 0; i < 1000; ++i) builder.apply(1, SetTouchableFaces{0}, now_, notices_);
  builder.apply(1, CommitBatch{}, now_, notices_);
  ASSERT_FALSE(notices_.empty());
  EXPECT_THAT(notices_[0].text, HasSubstr("too long"));
  EXPECT_EQ(builder.publish(now_, notices_), nullptr);
  builder.apply(1, BeginBatch{}, now_, notices_);
  builder.apply(1, SetTouchableFaces{0}, now_, notices_);
  builder.apply(1, CommitBatch{}, now_, notices_);
  EXPECT_NE(builder.publish(now_, notices_), nullptr);
}

TEST_F(Builder, BatchesOfAllClientsTogetherAreLimited) {
  SceneConfig config = simulated({});
  config.limits.batch_bytes = 1'000'000;
  SceneBuilder builder(config);
  builder.publish(now_, notices_);
  const auto fill = [&](ClientId client) {
    builder.apply(client, BeginBatch{}, now_, notices_);
    for (int i = 0; i < 2000; ++i) builder.apply(client, SetTouchableFaces{0}, now_, notices_);
  };
  // Each alone has room.
  ClientId last = 0;
  while (notices_.empty() && last < 100) fill(++last);
  ASSERT_FALSE(notices_.empty());
  EXPECT_GT(last, 1U);
  EXPECT_EQ(notices_[0].client, last) << "those that came before keep theirs";
  EXPECT_THAT(notices_[0].text, HasSubstr("refused as a whole: too long"));
  builder.apply(1, CommitBatch{}, now_, notices_);
  EXPECT_NE(builder.publish(now_, notices_), nullptr);
  // What a commit, a refusal or the end of a client gave back is there for others.
  for (ClientId client = 2; client < last; ++client) builder.clientGone(client, now_);
  notices_.clear();
  fill(last + 1);
  EXPECT_TRUE(notices_.empty());
}

}  // namespace
}  // namespace hapticd::scene
