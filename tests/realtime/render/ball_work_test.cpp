// What a ball examines in a tick: what its way comes near, and not all that is within its radius.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <random>
#include <vector>

#include "meshes.h"
#include "realtime/render/proxy.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

// The proxy of a ball, a hand that goes where the test says, and what each tick took.
class Ball {
 public:
  Ball(const SceneFixture& scene, double radius)
      : snapshot_(scene.snapshot()), proxy_(std::make_unique<Proxy>(RenderOptions{.toolRadius_m = radius})) {}

  /// What is felt of a surface of 1000 N/m.
  double at(const Vec3& hip) {
    status_ = 0;
    const ContactSet& felt =
        proxy_->follow({snapshot_.get(), now_ += kTick}, hip, Vec3::Zero(), 1e-3, status_);
    return felt.count == 0 ? 0 : 1000 * (felt.normal_m + felt.lateral_m).norm() * proxy_->feltShare();
  }
  int visits() const { return proxy_->visits(); }
  int enclosureVisits() const { return proxy_->enclosureVisits(); }
  std::uint32_t status() const { return status_; }
  const Vec3& place() const { return proxy_->position(); }

 private:
  std::shared_ptr<const scene::SceneSnapshot> snapshot_;
  std::unique_ptr<Proxy> proxy_;
  Nanos now_ = 0;
  std::uint32_t status_ = 0;
};

// The lower half of a sphere around the origin, front side in.
TriangleMesh bowl(double radius, int meridians, int rings) {
  TriangleMesh mesh;
  mesh.vertices.push_back(Vec3f(0, 0, static_cast<float>(-radius)));
  for (int j = 1; j <= rings; ++j) {
    for (int i = 0; i < meridians; ++i) {
      const double a = 2 * M_PI * i / meridians;
      const double b = M_PI / 2 * j / rings;
      mesh.vertices.push_back(
          (radius * Vec3(std::sin(b) * std::cos(a), std::sin(b) * std::sin(a), -std::cos(b))).cast<float>());
    }
  }
  const auto id = [&](int j, int i) {
    return static_cast<std::uint32_t>(j == 0 ? 0 : 1 + (j - 1) * meridians + i % meridians);
  };
  for (int j = 0; j < rings; ++j) {
    for (int i = 0; i < meridians; ++i) {
      if (j > 0) mesh.triangles.push_back({id(j, i), id(j + 1, i), id(j, i + 1)});
      mesh.triangles.push_back({id(j, i + 1), id(j + 1, i), id(j + 1, i + 1)});
    }
  }
  return mesh;
}

// Half a cylinder along x, of needles as long as it is; front side in.
TriangleMesh trough(double radius, int needles) {
  TriangleMesh mesh;
  for (int i = 0; i <= needles; ++i) {
    const double a = M_PI * i / needles;
    for (const double x : {-0.03, 0.03})
      mesh.vertices.push_back(Vec3(x, -radius * std::cos(a), -radius * std::sin(a)).cast<float>());
  }
  for (int i = 0; i < needles; ++i) {
    const auto a = static_cast<std::uint32_t>(2 * i);
    mesh.triangles.push_back({a, a + 1, a + 3});
    mesh.triangles.push_back({a, a + 3, a + 2});
  }
  return mesh;
}

//    .---.       1 m/s over cells of 0.1 mm: 2100 triangles are within the reach of a ball of 1 mm
//   (  -> )      in a tick, 10 000 of one of 5 mm; its way comes near few
//  __'---'__
TEST(WorkOfABall, follows_its_way_over_a_fine_mesh) {
  struct Case {
    double radius_m;
    int visits;
  };
  SceneFixture scene;
  scene.add(heightField(
                0.015, 300, [](double, double) { return 0.0; }, 0.3),
            surface(1000));
  for (const Case& c : {Case{0.001, 300}, Case{0.002, 400}, Case{0.005, 800}}) {
    Ball ball(scene, c.radius_m);
    constexpr double kTurn_m = 0.008;
    for (int i = 0; i < reduced(600, 200); ++i) {
      const double angle = 1e-3 * i / kTurn_m;
      const double depth_m = std::min(0.001, 50e-6 * i - 0.001);
      const double felt =
          ball.at({kTurn_m * std::cos(angle), kTurn_m * std::sin(angle), c.radius_m - depth_m});
      if (i < 60) continue;
      ASSERT_NEAR(felt, 1, 1e-3) << c.radius_m << ", tick " << i;
      ASSERT_LT(ball.visits(), c.visits) << c.radius_m << ", tick " << i;
    }
  }
}

//  |  .---.  |   a ball in a bowl a little larger: all of it, more than a tick can gather,
//   \(     )/    is within 0.5 mm of each place of the ball
//    `-._.-'
TEST(WorkOfABall, lets_it_feel_a_fine_bowl_a_little_larger) {
  constexpr double kRadius_m = 0.005;
  constexpr double kGap_m = 0.0005;
  constexpr double kDeep_m = 0.001;
  struct Case {
    int meridians, rings;
  };
  for (const Case& c : {Case{200, 90}, Case{600, 30}}) {
    SceneFixture scene;
    scene.add(bowl(kRadius_m + kGap_m, c.meridians, c.rings), surface(1000));
    Ball ball(scene, kRadius_m);
    for (int i = 0; i < 40; ++i) ball.at({1e-5, 2e-5, 0.012 - 3e-4 * i});
    int spent = 0;
    const int ticks = reduced(800, 150);
    for (int i = 0; i < ticks; ++i) {
      const double tilt = 0.8 * std::sin(0.03 * i);
      const double turn = 0.013 * i;
      const double away_m = std::min(1.0, i / 50.0) * (kGap_m + kDeep_m);
      const Vec3 direction(std::sin(tilt) * std::cos(turn), std::sin(tilt) * std::sin(turn), -std::cos(tilt));
      const double felt = ball.at(away_m * direction);
      const bool late = (ball.status() & kRenderWorkLimit) != 0;
      spent += late ? 1 : 0;
      // The middles of the faces are nearer than the corners, by up to 15 um.
      ASSERT_NEAR(felt, 1000 * std::max(0.0, away_m - kGap_m), late ? 0.1 : 0.02)
          << c.meridians << ", tick " << i;
    }
    EXPECT_LT(spent, ticks / 20) << c.meridians;
  }
}

// Many needles are as long as the mesh, so that a ball around each rules out none.
TEST(WorkOfABall, follows_its_way_along_needles) {
  constexpr double kRadius_m = 0.010;
  constexpr double kGap_m = 0.0001;
  constexpr double kAway_m = kGap_m + 0.001;
  SceneFixture scene;
  scene.add(trough(kRadius_m + kGap_m, 3200), surface(1000));
  Ball ball(scene, kRadius_m);
  double x = -0.015;
  for (int i = 0; i < 60; ++i) ball.at({x, 1e-4, std::max(-kAway_m, 0.002 - 1e-4 * i)});
  double step = 1e-3;
  for (int i = 0; i < reduced(400, 60); ++i) {
    if (std::abs(x += step) > 0.015) step = -step;
    const double tilt = 0.3 * std::sin(0.01 * i);
    const double felt = ball.at({x, kAway_m * std::sin(tilt), -kAway_m * std::cos(tilt)});
    if (i < 2) continue;
    ASSERT_EQ(ball.status(), 0U) << i;
    ASSERT_NEAR(felt, 1, 0.001) << i;
    ASSERT_NEAR(ball.place().x(), x, 1e-6) << "nothing holds it along the needles, tick " << i;
  }
}

// A bowl a hair larger, of more triangles than a tick can look at: it is not felt, and no tick looks at all
// of it.
TEST(WorkOfABall, ends_in_a_bowl_that_is_too_fine) {
  constexpr double kRadius_m = 0.010;
  SceneFixture scene;
  scene.add(bowl(kRadius_m + 0.0001, 500, 200), surface(1000));
  Ball ball(scene, kRadius_m);
  int spent = 0;
  for (int i = 0; i < reduced(300, 150); ++i) {
    ball.at({1e-4 * std::sin(0.02 * i), 1e-4 * std::cos(0.02 * i), std::max(-0.0015, 0.012 - 2e-4 * i)});
    ASSERT_LT(ball.visits(), kMaxVisits + 1024) << i;
    spent += (ball.status() & kRenderWorkLimit) != 0 ? 1 : 0;
  }
  EXPECT_GT(spent, 50);
}

// A ray through the tree of a body takes time whatever it meets, and counts as well. Bodies beyond the work
// of a tick count as around the hand until it has left them.
TEST(WorkOfABall, is_little_within_many_bodies_that_appeared_at_once) {
  constexpr int kRays = 64;
  constexpr int kMost = 16384;
  for (const double radius_m : {0.0, 0.001}) {
    for (const int bodies : {5, 50}) {
      SceneFixture scene;
      for (int i = 0; i < bodies; ++i) scene.add(sphere(0.01 + 2e-4 * i, 12), surface(1000));
      Ball ball(scene, radius_m);
      EXPECT_EQ(ball.at({0, 0, 0.001}), 0);
      EXPECT_NE(ball.status() & kRenderEnclosed, 0U);
      EXPECT_GE(ball.enclosureVisits(), std::min(kMost, 16 * kRays * bodies)) << bodies;
      EXPECT_LE(ball.enclosureVisits(), kMost + 16) << bodies;
      for (int i = 0; i < 100; ++i) ball.at({0, 0, 0.04});
      EXPECT_EQ(ball.status() & kRenderEnclosed, 0U) << bodies;
      double felt = 0;
      for (int i = 0; i < 300; ++i) felt = ball.at({0, 0, 0.04 - 1e-4 * i});
      EXPECT_GT(felt, 0.5) << bodies;
    }
  }
}

// What appears around the hand and has too many triangles to tell when the hand has left it takes the time of
// few ticks only, and is felt soon after.
TEST(WorkOfABall, is_little_within_what_appeared_and_has_too_many_triangles) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> place(-0.02F, 0.02F);
  TriangleMesh soup;
  for (std::uint32_t i = 0; i < 20'000; ++i) {
    for (int k = 0; k < 3; ++k) soup.vertices.emplace_back(place(random), place(random), place(random));
    soup.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  SceneFixture scene;
  scene.add(soup, surface(1000));
  for (const double radius_m : {0.0, 0.001}) {
    Ball ball(scene, radius_m);
    int busy = 0;
    constexpr int kTicks = 320;
    for (int i = 0; i < kTicks; ++i) {
      EXPECT_EQ(ball.at({0, 0, 1e-5 * i}), 0);
      ASSERT_NE(ball.status() & kRenderEnclosed, 0U) << i;
      busy += ball.enclosureVisits() > 0 ? 1 : 0;
    }
    EXPECT_LE(busy, kTicks / 16) << radius_m;
    int left = 0;
    for (; (ball.status() & kRenderEnclosed) != 0 && left < 100; ++left) ball.at({0, 0, 0.03});
    EXPECT_LE(left, 17) << radius_m;
    double felt = 0;
    for (int i = 0; i < 100; ++i) felt = ball.at({0, 0, 0.03 - 2e-4 * i});
    EXPECT_GT(felt, 1) << radius_m;
  }
}

// All of a bowl that deforms around a ball may push it, which takes exact tests of all its triangles.
TEST(WorkOfABall, ends_where_faces_that_deform_push_it) {
  constexpr double kRadius_m = 0.005;
  const TriangleMesh mesh = bowl(0.0055, 80, 51);
  std::vector<Vec3f> target = mesh.vertices;
  for (Vec3f& v : target) v += Vec3f(0.0003F, 0, 0.0002F);
  SceneFixture scene;
  scene.add(geometryOf(mesh, 1, &target, toNanos(0.05), toNanos(0.6)), surface(1000));
  Ball ball(scene, kRadius_m);
  for (int i = 0; i < reduced(600, 80); ++i) {
    ball.at({1e-4 * std::sin(0.02 * i), 1e-4 * std::cos(0.02 * i), std::max(-0.0015, 0.004 - 1e-4 * i)});
    ASSERT_LT(ball.visits(), kMaxVisits + 1024) << i;
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture
