// The energy of a contact with what rests. The expected shares follow from 1/2 K d^2.
#include "realtime/render/energy_limit.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "meshes.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

constexpr double kPeriod_s = 1e-3;

// A floor at z = 0 with the HIP at this depth.
SpringState floorAt(double depth_m, double stiffness = 1000) {
  SpringState springs;
  springs.normal = Vec3::UnitZ();
  springs.force_N = stiffness * depth_m * springs.normal;
  springs.pressed_N = stiffness * depth_m;
  springs.stored_J = 0.5 * stiffness * depth_m * depth_m;
  springs.stiffness_N_per_m = stiffness;
  return springs;
}

class EnergyLimitTest : public testing::Test {
 protected:
  EnergyLimit limit;

  double press(double depth_m, double stiffness = 1000, bool limited = true) {
    return limit.step(floorAt(depth_m, stiffness), limited, -depth_m * Vec3::UnitZ(), kPeriod_s);
  }
};

TEST_F(EnergyLimitTest, A_floor_acts_wholly_at_any_speed) {
  for (const double step_m : {1e-6, 1e-4, 1e-3, 3e-3}) {
    limit.reset();
    for (int i = 0; i <= 10; ++i) EXPECT_EQ(press(i * step_m), 1) << step_m;
    for (int i = 10; i > 0; --i) EXPECT_EQ(press(i * step_m), 1) << step_m;
  }
}

TEST_F(EnergyLimitTest, A_spring_that_stiffens_stores_what_there_was) {
  press(4e-3, 100);
  EXPECT_NEAR(press(4e-3, 1000), 0.1, 1e-9);
}

TEST_F(EnergyLimitTest, What_the_hand_puts_in_counts) {
  press(4e-3, 100);
  // The way of 10 um against the spring after it, which is the stronger one, and half of its own.
  const double paid_J = 1e-5 * 1000 * 4.01e-3 + 0.5 * 1000 * 1e-10;
  const double stored_J = 0.5 * 100 * 4e-3 * 4e-3;
  EXPECT_NEAR(press(4.01e-3, 1000), (stored_J + paid_J) / (0.5 * 1000 * 4.01e-3 * 4.01e-3), 1e-9);
}

TEST_F(EnergyLimitTest, The_share_returns_within_a_second) {
  press(4e-3, 100);
  double share = press(4e-3, 1000);
  for (int i = 1; i <= 950; ++i) {
    const double next = press(4e-3, 1000);
    ASSERT_GE(next, share);
    ASSERT_LE(next - share, 1.001e-3);
    share = next;
    if (i == 500) {
      EXPECT_NEAR(share, 0.6, 1e-6);
    }
  }
  EXPECT_EQ(share, 1);
}

TEST_F(EnergyLimitTest, A_share_ends_with_its_contact) {
  press(4e-3, 100);
  EXPECT_LT(press(4e-3, 1000), 0.11);
  EXPECT_EQ(limit.step(SpringState{}, true, Vec3::UnitZ(), kPeriod_s), 1);
  EXPECT_EQ(press(1e-3, 1000), 1);
}

// In the middle of a jump it may be nearer to the HIP than at its end, which is no farther than its begin.
TEST_F(EnergyLimitTest, A_proxy_that_stopped_on_its_way_acts_wholly_where_it_arrives) {
  const Vec3 hip = -1.56e-3 * Vec3::UnitZ();
  SpringState onItsWay = floorAt(1.40e-3);
  onItsWay.whole = false;
  EXPECT_EQ(press(1.56e-3), 1);
  EXPECT_EQ(limit.step(onItsWay, true, hip, kPeriod_s), 1);
  EXPECT_EQ(limit.step(floorAt(1.52e-3), true, hip, kPeriod_s), 1);
  EXPECT_LT(limit.step(floorAt(1.60e-3), true, hip, kPeriod_s), 0.92) << "it has arrived";
}
TEST_F(EnergyLimitTest, A_proxy_that_arrives_where_it_is_stiffer_stores_what_there_was) {
  SpringState onItsWay = floorAt(4e-3, 100);
  onItsWay.whole = false;
  EXPECT_EQ(limit.step(onItsWay, true, -4e-3 * Vec3::UnitZ(), kPeriod_s), 1);
  EXPECT_NEAR(press(4e-3, 1000), 0.1, 1e-9);
}

TEST_F(EnergyLimitTest, What_moves_or_a_command_stiffens_acts_wholly) {
  press(4e-3, 100);
  EXPECT_EQ(press(4e-3, 1000, false), 1);
  EXPECT_EQ(press(4e-3, 1000), 1);
}

TEST_F(EnergyLimitTest, A_share_returns_slowly_whatever_comes) {
  press(4e-3, 100);
  press(4e-3, 1000);
  EXPECT_NEAR(press(4e-3, 1000, false), 0.101, 1e-9);
}

// It yields with 1 N from 1 mm on, and stores that times the way.
TEST_F(EnergyLimitTest, Beside_a_face_that_yields_acts_what_was_paid) {
  press(1e-3);
  for (int i = 1; i <= 30; ++i) {
    const double depth_m = 1e-3 + i * 1e-4;
    SpringState springs = floorAt(depth_m);
    springs.force_N = Vec3::UnitZ();
    springs.stored_J = 0.5e-3 + i * 1e-4;
    EXPECT_EQ(limit.step(springs, true, -depth_m * Vec3::UnitZ(), kPeriod_s), 1);
  }
  EXPECT_NEAR(press(4e-3), 3.5e-3 / 8e-3, 1e-9);
}

// A floor of 100 N/m under the origin, and a plate of 2000 N/m in it.
class EnergyShareTest : public testing::Test {
 protected:
  SceneFixture scene;

  EnergyShareTest() { scene.add(plane(0.04), surface(100)); }

  // Its centre; the plate is 4 mm wide.
  scene::ObjectState& addPlate(const scene::Motion& motion) {
    return scene.add(geometryOf(plane(0.002), 2), surface(2000), motion);
  }
  static Affine inFloor(double x) { return Affine(Eigen::Translation3d(x, 0, -0.05e-3)); }
};

TEST_F(EnergyShareTest, What_comes_near_brings_its_energy_with_it) {
  addPlate(scene::Motion::between(inFloor(0.02), inFloor(0.0035), toNanos(0.2), toNanos(0.4)));
  Hand hand(scene.snapshot());
  hand.at(1e-3 * Vec3::UnitZ());
  const double alone_N = hand.to(-2e-3 * Vec3::UnitZ()).contactForce_N.norm();
  EXPECT_NEAR(alone_N, 0.2, 1e-6);
  while (hand.time() < toNanos(0.6)) {
    hand.at(-2e-3 * Vec3::UnitZ());
    ASSERT_EQ(hand.renderer().energyShare(), 1);
  }
  EXPECT_GT(hand.now().contactForce_N.norm(), 1.5 * alone_N);
}

// By 0.02 N in a tick: no jump that the guard blends.
TEST_F(EnergyShareTest, Commands_bring_their_energy_with_them) {
  Hand hand(scene.snapshot());
  hand.at(1e-3 * Vec3::UnitZ());
  hand.to(-2e-3 * Vec3::UnitZ());
  const auto mesh = geometryOf(plane(0.04), 1);
  for (int stiffness = 110; stiffness <= 1000; stiffness += 10) {
    scene = SceneFixture();
    scene.add(mesh, surface(stiffness));
    hand.show(scene.snapshot());
    hand.at(-2e-3 * Vec3::UnitZ());
    ASSERT_EQ(hand.renderer().energyShare(), 1) << stiffness;
  }
  EXPECT_NEAR(hand.now().contactForce_N.norm(), 2, 1e-6);
}

// A ball that leaps from pit to pit may spend the casts of a tick on its way.
TEST(EnergyShareOfOneStiffness, Is_whole_on_a_rough_body) {
  constexpr double kBody_m = 0.01;
  constexpr double kRadius_m = 0.002;
  std::mt19937 dice(1);
  std::uniform_real_distribution<float> roughness(0.97F, 1.03F);
  TriangleMesh body = sphere(kBody_m, 30);
  for (geometry::Vec3f& v : body.vertices) v *= roughness(dice);
  SceneFixture scene;
  scene.add(body, surface(1000));
  Hand hand(scene.snapshot(), {.toolRadius_m = kRadius_m});
  const auto direction = [](int tick) {
    const double angle = 4e-3 * tick;  // 0.04 m/s
    return Vec3(Eigen::AngleAxisd(0.2 * angle, Vec3::UnitX()) * Vec3(std::cos(angle), std::sin(angle), 0));
  };
  constexpr int kBegin = 4000;  // some 200 ticks before such a leap
  hand.at((kBody_m + 2 * kRadius_m) * direction(kBegin));
  int interrupted = 0;
  for (int i = kBegin; i < kBegin + reduced(6000, 600); ++i) {
    const Rendering& felt = hand.at(kBody_m * direction(i));
    interrupted += (felt.status & kRenderIterationLimit) != 0 ? 1 : 0;
    ASSERT_EQ(hand.renderer().energyShare(), 1) << "tick " << i << ", interrupted " << interrupted;
  }
  EXPECT_GT(interrupted, 0);
}

// The dampers of a hand that leaves take the pressure, and the friction of the walls lets the proxy go.
TEST(EnergyShareOfOneStiffness, Is_whole_in_damped_grooves) {
  std::mt19937 random(2);
  const auto number = [&random](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  for (int groove = 0; groove < reduced(100); ++groove) {
    SceneFixture scene;
    const double stiffness = number(100, 2000);
    for (const double side : {-1.0, 1.0}) {
      scene::Surface wall = surface(stiffness, number(0.5, 1.2), number(0, 0.5));
      wall.damping_Ns_per_m = number(0, 2);
      scene.add(plane(0.1), wall, Affine(Eigen::AngleAxisd(side * number(0.1, 1.2), Vec3::UnitY())));
    }
    Hand hand(scene.snapshot());
    hand.at(0.01 * Vec3::UnitZ());
    for (int stroke = 0; stroke < 20; ++stroke) {
      const Vec3 end(number(-0.003, 0.003), number(-0.01, 0.01), number(-0.003, 0.001));
      double share = 1;
      hand.to(end, number(0.02, 0.5),
              [&](const Rendering&) { share = std::min(share, hand.renderer().energyShare()); });
      ASSERT_GT(share, 1 - 1e-6) << "groove " << groove << ", stroke " << stroke;
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture
