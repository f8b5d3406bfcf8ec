// Placements, units, the tree, moving objects.
#include <gmock/gmock.h>

#include <random>

#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using geometry::Mat3;
using geometry::Quat;
using ::testing::HasSubstr;
using Severity = Notice::Severity;

class Objects : public SceneTest {
 protected:
  Vec3 where(std::int32_t id, const Vec3& p = Vec3::Zero()) { return object(id)->motion.at(now_) * p; }
  // Where it will be at the end of its movement.
  Vec3 placed(std::int32_t id, const Vec3& p = Vec3::Zero()) { return object(id)->motion.destination() * p; }
};

TEST_F(Objects, TransformIsColumnMajorInWorldUnits) {
  makeTouchable(0);
  std::array<double, 16> m{0, 2, 0, 0, -2, 0, 0, 0, 0, 0, 2, 0, 10, 20, 30, 1};
  say(SetTransform{0, m});
  publish();
  EXPECT_EQ(placed(0), Vec3(10, 20, 30));
  EXPECT_EQ(placed(0, Vec3(1, 0, 0)), Vec3(10, 22, 30));
}

TEST_F(Objects, TransformMeshIsRowMajorInMetresAndReplacesTheOneBefore) {
  makeTouchable(0);
  say(TransformMesh{0, {1, 0, 0, 9, 0, 1, 0, 9, 0, 0, 1, 9, 0, 0, 0, 1}});
  say(TransformMesh{0, {0, -1, 0, 0.01F, 1, 0, 0, 0.02F, 0, 0, 1, 0.03F, 0, 0, 0, 1}});
  publish();
  EXPECT_TRUE(placed(0).isApprox(Vec3(10, 20, 30), 1e-6));
  EXPECT_TRUE(placed(0, Vec3(1, 0, 0)).isApprox(Vec3(10, 1020, 30), 1e-6));
}

TEST_F(Objects, FirstStockCallPutsTheWholeObjectIntoMetres) {
  const SceneCommand stock[] = {AddObject{0, -1},
                                SetTriangles{0, 0, {Triangle{0, 1, 2}}},
                                SetObjectPosition{0, Vec3(5, 0, 0)},
                                SetObjectOrientation{0, Vec3::UnitX(), 0},
                                SetObjectScale{0, Vec3::Ones()},
                                SetSurface{0, 0.5, 0, 0, 0}};
  for (const SceneCommand& command : stock) {
    say(ResetScene{});
    makeTouchable(0);
    say(SetTransform{0, columns(at(5, 0, 0))});
    publish();
    EXPECT_EQ(placed(0, Vec3(1, 0, 0)), Vec3(6, 0, 0));
    const std::uint32_t jumps = object(0)->motion.jumps();
    SceneCommand copy = command;
    builder_.apply(kClient, std::move(copy), now_, notices_);
    publish();
    EXPECT_EQ(placed(0, Vec3(1, 0, 0)), Vec3(6000, 0, 0)) << command.index();
    EXPECT_GT(object(0)->motion.jumps(), jumps);
  }
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Objects, StockPoseIsPositionThenOrientationThenScaleInAnyOrder) {
  makeTouchable(0);
  say(SetObjectScale{0, Vec3(1, 2, 3)});
  say(SetObjectPosition{0, Vec3(0.1, 0.2, 0.3)});
  say(SetObjectOrientation{0, Vec3(0, 0, 5), EIGEN_PI / 2});  // the axis has any length
  publish();
  EXPECT_TRUE(placed(0, Vec3(0, 1, 0)).isApprox(Vec3(100 - 2000, 200, 300), 1e-9));
  say(SetTransform{0, columns(at(1, 0, 0))});
  publish();
  EXPECT_TRUE(placed(0, Vec3(0, 1, 0)).isApprox(Vec3(1000, 1000, 0))) << "the matrix replaces all three";
}

TEST_F(Objects, ChildrenFollowTheirParentsInTheirOwnUnits) {
  makeTouchable(0);
  say(AddObject{1, -1});
  say(AddObject{2, 1});
  makeTouchable(2);
  say(SetObjectPosition{1, Vec3(1, 0, 0)});
  say(SetObjectScale{1, Vec3(2, 2, 2)});
  say(SetObjectPosition{2, Vec3(0, 1, 0)});
  publish();
  EXPECT_TRUE(placed(2).isApprox(Vec3(1000, 2000, 0)));
  EXPECT_TRUE(placed(2, Vec3(0, 0, 1)).isApprox(Vec3(1000, 2000, 2000)));
  say(MoveToParent{0, 1});  // in world units below a parent in metres
  say(SetTransform{0, columns(at(0, 0, 5))});
  publish();
  EXPECT_TRUE(placed(0).isApprox(Vec3(1000, 0, 10)));
  say(SetSceneOrigin{Vec3(0, 0, 1), Vec3::UnitZ(), 0});
  publish();
  EXPECT_TRUE(placed(2).isApprox(Vec3(1000, 2000, 1000)));
  EXPECT_TRUE(builder_.describe().T_world_scene.translation().isApprox(Vec3(0, 0, 1000)));
  say(AddObjectExScene{2});
  publish();
  EXPECT_TRUE(placed(2).isApprox(Vec3(0, 1000, 0))) << "a root of its own does not move with the scene";
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Objects, AreNotFartherThanAMillionKilometres) {
  makeTouchable(0);
  say(SetTransform{0, columns(at(3e20, 0, -4e20))});
  publish();
  EXPECT_TRUE(placed(0).isApprox(Vec3(0.6e12, 0, -0.8e12)));
  EXPECT_THAT(onlyNotice(Severity::warning), HasSubstr("place of object 0, 5e+17 m: too far away"));
  say(SetTransform{0, columns(at(0, 0.99e12, 0))});
  publish();
  EXPECT_TRUE(placed(0).isApprox(Vec3(0, 0.99e12, 0)));
  EXPECT_TRUE(notices_.empty());
}

TEST_F(Objects, StayWhereNoPlaceIsKnownThroughTheirParents) {
  makeTouchable(2);
  say(AddObject{1, -1});
  say(MoveToParent{2, 1});
  say(SetTransform{2, columns(at(1, 2, 3))});
  publish();
  const Affine large(Eigen::UniformScaling<double>(1e20));
  say(SetTransform{1, columns(large)});
  say(SetTransform{2, columns(at(1, 2, 3) * large)});
  publish();
  EXPECT_TRUE(placed(2).isApprox(Vec3(1, 2, 3)));
  EXPECT_THAT(onlyNotice(Severity::warning),
              HasSubstr("place of object 2: out of range through its parents"));
  say(SetTransform{1, columns(at(0, 0, 0))});
  say(SetTransform{2, columns(at(1, 2, 4))});
  publish();
  EXPECT_TRUE(placed(2).isApprox(Vec3(1, 2, 4)));
}

TEST_F(Objects, RemovingAnObjectRemovesWhatHangsBelowIt) {
  say(AddObject{1, -1});
  say(AddObject{2, 1});
  say(AddObject{3, 2});
  makeTouchable(3);
  ASSERT_NE(object(3), nullptr);
  say(RemoveObject{1});
  ASSERT_TRUE(publish());
  EXPECT_EQ(object(3), nullptr);
  say(AddObject{4, 2});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("no such parent"));
  makeTouchable(0);
  say(RemoveObject{0});
  publish();
  EXPECT_EQ(object(0), nullptr);
  say(SetTouchable{0, true});
  EXPECT_TRUE(notices_.empty()) << "object 0 always exists";
}

TEST_F(Objects, TreeHasNoRingsAndIsNotDeeperThanTheLimit) {
  for (int id = 1; id <= 64; ++id) say(AddObject{id, id - 1});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("nested too deeply"));
  say(MoveToParent{1, 60});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("its own ancestor"));
  say(ResetScene{});
  say(AddObject{1, -1});
  for (int id = 2; id <= 40; ++id) say(AddObject{id, id - 1});
  say(AddObject{100, -1});
  for (int id = 101; id <= 140; ++id) say(AddObject{id, id - 1});
  notices_.clear();
  say(MoveToParent{100, 40});
  EXPECT_THAT(onlyNotice(Severity::error), HasSubstr("nested too deeply"));
}

TEST_F(Objects, LonePoseIsAMovement) {
  makeTouchable(0);
  for (const auto& [pause, duration] : {std::pair{2'000, 16}, {101, 16}, {99, 50}, {900, 16}}) {
    wait(pause * kMillisecond);
    const std::uint32_t jumps = object(0)->motion.jumps();
    const Vec3 before = where(0);
    say(SetTransform{0, columns(at(before.x() + 1, 0, 0))});
    publish();
    EXPECT_EQ(object(0)->motion.jumps(), jumps);
    EXPECT_EQ(where(0), before);
    EXPECT_TRUE(object(0)->motion.movingAfter(now_ + duration * kMillisecond - 1)) << pause;
    EXPECT_FALSE(object(0)->motion.movingAfter(now_ + duration * kMillisecond)) << pause;
  }
}

TEST_F(Objects, PoseTakesAtLeastItsDistanceAtOneMetrePerSecond) {
  makeTouchable(0);
  for (const auto& [distance, duration] : {std::pair{18, 18}, {-15, 16}, {300, 20}}) {
    wait(2'000 * kMillisecond);
    say(SetTransform{0, columns(at(where(0).x() + distance, 0, 0))});
    publish();
    EXPECT_TRUE(object(0)->motion.movingAfter(now_ + duration * kMillisecond - 2)) << distance;
    EXPECT_FALSE(object(0)->motion.movingAfter(now_ + duration * kMillisecond + 2)) << distance;
  }
}

TEST_F(Objects, WayOfAnObjectThatCannotBeFeltIsAJump) {
  makeTouchable(0);
  say(SetTouchable{0, false});
  publish();
  say(SetTransform{0, columns(at(1, 0, 0))});
  publish();
  say(SetTouchable{0, true});
  publish();
  EXPECT_EQ(where(0), Vec3(1, 0, 0));
  EXPECT_FALSE(object(0)->motion.movingAfter(now_));
}

// A late tick looks for an object where it was.
TEST_F(Objects, IndexFindsAnObjectWhereItWasATenthOfASecondAgo) {
  makeTouchable(0);
  // Others, so that not all are in one leaf.
  for (int id = 1; id < 60; ++id) {
    makeTouchable(id);
    say(SetTransform{id, columns(at(0, 20 * id, 0))});
  }
  for (int i = 0; i < 100; ++i) {
    wait(16 * kMillisecond);
    say(SetTransform{0, columns(at(3 * i, 0, 0))});
    publish();
    for (int ago = std::max(0, i - 6); ago <= i; ++ago) {
      bool found = false;
      scene_->objectIndex->visitNear(Vec3(3 * ago + 0.2, 0.2, 0), 1e-9,
                                     [&](std::uint32_t id) { found |= id == 0; });
      ASSERT_TRUE(found) << i << " " << ago;
    }
  }
}

TEST_F(Objects, PosesWithinATenthOfASecondAreOneMovementOverTheirInterval) {
  makeTouchable(0);
  const Nanos interval = 16'666'667;
  say(SetTransform{0, columns(at(0, 1, 0))});
  publish();
  const std::uint32_t jumps = object(0)->motion.jumps();
  Vec3 before = placed(0);
  // The true path x = 1000 t / s, sampled at 60 Hz: after the first pose it is followed one interval later,
  // without a step, and without a rest.
  for (int i = 1; i < 20; ++i) {
    wait(interval);
    say(SetTransform{0, columns(at(i * 16.666667, 1, 0))});
    publish();
    EXPECT_EQ(object(0)->motion.jumps(), jumps);
    EXPECT_TRUE(where(0).isApprox(before, 1e-9)) << "joins";
    const Vec3 half = object(0)->motion.at(now_ + interval / 2).translation();
    EXPECT_NEAR(half.x(), (i - 0.5) * 16.666667, 1e-3);
    EXPECT_FALSE(object(0)->motion.movingAfter(now_ + interval));
    before = object(0)->motion.at(now_ + interval).translation();
  }
}

TEST_F(Objects, SlowStreamIsBlendedInFiftyMilliseconds) {
  makeTouchable(0);
  say(SetTransform{0, columns(at(1, 0, 0))});
  publish();
  wait(90 * kMillisecond);
  say(SetTransform{0, columns(at(2, 0, 0))});
  publish();
  EXPECT_TRUE(object(0)->motion.movingAfter(now_ + 49 * kMillisecond));
  EXPECT_FALSE(object(0)->motion.movingAfter(now_ + 50 * kMillisecond));
}

// Position and orientation are two calls: together they are one pose.
TEST_F(Objects, PartsOfOnePoseAreNotAStream) {
  makeTouchable(0);
  wait(1'000 * kMillisecond);
  say(SetObjectPosition{0, Vec3(1, 0, 0)});
  wait(10'000);
  say(SetObjectOrientation{0, Vec3::UnitZ(), 1});
  publish();
  EXPECT_FALSE(object(0)->motion.movingAfter(now_)) << "the first stock call changes the unit";
  wait(20 * kMillisecond);
  say(SetObjectPosition{0, Vec3(2, 0, 0)});
  wait(10'000);
  say(SetObjectOrientation{0, Vec3::UnitZ(), 2});
  publish();
  EXPECT_TRUE(object(0)->motion.movingAfter(now_ + 19 * kMillisecond));
  EXPECT_FALSE(object(0)->motion.movingAfter(now_ + 21 * kMillisecond));
}

TEST_F(Objects, SamePoseAgainChangesNothingButKeepsTheStream) {
  makeTouchable(0);
  say(SetTransform{0, columns(at(1, 0, 0))});
  publish();
  for (int i = 0; i < 30; ++i) {
    wait(16 * kMillisecond);
    say(SetTransform{0, columns(at(1, 0, 0))});
    EXPECT_FALSE(publish());
  }
  wait(16 * kMillisecond);
  say(SetTransform{0, columns(at(2, 0, 0))});
  publish();
  EXPECT_TRUE(object(0)->motion.movingAfter(now_)) << "it began to move from rest";
}

TEST_F(Objects, MirrorImageIsAJumpEvenInAStream) {
  makeTouchable(0);
  say(SetTransform{0, columns(at(1, 0, 0))});
  publish();
  const std::uint32_t jumps = object(0)->motion.jumps();
  wait(16 * kMillisecond);
  Affine mirrored = Affine::Identity();
  mirrored.linear()(0, 0) = -1;
  say(SetTransform{0, columns(mirrored)});
  publish();
  EXPECT_GT(object(0)->motion.jumps(), jumps);
}

TEST_F(Objects, ChildrenAreCarriedSmoothlyWithTheirParent) {
  say(AddObject{1, 0});
  makeTouchable(1);
  say(SetTransform{0, columns(at(1, 0, 0))});
  publish();
  const std::uint32_t jumps = object(1)->motion.jumps();
  wait(20 * kMillisecond);
  say(SetTransform{0, columns(at(3, 0, 0))});
  publish();
  EXPECT_EQ(object(1)->motion.jumps(), jumps);
  EXPECT_TRUE(where(1).isApprox(Vec3(1, 0, 0)));
  wait(10 * kMillisecond);
  EXPECT_TRUE(where(1).isApprox(Vec3(2, 0, 0)));
}

// The index must propose an object wherever it may be at any time of its motion, also with old boxes.
TEST_F(Objects, IndexFindsMovingObjectsAllTheWay) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> u(-1, 1);
  makeTouchable(0);
  makeTouchable(1);
  std::uint32_t rebuilt = 0;
  for (int frame = 0; frame < 300; ++frame) {
    const Nanos interval = frame % 50 == 0 ? 200 * kMillisecond : 16 * kMillisecond;
    wait(interval);
    for (const int id : {0, 1}) {
      Affine t = at(10 * std::sin(frame * 0.05), id * 20 + u(random), frame % 70 == 0 ? 50 * u(random) : 0);
      t.linear() = Eigen::AngleAxisd(frame * 0.3 * u(random), Vec3(u(random), u(random), 1).normalized()) *
                   Vec3(1 + 0.5 * u(random), 2, 1).asDiagonal();
      say(SetTransform{id, columns(t)});
    }
    const auto index = scene_->objectIndex;
    ASSERT_TRUE(publish());
    rebuilt += index != scene_->objectIndex ? 1U : 0U;
    for (std::uint32_t position = 0; position < 2; ++position) {
      const ObjectState& o = *scene_->objects[position];
      for (int step = 0; step <= 10; ++step) {
        for (const Vec3f& v : oneTriangle()) {
          const Vec3 p = o.motion.at(now_ + step * 2 * kMillisecond) * Vec3(v.cast<double>());
          bool found = false;
          scene_->objectIndex->visitNear(p, 1e-9, [&](std::uint32_t id) { found |= id == position; });
          ASSERT_TRUE(found) << frame << " " << step;
        }
      }
    }
  }
  EXPECT_LT(rebuilt, 250U) << "boxes have room to move";
}

TEST_F(Objects, ThousandsMoveAndEachSnapshotSharesTheMeshes) {
#ifdef HAPTICD_SANITIZED
  constexpr int kCount = 1'000;
#else
  constexpr int kCount = 10'000;
#endif
  say(SetObjectNumber{kCount});
  for (int id = 0; id < kCount; ++id) {
    say(SetVertices{id, 0, oneTriangle()});
    say(SetSurfaceProperty{id, "stiffness", 0.5});
  }
  run(20 * kMillisecond);
  ASSERT_EQ(scene_->objects.size(), static_cast<std::size_t>(kCount));
  for (int frame = 0; frame < 5; ++frame) {
    const auto before = scene_;
    for (int id = 0; id < kCount; ++id) say(SetTransform{id, columns(at(id * 3.0, frame, 0))});
    publish();
    for (int id = 0; id < kCount; id += 97) {
      ASSERT_EQ(scene_->objects[static_cast<std::size_t>(id)]->mesh,
                before->objects[static_cast<std::size_t>(id)]->mesh);
    }
    wait(16 * kMillisecond);
  }
  EXPECT_TRUE(notices_.empty());
}

}  // namespace
}  // namespace hapticd::scene
