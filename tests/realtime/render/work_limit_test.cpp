// Meshes that spend the work of every tick: the proxy gets through nothing, and the force fades out.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "meshes.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

// Large triangles in almost one place, so that all of them are around the tool wherever it touches.
TriangleMesh copies(int count, double jitter_m) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> jitter(-jitter_m, jitter_m);
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vec3& corner : {Vec3(-0.1, 0, -0.1), Vec3(0, 0, 0.1), Vec3(0.1, 0, -0.1)})
      mesh.vertices.push_back((corner + Vec3(jitter(random), jitter(random), jitter(random))).cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

double shareAfter(int spentInARow) {
  return std::clamp(1 - (spentInARow - 20) / 50.0, 0.0, 1.0);
}

class WorkLimit : public testing::TestWithParam<int> {};

// Fewer copies do not spend the work; more than about 8000 spend it before one of them is felt.
INSTANTIATE_TEST_SUITE_P(Copies, WorkLimit, testing::Values(6000, 7000));

// What does not fit is not gathered again with each cast.
TEST(Copies, are_felt_up_to_3000) {
  for (const int count : {600, 1500, 2000, 3000}) {
    SceneFixture fixture;
    fixture.add(copies(count, 1e-6), surface(1000));
    Hand hand(fixture.snapshot());
    hand.at({0, 0.005, 0});
    for (int tick = 0; tick < 40; ++tick) {
      const Rendering& r = hand.at({0, 0.005 - 0.0006 * std::min(tick, 10), 0});
      EXPECT_EQ(r.status & kRenderWorkLimit, 0U) << count << " copies, tick " << tick;
      if (tick < 10) continue;
      EXPECT_NEAR(r.force_N.norm(), 1, 0.01) << count << " copies, tick " << tick;
    }
  }
}

TEST_P(WorkLimit, force_fades_out_after_20_ticks_and_returns_when_the_hand_has_left) {
  constexpr double kJitter_m = 1e-6;
  SceneFixture fixture;
  fixture.add(copies(GetParam(), kJitter_m), surface(1000));
  Hand hand(fixture.snapshot());
  const Vec3 above(0, 0.005, 0);
  const Vec3 pressed(0, -0.001, 0);
  for (int touch = 0; touch < 2; ++touch) {
    hand.at(above);
    EXPECT_EQ(hand.at(above).status & kRenderWorkLimit, 0U) << "nothing to examine";
    int spent = 0;  // in a row
    for (int tick = 1; tick <= 100; ++tick) {
      const Rendering& r = hand.at(tick < 10 ? Vec3(above + tick / 10.0 * (pressed - above)) : pressed);
      EXPECT_GE(r.proxy_m.y(), -kJitter_m - 1e-9) << tick;
      spent = (r.status & kRenderWorkLimit) != 0 ? spent + 1 : 0;
      if (tick < 10) continue;
      EXPECT_NEAR(r.force_N.norm(), shareAfter(spent) * 1.0, 0.01) << tick << ", " << spent << " spent";
    }
    EXPECT_GT(spent, 80);
  }
}

TEST_P(WorkLimit, friction_fades_out_with_the_force) {
  constexpr double kFriction = 0.5;
  SceneFixture fixture;
  fixture.add(copies(GetParam(), 1e-6), surface(1000, kFriction, kFriction));
  Hand hand(fixture.snapshot());
  int spent = 0;  // in a row
  const auto count = [&](const Rendering& r) { spent = (r.status & kRenderWorkLimit) != 0 ? spent + 1 : 0; };
  hand.at(Vec3(-0.005, 0.005, 0));
  hand.to(Vec3(-0.005, -0.001, 0), 0.6, count);
  hand.to(Vec3(0.005, -0.001, 0), 0.1, [&](const Rendering& r) {
    count(r);
    if (hand.hip().x() < -0.004) return;  // it still sticks
    const double share = shareAfter(spent);
    EXPECT_NEAR(r.force_N.y(), share, 0.01) << hand.hip().x() << ", " << spent << " spent";
    EXPECT_NEAR(r.force_N.x(), -share * kFriction, 0.01) << hand.hip().x() << ", " << spent << " spent";
  });
  EXPECT_GT(spent, 80);
}

// A floor rises through the hand; others whose boxes are around it move elsewhere and spend the work. They do
// not take the proxy along where their ways were not examined.
TEST(WorkLimitOfMotions, proxy_follows_none_that_was_not_examined) {
  constexpr int kOthers = 15;
  constexpr int kSheets = 60;
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> distance(0.04, 0.06);
  const auto rise = [](double height) {
    Affine t = Affine::Identity();
    t.translation().y() = height;
    return t;
  };
  SceneFixture fixture;
  TriangleMesh floor;
  floor.vertices = {Vec3f(-0.1F, 0, -0.1F), Vec3f(0, 0, 0.1F), Vec3f(0.1F, 0, -0.1F)};
  floor.triangles = {{0, 1, 2}};
  constexpr double kStart_m = -0.002;
  constexpr double kSpeed_m_per_s = 0.05;
  constexpr int kDuration = 160;
  fixture.add(geometryOf(floor, 1), surface(1000),
              scene::Motion::between(rise(kStart_m), rise(kStart_m + 1e-3 * kDuration * kSpeed_m_per_s), 0,
                                     kDuration * kTick));
  for (int i = 0; i < kOthers; ++i) {
    TriangleMesh sheets;
    for (int k = 0; k < kSheets; ++k) {
      const Vec3 n = Vec3(normal(random), -2, normal(random)).normalized();
      const Vec3 u = 0.2 * n.unitOrthogonal();
      const Vec3 centre = -distance(random) * n;
      const auto first = static_cast<std::uint32_t>(sheets.vertices.size());
      for (const Vec3& corner : {Vec3(-u - n.cross(u)), Vec3(u - n.cross(u)), Vec3(n.cross(u))})
        sheets.vertices.push_back((centre + corner).cast<float>());
      sheets.triangles.push_back({first, first + 1, first + 2});
    }
    const Affine away = rise(-0.0016 * (1 + i));
    fixture.add(geometryOf(sheets, 2 + static_cast<std::uint64_t>(i)), surface(1000),
                scene::Motion::between(Affine::Identity(), away, 0, kDuration * kTick));
  }
  Hand hand(fixture.snapshot());
  int spent = 0;
  for (int tick = 0; tick < kDuration; ++tick) {
    const double top = kStart_m + 1e-3 * tick * kSpeed_m_per_s;
    const Rendering& r = hand.at({0.001, 0, 0.002});
    spent += (r.status & kRenderWorkLimit) != 0 ? 1 : 0;
    ASSERT_GE(r.proxy_m.y(), top - 1e-8) << tick;
  }
  EXPECT_GT(spent, 20);
}

// Most of the mesh is as far from the centre of the ball as the part that it touches, within a share.
TEST(WorkLimitOfABall, is_not_spent_on_a_fine_flat_mesh) {
  SceneFixture fixture;
  fixture.add(heightField(0.015, 300, [](double, double) { return 0.0; }), surface(1000));
  constexpr double kRadius_m = 0.01;
  Hand hand(fixture.snapshot(), {.toolRadius_m = kRadius_m});
  int spent = 0;
  hand.at(Vec3(1e-5, 2e-5, kRadius_m + 0.001));
  const Rendering& r = hand.to(Vec3(1e-5, 2e-5, kRadius_m - 0.001), 0.05, [&](const Rendering& now) {
    spent += (now.status & kRenderWorkLimit) != 0 ? 1 : 0;
  });
  EXPECT_LE(spent, 2);
  EXPECT_NEAR(r.force_N.z(), 1.0, 1e-3);
}

// Cells of 0.1 mm at 1 m/s, to and fro: thousands of triangles are within the reach of a tick, but its path
// comes near few.
TEST(WorkLimitOfABall, is_not_spent_on_a_stroke_over_a_fine_mesh) {
  constexpr double kTurn_m = 0.008;
  constexpr double kStep_m = 1e-3;
  SceneFixture fixture;
  fixture.add(heightField(0.015, 300, [](double, double) { return 0.0; }), surface(1000));
  for (const double radius : {0.001, 0.002, 0.005}) {
    Hand hand(fixture.snapshot(), {.toolRadius_m = radius});
    const double depth_m = 0.001;
    hand.at(Vec3(1e-5, 2e-5, radius + 0.001));
    hand.to(Vec3(1e-5, 2e-5, radius - depth_m), 0.05, [](const Rendering&) {});
    int spent = 0;
    double x = 1e-5;
    double step = kStep_m;
    for (int tick = 0; tick < 80; ++tick) {
      x += step;
      if (std::abs(x) > kTurn_m) step = -step;
      const Rendering& r = hand.at(Vec3(x, 2e-5, radius - depth_m));
      spent += (r.status & (kRenderWorkLimit | kRenderIterationLimit)) != 0 ? 1 : 0;
      EXPECT_NEAR(r.force_N.z(), 1000 * depth_m, 1e-3) << radius << ", tick " << tick;
    }
    EXPECT_EQ(spent, 0) << radius;
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture
