// The springs of faces that a ball presses aside. The expected forces follow from the minimum that the header
// states, and from the gradient of the energy.
#include "realtime/render/yielding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "meshes.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

constexpr double kSprings_N_per_m = 1000;
constexpr double kYieldingBall_m = 0.004;

struct PressedFace {
  Vec3 normal;
  double limit_N;  // 0: it does not yield
};

// A proxy on all these faces, the HIP `below` it.
ContactSet pressed(const std::vector<PressedFace>& faces, const Vec3& below) {
  ContactSet set;
  set.count = static_cast<int>(faces.size());
  Eigen::MatrixXd normals(3, set.count);
  for (int i = 0; i < set.count; ++i) normals.col(i) = faces[static_cast<std::size_t>(i)].normal;
  const Eigen::VectorXd depths = normals.colPivHouseholderQr().solve(below);
  for (int i = 0; i < set.count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    ContactConstraint& constraint = set.constraints[k];
    constraint.object = constraint.source = i;
    constraint.surface.popthrough_N = faces[k].limit_N;
    constraint.halfSpace.normal = faces[k].normal;
    constraint.depth_m = depths[i];
  }
  set.normal_m = below;
  set.spring.stiffness_N_per_m = set.spring.kappa_N_per_m = kSprings_N_per_m;
  return set;
}

Springs springsAt(const std::vector<PressedFace>& faces, const Vec3& below) {
  return springsOf(pressed(faces, below), kYieldingBall_m);
}

Vec3 inGroove(double angle, double side) {
  return {side * std::cos(angle / 2), 0, std::sin(angle / 2)};
}

TEST(Yielding, one_face_pushes_with_its_force_until_there_is_room_for_the_ball) {
  const std::vector<PressedFace> face{{Vec3::UnitZ(), 2}};
  EXPECT_FALSE(springsAt(face, 0.0015 * Vec3::UnitZ()).yields);
  EXPECT_DOUBLE_EQ(springsAt(face, 0.0015 * Vec3::UnitZ()).forces_N[0], 1.5);
  for (const double depth : {0.0025, 0.005, 0.0079}) {
    const Springs springs = springsAt(face, depth * Vec3::UnitZ());
    EXPECT_TRUE(springs.yields);
    EXPECT_NEAR(springs.forces_N[0], 2, 1e-12);
    EXPECT_NEAR(springs.stored_J, 0.5 * 2 * 0.002 + 2 * (depth - 0.002), 1e-15);
  }
  EXPECT_NEAR(springsAt(face, 0.0085 * Vec3::UnitZ()).forces_N[0], 2.5, 1e-12);
}

// The wall that does not yield holds the hand by as much less as the other one gives way towards it.
TEST(Yielding, in_a_groove_the_other_wall_is_pressed_less) {
  for (const double degrees : {30.0, 60.0, 85.0}) {
    const double angle = degrees * M_PI / 180;
    const double facing = std::cos(angle);
    const std::vector<PressedFace> walls{{inGroove(angle, 1), 1}, {inGroove(angle, -1), 0}};
    const Springs springs = springsAt(walls, 0.003 * walls[0].normal + 0.004 * walls[1].normal);
    EXPECT_NEAR(springs.forces_N[0], 1, 1e-9) << degrees;
    EXPECT_NEAR(springs.forces_N[1], std::max(0.0, 4 - facing * 2), 1e-9) << degrees;
  }
}

TEST(Yielding, at_an_obtuse_angle_each_face_pushes_as_alone) {
  const double angle = 120 * M_PI / 180;
  const std::vector<PressedFace> walls{{inGroove(angle, 1), 1}, {inGroove(angle, -1), 0}};
  for (const double depth : {0.0, 1e-6, 0.001, 0.004}) {
    const Springs springs = springsAt(walls, 0.003 * walls[0].normal + depth * walls[1].normal);
    EXPECT_NEAR(springs.forces_N[0], 1, 1e-9);
    EXPECT_NEAR(springs.forces_N[1], kSprings_N_per_m * depth, 1e-9);
  }
}

// Corners at random whose faces meet at acute angles: the force is the gradient of the energy, is no more
// than that of the spring, and does not depend on the order of the faces.
TEST(Yielding, the_force_is_the_gradient_of_the_energy) {
  std::mt19937 random(5);
  const auto uniform = [&](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  int judged = 0;
  int yielding = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    std::vector<PressedFace> faces(static_cast<std::size_t>(2 + trial % 2));
    Vec3 below = Vec3::Zero();
    for (PressedFace& face : faces) {
      face.normal = Vec3(uniform(-1, 1), uniform(-1, 1), uniform(0.05, 0.6)).normalized();
      face.limit_N = uniform(0, 1) < 0.3 ? 0 : uniform(0.2, 3);
      below += uniform(1e-3, 2 * kYieldingBall_m) * face.normal;
    }
    const auto acute = [&](std::size_t i, std::size_t j) {
      return faces[i].normal.dot(faces[j].normal) < -0.01;
    };
    if (!acute(0, 1) || (faces.size() == 3 && (!acute(0, 2) || !acute(1, 2)))) continue;
    const Springs springs = springsAt(faces, below);
    if (!springs.yields) continue;
    ++judged;
    EXPECT_LE(springs.sum_N.norm(), kSprings_N_per_m * below.norm() * (1 + 1e-9)) << trial;
    for (const PressedFace& face : faces) {
      constexpr double kStep_m = 1e-8;
      const Springs more = springsAt(faces, below + kStep_m * face.normal);
      const Springs less = springsAt(faces, below - kStep_m * face.normal);
      yielding += more.yields && less.yields ? 1 : 0;
      if (!more.yields || !less.yields) continue;
      EXPECT_NEAR((more.stored_J - less.stored_J) / (2 * kStep_m), springs.sum_N.dot(face.normal), 2e-5)
          << trial;
    }
    std::reverse(faces.begin(), faces.end());
    EXPECT_LE((springsAt(faces, below).sum_N - springs.sum_N).norm(), 1e-7) << trial;
  }
  EXPECT_GT(judged, 100);
  EXPECT_GT(yielding, 200);
}

// A ball between a wall that yields and one that does not: rounds of the HIP give no energy, and all of the
// springs act.
TEST(Yielding, rounds_in_a_groove_give_no_energy) {
  for (const double degrees : {50.0, 80.0}) {
    const double angle = degrees * M_PI / 180;
    SceneFixture scene;
    for (const double side : {1.0, -1.0}) {
      const Vec3 normal = inGroove(angle, side);
      const Affine placed(Eigen::Quaterniond::FromTwoVectors(Vec3::UnitZ(), normal));
      scene::Surface s = surface(kSprings_N_per_m);
      s.popthrough_N = side > 0 ? 1 : 0;
      scene.add(plane(0.05), s, placed);
    }
    const Vec3 rest(0, 0, kYieldingBall_m / std::sin(angle / 2));  // the ball on both walls
    for (const double way : {1.0, -1.0}) {
      Hand hand(scene.snapshot(), {.toolRadius_m = kYieldingBall_m});
      hand.at(rest + 0.005 * Vec3::UnitZ());
      hand.to(rest - 0.0015 * Vec3::UnitZ());
      double work_J = 0;
      int yielding = 0;
      const int steps = reduced(20'000, 4'000);
      for (int i = 0; i <= 2 * steps; ++i) {
        const Vec3 before = hand.hip();
        const Vec3 force = hand.now().contactForce_N;
        const double a = way * 2 * M_PI * i / steps;
        hand.at(rest + Vec3(0.0006 * std::sin(a), 0, -0.0015 - 0.0006 * (1 - std::cos(a))));
        work_J += 0.5 * (force + hand.now().contactForce_N).dot(hand.hip() - before);
        ASSERT_EQ(hand.renderer().energyShare(), 1) << degrees << ", step " << i;
        // Both walls, and less than the whole spring.
        const Rendering& r = hand.now();
        yielding +=
            r.contactCount == 2 && r.contactForce_N.norm() < 0.99 * kSprings_N_per_m * r.depth_m ? 1 : 0;
      }
      EXPECT_NEAR(work_J, 0, 1e-7) << degrees;
      EXPECT_GT(yielding, steps / 2) << degrees;
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture
