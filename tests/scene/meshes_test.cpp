// Uploads, commits, deformation.
#include <gmock/gmock.h>

#include <limits>
#include <set>

#include "scene/mesh_draft.h"
#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using ::testing::HasSubstr;
using Severity = Notice::Severity;

class Meshes : public SceneTest {
 protected:
  Meshes() {
    say(SetSurfaceProperty{0, "stiffness", 0.5});
    publish();
  }
  std::size_t triangles() const { return object(0) == nullptr ? 0 : object(0)->mesh->triangles->size(); }
  /// Ids that the index can propose.
  std::size_t touchable() const {
    std::set<std::uint32_t> ids;
    if (object(0) == nullptr) return 0;
    object(0)->mesh->index.visitNear(Vec3::Zero(), INFINITY, [&](std::uint32_t id) { ids.insert(id); });
    return ids.size();
  }
  Vec3 vertex(std::uint32_t i) const { return object(0)->mesh->vertex(i, now_); }
};

TEST_F(Meshes, AreFeltTwentyMillisecondsAfterTheLastVertex) {
  const auto vertices = soup(2);
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    say(SetVertices{0, static_cast<std::int32_t>(i), {vertices[i]}});
    EXPECT_FALSE(publish());
    wait(10 * kMillisecond);
  }
  EXPECT_EQ(builder_.nextDeadline(), now_ + 10 * kMillisecond);
  wait(10 * kMillisecond - 1);
  EXPECT_FALSE(publish());
  wait(1);
  EXPECT_TRUE(publish());
  EXPECT_EQ(triangles(), 2U);
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
}

TEST_F(Meshes, AreFeltAtLatestEveryQuarterOfASecondWhileTheyStream) {
  const Nanos start = now_;
  std::vector<Nanos> published;
  for (int i = 0; i < 600; ++i) {
    const auto x = static_cast<float>(i);
    say(SetVertices{0, i, {Vec3f(x, i % 3 == 0 ? 1.F : 0.F, 0)}});
    if (publish()) published.push_back(now_ - start);
    wait(kMillisecond);
  }
  EXPECT_EQ(published, (std::vector<Nanos>{250 * kMillisecond, 501 * kMillisecond}));
}

TEST_F(Meshes, RebuildingTakesAtMostAQuarterOfTheThread) {
  // The stopwatch says that every look at it takes 10 ms.
  Nanos worked = 0;
  SceneConfig config;
  config.stopwatch = [&] { return worked += 10 * kMillisecond; };
  SceneBuilder builder(config);
  std::vector<Notice> notices;
  builder.publish(now_, notices);
  const Nanos start = now_;
  builder.apply(1, SetSurfaceProperty{0, "stiffness", 1}, now_, notices);
  constexpr Nanos kTime = 10'000 * kMillisecond;
  int rebuilds = 0;
  for (int i = 0; now_ < start + kTime; ++i, wait(kMillisecond)) {
    const auto x = static_cast<float>(i);
    builder.apply(1, SetVertices{0, i, {Vec3f(x, static_cast<float>(i % 3), 0)}}, now_, notices);
    const Nanos before = worked;
    if (builder.publish(now_, notices)) {
      ++rebuilds;
    } else {
      worked = before;  // looking alone costs nothing
    }
    now_ += worked - before;
  }
  EXPECT_GT(worked, kTime / 10);
  EXPECT_LE(worked, kTime / 4 + 100 * kMillisecond);
  EXPECT_GT(rebuilds, 10);
}

TEST_F(Meshes, IncompleteTripleIsIgnoredUntilItIsComplete) {
  auto vertices = soup(2);
  vertices.pop_back();
  say(SetVertices{0, 0, vertices});
  run(20 * kMillisecond);
  EXPECT_EQ(triangles(), 1U);
  say(SetVertices{0, 5, {Vec3f(2, 1, 0)}});
  run(20 * kMillisecond);
  EXPECT_EQ(triangles(), 2U);
}

TEST_F(Meshes, VerticesAreStoredAtTheirNumberInAnyOrder) {
  const auto vertices = soup(3);
  for (const int i : {8, 7, 6, 0, 2, 1}) say(SetVertices{0, i, {vertices[static_cast<std::size_t>(i)]}});
  run(20 * kMillisecond);
  EXPECT_EQ(triangles(), 3U);
  EXPECT_EQ(touchable(), 2U) << "the middle one has not come";
  for (const int i : {4, 3, 5}) say(SetVertices{0, i, {vertices[static_cast<std::size_t>(i)]}});
  run(20 * kMillisecond);
  EXPECT_EQ(touchable(), 3U);
  EXPECT_EQ(*object(0)->mesh->vertices, vertices);
}

TEST_F(Meshes, SendingTheSameAgainChangesNothing) {
  say(SetVertices{0, 0, soup(100)});
  run(20 * kMillisecond);
  say(SetVertices{0, 0, soup(100)});
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
}

TEST_F(Meshes, TrianglesMakeTheMeshIndexedAndIncompleteOnesAreNotFelt) {
  say(SetTriangles{0, 0, {Triangle{0, 1, 2}, Triangle{2, 1, 3}, Triangle{3, 2, 9}}});
  say(SetVertices{0, 0, {Vec3f(0, 0, 0), Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(1, 1, 0)}});
  run(20 * kMillisecond);
  EXPECT_EQ(triangles(), 3U);
  EXPECT_EQ(touchable(), 2U);
  for (const Triangle& t : *object(0)->mesh->triangles) {
    for (const std::uint32_t i : t) EXPECT_LT(i, object(0)->mesh->vertices->size());
  }
  say(SetVertices{0, 9, {Vec3f(2, 2, 0)}});
  run(20 * kMillisecond);
  EXPECT_EQ(touchable(), 3U) << "its vertex came later";
  say(RemoveTriangle{0, 1});
  run(20 * kMillisecond);
  EXPECT_EQ(touchable(), 2U);
  say(RemoveTriangle{0, 1});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("no such triangle"));
  say(ClearMesh{0});
  EXPECT_TRUE(publish()) << "at once";
  EXPECT_EQ(object(0), nullptr);
  say(SetVertices{0, 0, soup(1)});
  run(20 * kMillisecond);
  EXPECT_EQ(triangles(), 1U) << "triples again";
}

TEST_F(Meshes, VertexThatIsNoNumberStaysAsItWas) {
  say(SetVertices{0, 0, soup(2)});
  run(20 * kMillisecond);
  auto bad = soup(2, 5);
  bad[1].x() = NAN;
  bad[4].y() = INFINITY;
  say(SetVertices{0, 0, bad});
  EXPECT_THAT(onlyNotice(Severity::error),
              HasSubstr("object 0, vertex 1 at nan   0   5 and 1 more: refused"));
  run(1'000 * kMillisecond);
  EXPECT_EQ(vertex(0).z(), 5);
  EXPECT_EQ(vertex(1), Vec3(1, 0, 0));
  EXPECT_EQ(vertex(4), Vec3(3, 0, 0));
  EXPECT_EQ(vertex(5).z(), 5);
}

TEST_F(Meshes, FinishedByUpdateTrimeshChanges) {
  say(SetTriangles{0, 0, {Triangle{0, 1, 2}}});
  say(SetVertices{0, 0, soup(1)});
  EXPECT_FALSE(publish() && triangles() > 0);
  say(SetSurface{0, 0.5, 0.001, 0.4, 0.3});
  EXPECT_TRUE(publish());
  EXPECT_EQ(triangles(), 1U);
  EXPECT_DOUBLE_EQ(object(0)->surface.stiffness_N_per_m, 500);
  EXPECT_DOUBLE_EQ(object(0)->surface.damping_Ns_per_m, 1);
  EXPECT_DOUBLE_EQ(object(0)->surface.staticFriction, 0.4);
  EXPECT_DOUBLE_EQ(object(0)->surface.dynamicFriction, 0.3);
}

TEST_F(Meshes, LimitsHoldForOneObjectAndForAll) {
  SceneConfig config = simulated({});
  config.limits.verticesPerObject = 100;
  config.limits.verticesInAll = 150;
  config.limits.trianglesPerObject = 10;
  builder_ = SceneBuilder(config);
  say(SetObjectNumber{3});
  say(SetVertices{0, 100, soup(1)});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("beyond the limit of one object"));
  say(SetVertices{0, 0, std::vector<Vec3f>(100, Vec3f::Zero())});
  say(SetVertices{1, 0, std::vector<Vec3f>(51, Vec3f::Zero())});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("the scene is full"));
  say(SetVertices{1, 0, std::vector<Vec3f>(50, Vec3f::Zero())});
  say(SetVertices{0, 50, std::vector<Vec3f>(50, Vec3f::Ones())});
  EXPECT_TRUE(notices_.empty()) << "in place there is room";
  say(ClearMesh{0});
  say(SetVertices{1, 50, std::vector<Vec3f>(50, Vec3f::Zero())});
  say(SetVertices{2, 0, std::vector<Vec3f>(50, Vec3f::Zero())});
  EXPECT_TRUE(notices_.empty()) << "cleared meshes give their room back";
  say(RemoveObject{1});
  say(SetVertices{0, 0, std::vector<Vec3f>(100, Vec3f::Zero())});
  EXPECT_TRUE(notices_.empty()) << "removed objects too";
  say(SetTriangles{2, 8, std::vector<Triangle>(3, Triangle{0, 1, 2})});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("setTriangle"));
  say(ResetScene{});
  say(SetVertices{0, 0, std::vector<Vec3f>(100, Vec3f::Zero())});
  EXPECT_TRUE(notices_.empty());
}

// The decoder makes a run of what one read brings: what is accepted must not depend on that.
TEST_F(Meshes, ARunIsAcceptedLikeItsMessagesOneByOne) {
  say(SetVertices{0, 0, soup(3)});
  say(SetTriangles{0, 0, {{0, 1, 2}, {3, 0xFFFFFFFF, 5}, {6, 7, 8}, {0, 1, 0x7FFFFFFF}}});
  EXPECT_EQ(onlyNotice(Severity::error),
            "setTriangle object 0, triangle 1, vertices 3 -1 5, and 1 after it: refused: no such vertex is "
            "possible");
  makeTouchable(1);
  say(SetSurfaceProperty{0, "stiffness", 0.5});
  publish();
  ASSERT_EQ(triangles(), 3U);
  EXPECT_EQ((*object(0)->mesh->triangles)[0], (Triangle{0, 1, 2}));
  EXPECT_EQ((*object(0)->mesh->triangles)[2], (Triangle{6, 7, 8}));
  say(SetTriangles{1, 0, {{0, 1, 0x7FFFFFFF}}, true});
  notices_.clear();
  say(SetTriangles{0, -2, {{0, 1, 2}, {0, 1, 0x7FFFFFFF}, {0, 1, 2}, {3, 4, 5}}});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("numbers start at 0"));
  run(1'000 * kMillisecond);
  EXPECT_EQ(builder_.describe().objects[1].worldUnits, 1) << "a refused triangle does not declare metres";

  SceneConfig config = simulated({});
  config.limits.verticesPerObject = 100;
  config.limits.verticesInAll = 150;
  config.limits.trianglesPerObject = 10;
  config.limits.trianglesInAll = 100;
  builder_ = SceneBuilder(config);
  say(SetObjectNumber{2});
  say(SetVertices{0, 90, std::vector<Vec3f>(11, Vec3f::Zero())});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("object 0, vertex 100, limit 100"));
  say(SetVertices{1, 0, std::vector<Vec3f>(60, Vec3f::Zero())});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("object 1, vertex 50, limit 150 in all objects"));
  say(SetTriangles{0, 8, std::vector<Triangle>(3, Triangle{0, 1, 2})});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("object 0, triangle 10, limit 10"));
  run(1'000 * kMillisecond);
  const SceneDescription scene = builder_.describe();
  EXPECT_EQ(scene.objects[0].vertices->size(), 100U);
  EXPECT_EQ(scene.objects[0].triangles->size(), 10U);
  EXPECT_EQ(scene.objects[1].triangles->size(), 50U / 3);
}

// Three vertices are a triangle where none are numbered.
TEST_F(Meshes, TriplesCountAmongTheTriangles) {
  SceneConfig config = simulated({});
  config.limits.trianglesInAll = 4;
  builder_ = SceneBuilder(config);
  say(SetObjectNumber{2});
  say(SetVertices{0, 0, soup(3)});
  EXPECT_TRUE(notices_.empty());
  say(SetVertices{1, 0, soup(3)});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("object 1, vertex 5, limit 4 triangles in all objects"));
  say(SetVertices{0, 0, soup(3, 1)});
  EXPECT_TRUE(notices_.empty()) << "in place there is room";
  run(1'000 * kMillisecond);
  EXPECT_EQ(builder_.describe().objects[0].triangles->size(), 3U);
  EXPECT_EQ(builder_.describe().objects[1].triangles->size(), 1U);
  say(SetTriangles{0, 0, {Triangle{0, 1, 2}}});
  say(SetVertices{1, 5, soup(2)});
  EXPECT_TRUE(notices_.empty()) << "numbered triangles take the place of the triples";
}

TEST_F(Meshes, ARefusedVertexAtTheEndOfARunIsNoVertex) {
  auto bad = soup(2);
  bad.back().x() = std::numeric_limits<float>::quiet_NaN();
  say(SetVertices{0, 0, bad});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("object 0, vertex 5 at nan"));
  run(1'000 * kMillisecond);
  EXPECT_EQ(triangles(), 1U);
}

TEST_F(Meshes, VerticesFarBeyondTheOthersShareABoundedNumberOfGaps) {
  say(SetVertices{0, 65'536, soup(1)});
  EXPECT_TRUE(notices_.empty());
  builder_ = SceneBuilder(simulated({}));
  say(SetVertices{0, 1'000'001, soup(1)});
  EXPECT_THAT(
      onlyNotice(Severity::error),
      HasSubstr("setObjectVertex object 0, vertex 1000001, at most 1000000 now: refused: too far beyond"));
  say(SetVertices{0, 15'000'000, soup(1)});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("too far beyond"));
  say(SetObjectNumber{3});
  say(SetVertices{0, 600'000, soup(1)});
  EXPECT_TRUE(notices_.empty());
  say(SetVertices{1, 600'000, soup(1)});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("at most 400000 now"));
  say(SetTriangles{1, 600'000, {{0, 1, 2}}});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("setTriangle"));
  say(ClearMesh{0});
  say(SetVertices{1, 600'000, soup(1)});
  EXPECT_TRUE(notices_.empty()) << "a cleared mesh has no gap";
  say(SetVertices{2, 0, std::vector<Vec3f>(10'000, Vec3f::Zero())});
  say(SetVertices{2, 85'536, soup(1)});
  EXPECT_TRUE(notices_.empty()) << "a large mesh has room for a larger gap";
}

TEST_F(Meshes, WhatIsRefusedTakesNoGap) {
  say(SetObjectNumber{3});
  const Vec3f nowhere = Vec3f::Constant(std::numeric_limits<float>::quiet_NaN());
  say(SetVertices{0, 999'999, {nowhere}});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("not finite"));
  say(SetTriangles{1, 999'999, {{0, 1, 0x7FFFFFFF}}});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("no such vertex"));
  say(SetVertices{2, 999'999, soup(1)});
  EXPECT_TRUE(notices_.empty());
}

// As clients do that number from the end, or that reserve numbers.
TEST_F(Meshes, AreAcceptedFromTheirEnd) {
  say(SetObjectNumber{2});
  constexpr std::int32_t kVertices = 900'000;
  constexpr std::int32_t kRun = 30'000;
  for (std::int32_t object = 0; object < 2; ++object) {
    for (std::int32_t first = kVertices - kRun; first >= 0; first -= kRun)
      say(SetVertices{object, first, std::vector<Vec3f>(kRun, Vec3f(1, 2, 3))});
  }
  EXPECT_TRUE(notices_.empty()) << "the gap of the first object was closed";
}

TEST_F(Meshes, SentFromTheirEndDeformOnceTheyAreComplete) {
  const std::vector<Vec3f> all = soup(50);
  for (const std::int32_t first : {100, 40, 0})
    say(SetVertices{0, first, {all.begin() + first, all.begin() + std::min(first + 60, 150)}});
  run(1'000 * kMillisecond);
  const std::shared_ptr<const MeshGeometry> before = object(0)->mesh;
  EXPECT_EQ(triangles(), 50U);
  say(SetVertices{0, 0, soup(50, 1)});
  run(MeshDraft::kPause);
  EXPECT_EQ(object(0)->mesh->topology, before->topology);
  EXPECT_TRUE(object(0)->mesh->target);
  say(SetVertices{0, 153, soup(1)});
  run(1'000 * kMillisecond);
  EXPECT_NE(object(0)->mesh->topology, before->topology);
  say(SetVertices{0, 0, soup(50)});
  run(1'000 * kMillisecond);
  EXPECT_FALSE(object(0)->mesh->target) << "of the triangle before the last one nothing has come";
}

TEST_F(Meshes, AreCheckedOnceTheyAreComplete) {
  SceneConfig config = simulated({});
  config.checkMeshes = true;
  builder_ = SceneBuilder(config);
  say(SetObjectNumber{2});
  say(SetVertices{0, 0, soup(1)});
  run(100 * kMillisecond);
  say(SetVertices{0, 3, soup(1)});  // the same again, at the other end of its first quarter of a second
  run(200 * kMillisecond);
  EXPECT_TRUE(notices_.empty());
  run(100 * kMillisecond);
  EXPECT_EQ(
      onlyNotice(Severity::normal),
      "mesh of object 0: 1 triangle repeats an earlier one: felt once. 3 edges have a triangle on one side "
      "only: the hand can go around or through there.");
  EXPECT_EQ(builder_.nextDeadline(), now_ + 970 * kMillisecond) << "nothing but the notice board's window";
  run(2'000 * kMillisecond);
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt);
  say(SetVertices{0, 0, soup(2, 1)});
  run(1'000 * kMillisecond);
  EXPECT_TRUE(notices_.empty()) << "positions alone are not a new shape";
  say(SetVertices{1, 0, oneTriangle()}, 99);
  run(20 * kMillisecond);
  say(RemoveObject{1});
  run(1'000 * kMillisecond);
  EXPECT_TRUE(notices_.empty()) << "gone before it was checked";
}

TEST_F(Meshes, ThatCannotBeBuiltLeaveTheOldOneAndAreTriedAgainWithTheNextEdit) {
  int looks = 0;
  int failAt = -1;
  SceneConfig config = simulated({});
  config.stopwatch = [&] {
    if (++looks == failAt) throw std::runtime_error("out of memory");
    return Nanos{0};
  };
  builder_ = SceneBuilder(config);
  say(SetSurfaceProperty{0, "stiffness", 0.5});
  say(SetVertices{0, 0, soup(1)});
  run(20 * kMillisecond);
  ASSERT_EQ(triangles(), 1U);
  say(SetVertices{0, 3, soup(2)});
  wait(20 * kMillisecond);
  failAt = looks + 4;  // inside the commit
  publish();
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("mesh of object 0, out of memory"));
  EXPECT_EQ(triangles(), 1U);
  run(2'000 * kMillisecond);
  EXPECT_EQ(builder_.nextDeadline(), std::nullopt) << "not again and again";
  EXPECT_EQ(triangles(), 1U);
  say(SetVertices{0, 0, {Vec3f(0, 0, 1)}});
  run(20 * kMillisecond);
  EXPECT_EQ(triangles(), 3U);
}

class Deforming : public Meshes {
 protected:
  static constexpr Nanos kFrame = 20 * kMillisecond;
  Deforming() {
    say(SetVertices{0, 0, soup(50)});
    run(1'000 * kMillisecond);
  }
};

TEST_F(Deforming, PositionsAloneKeepTrianglesAndTravelWithoutAStep) {
  const auto first = object(0)->mesh;
  Vec3 before = vertex(4);
  for (int frame = 1; frame < 100; ++frame) {
    say(SetVertices{0, 3, {Vec3f(2, 0, 0.1F * frame), Vec3f(3, 0, 0.1F * frame), Vec3f(2, 1, 0.1F * frame)}});
    wait(kFrame);
    before = vertex(4);
    ASSERT_TRUE(publish());
    const MeshGeometry& mesh = *object(0)->mesh;
    EXPECT_EQ(mesh.topology, first->topology);
    EXPECT_EQ(mesh.triangles, first->triangles);
    ASSERT_TRUE(mesh.target);
    EXPECT_TRUE(vertex(4).isApprox(before, 1e-6)) << frame;
    EXPECT_TRUE(mesh.deformingAfter(now_));
    EXPECT_EQ(mesh.morphEnd - mesh.morphBegin, frame == 1 ? MeshDraft::kUnmeasured : kFrame);
    EXPECT_NEAR(mesh.vertex(4, mesh.morphEnd).z(), 0.1 * frame, 1e-6);
    EXPECT_EQ(mesh.vertex(100, now_ + kFrame / 2), first->vertex(100, 0)) << "others rest";
    // The index proposes the triangle all the way.
    for (int step = 0; step <= 10; ++step) {
      bool found = false;
      mesh.index.visitNear(mesh.vertex(4, now_ + step * kFrame / 10), 0,
                           [&](std::uint32_t id) { found |= id == 1; });
      ASSERT_TRUE(found) << frame << " " << step;
    }
  }
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Deforming, LoneDeformationTakesSixteenMillisecondsOrItsDistanceAtOneMetrePerSecond) {
  say(SetVertices{0, 0, soup(50, 1)});
  run(MeshDraft::kPause);
  const MeshGeometry& mesh = *object(0)->mesh;
  EXPECT_EQ(mesh.morphEnd - mesh.morphBegin, 16 * kMillisecond);
  wait(8 * kMillisecond);
  EXPECT_NEAR(vertex(0).z(), 0.5, 1e-6);
  wait(1'000 * kMillisecond);
  say(SetVertices{0, 0, soup(50, 19)});
  run(MeshDraft::kPause);
  const MeshGeometry& far = *object(0)->mesh;
  EXPECT_GE(far.morphEnd - far.morphBegin, 18 * kMillisecond);
  EXPECT_LE(far.morphEnd - far.morphBegin, 20 * kMillisecond);
}

// Two sheets with a common edge: the far side of one goes farther, and takes longer by itself.
TEST_F(Deforming, MeshesOfABatchArriveTogether) {
  makeTouchable(1, soup(50));
  run(1'000 * kMillisecond);
  for (int frame = 0; frame < 3; ++frame) {  // the third begins before the second has ended
    const float z = frame % 2 == 0 ? 1 : 0;
    auto rising = soup(50, 30 * z);
    std::fill_n(rising.begin(), 3, Vec3f(1, 0, z));
    auto seam = soup(50);
    std::fill_n(seam.begin(), 3, Vec3f(1, 0, z));
    say(BeginBatch{});
    say(SetVertices{0, 0, std::move(rising)});
    say(SetVertices{1, 0, std::move(seam)});
    say(CommitBatch{});
    wait(8 * kMillisecond);
    ASSERT_TRUE(publish());
    for (int ms = 0; ms < 50; ++ms)
      ASSERT_EQ(object(0)->mesh->vertex(0, now_ + ms * kMillisecond).z(),
                object(1)->mesh->vertex(0, now_ + ms * kMillisecond).z())
          << "frame " << frame << ", " << ms << " ms";
    if (frame == 0) wait(200 * kMillisecond);
  }
}

// Others do not wait for them.
TEST_F(Deforming, MeshesOfAnotherClientKeepTheirPace) {
  makeTouchable(1, soup(50));
  run(1'000 * kMillisecond);
  say(SetVertices{0, 0, soup(50, 1)});
  say(SetVertices{1, 0, soup(50, 40)}, kClient + 1);
  run(MeshDraft::kPause);
  EXPECT_EQ(object(0)->mesh->morphEnd - object(0)->mesh->morphBegin, 16 * kMillisecond);
  EXPECT_GE(object(1)->mesh->morphEnd - object(1)->mesh->morphBegin, 20 * kMillisecond);
}

// Two halves of a frame 2 ms apart, frames at 60 Hz: each is felt whole, before the next one comes.
TEST_F(Deforming, FramesOfAStreamAreFeltOneByOneAndWhole) {
  for (int frame = 1; frame < 30; ++frame) {
    const auto z = static_cast<float>(frame);
    auto corners = soup(50, z);
    const auto half = static_cast<std::ptrdiff_t>(corners.size() / 2);
    say(SetVertices{0, 0, {corners.begin(), corners.begin() + half}});
    wait(2 * kMillisecond);
    EXPECT_FALSE(publish()) << "half a frame";
    say(SetVertices{0, static_cast<std::int32_t>(half), {corners.begin() + half, corners.end()}});
    wait(MeshDraft::kPause);
    ASSERT_TRUE(publish()) << frame;
    const MeshGeometry& mesh = *object(0)->mesh;
    EXPECT_NEAR(mesh.vertex(0, mesh.morphEnd).z(), z, 1e-6);
    EXPECT_NEAR(mesh.vertex(149, mesh.morphEnd).z(), z, 1e-6);
    wait(10 * kMillisecond);
  }
}

TEST_F(Deforming, NewVerticesAreANewShapeAtOnce) {
  const std::uint64_t topology = object(0)->mesh->topology;
  say(SetVertices{0, 150, soup(1)});
  run(20 * kMillisecond);
  EXPECT_NE(object(0)->mesh->topology, topology);
  EXPECT_FALSE(object(0)->mesh->target);
}

TEST_F(Deforming, MovingAnObjectDoesNotTouchItsMesh) {
  say(SetVertices{0, 0, soup(50, 1)});
  run(20 * kMillisecond);
  const auto mesh = object(0)->mesh;
  say(SetTransform{0, columns(at(1, 2, 3))});
  publish();
  EXPECT_EQ(object(0)->mesh, mesh);
}

TEST_F(Deforming, ObjectIndexCoversTheDeformedShape) {
  say(SetVertices{0, 0, {Vec3f(0, 0, 500)}});
  run(20 * kMillisecond);
  for (Nanos t = 0; t <= 60; t += 5) {
    bool found = false;
    scene_->objectIndex->visitNear(object(0)->mesh->vertex(0, now_ + t * kMillisecond), 1e-6,
                                   [&](std::uint32_t) { found = true; });
    EXPECT_TRUE(found) << t;
  }
}

// Neither what was removed nor a vertex of no triangle has a place in the index, and they are no reason to
// build it anew.
TEST_F(Deforming, IncompleteTrianglesAndLoneVerticesAreLeftOut) {
  std::vector<Vec3f> corners = soup(10);
  corners.emplace_back(0, 0, 1000);
  say(SetObjectNumber{2});
  say(SetSurfaceProperty{1, "stiffness", 0.5});
  say(SetVertices{1, 0, corners});
  say(SetTriangles{1, 0, {{0, 1, 2}, {3, 4, 5}, {6, 7, 8}, {9, 10, 11}, {12, 13, 14}, {15, 16, 99}}, false});
  say(RemoveTriangle{1, 2});
  run(1'000 * kMillisecond);
  for (int frame = 1; frame < 5; ++frame) {
    previous_.reset();
    corners[30].z() += 1;
    for (std::size_t i = 0; i < 30; ++i) corners[i].z() = 0.1F * static_cast<float>(frame);
    say(SetVertices{1, 0, corners});
    run(20 * kMillisecond);
    const SpatialIndex& index = object(1)->mesh->index;
    EXPECT_NEAR(index.bounds().max.z(), 0.1 * frame, 1e-6);
    std::set<std::uint32_t> found;
    index.visitNear(Vec3::Zero(), INFINITY, [&](std::uint32_t id) { found.insert(id); });
    EXPECT_EQ(found, (std::set<std::uint32_t>{0, 1, 3, 4}));
    EXPECT_EQ(index.refits() > 0, frame > 1) << frame;
  }
}

// While they leap, their boxes are around all of their ways; once they rest, each is at its triangle.
TEST_F(Deforming, MeshesThatLeaptAreFoundTriangleByTriangle) {
  makeTouchable(0, soup(1'000));
  const auto proposed = [&](const SpatialIndex& index) {
    std::set<std::uint32_t> ids;
    index.visitNear(Vec3(600.2, 0.2, 0), 0.1, [&](std::uint32_t id) { ids.insert(id); });
    return ids;
  };
  for (const float aside : {1'000.0F, 0.0F, 900.0F, 0.0F}) {
    std::vector<Vec3f> shape = soup(1'000);
    for (Vec3f& v : shape) v.x() += aside;
    previous_.reset();
    say(SetVertices{0, 0, shape});
    run(20 * kMillisecond);
    const MeshGeometry& mesh = *object(0)->mesh;
    EXPECT_GT(proposed(mesh.indexAt(mesh.morphEnd - 1)).size(), 100U);
    const auto atRest = proposed(mesh.indexAt(mesh.morphEnd));
    EXPECT_EQ(atRest.count(300), aside == 0 ? 1U : 0U) << aside;
    EXPECT_LE(atRest.size(), 16U) << aside;
    run(100 * kMillisecond);
  }
}

// A snapshot that is still held keeps its shape, whatever is refitted for later ones.
TEST_F(Deforming, HeldSnapshotsStayAsTheyAre) {
  std::vector<std::shared_ptr<const SceneSnapshot>> held;
  for (int frame = 1; frame < 20; ++frame) {
    say(SetVertices{0, 0, soup(50, static_cast<float>(frame))});
    run(20 * kMillisecond);
    if (frame % 3 == 0) held.push_back(scene_);
  }
  for (std::size_t i = 0; i < held.size(); ++i) {
    const MeshGeometry& mesh = *held[i]->objects[0]->mesh;
    const double z = 3.0 * static_cast<double>(i + 1);
    EXPECT_NEAR(mesh.vertex(0, mesh.morphEnd).z(), z, 1e-6);
    bool found = false;
    mesh.index.visitNear(Vec3(0, 0, z), 0, [&](std::uint32_t id) { found |= id == 0; });
    EXPECT_TRUE(found);
    EXPECT_LT(mesh.index.bounds().max.z(), z + 0.1);
  }
}

}  // namespace
}  // namespace hapticd::scene
