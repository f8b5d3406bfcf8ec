// The cells of fine meshes must not be felt: T5c, T5d and T13 of the ground truth.
#include <algorithm>
#include <memory>
#include <vector>

#include "realtime/render/proxy.h"
#include "reduced.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

#ifdef HAPTICD_SANITIZED
constexpr int kFineMeshTicks = 400;
#else
constexpr int kFineMeshTicks = 4000;
#endif

class FineMeshTest : public VariantTest {
 protected:
  void clear() {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
  }
  // A rosette on the sphere of the given radius about the centre, seen from the centre downwards (or
  // upwards).
  static Vec3 rosette(const Vec3& centre, double radius, double up, int i) {
    const double a = 2 * M_PI * i / kFineMeshTicks;
    const double rho = 0.006 * std::sin(5 * a) / radius;
    return centre +
           radius * Vec3(std::sin(rho) * std::cos(a), std::sin(rho) * std::sin(a), up * std::cos(rho));
  }
};
INSTANTIATE_TEST_SUITE_P(, FineMeshTest, kVariants, variantName);

// T5c  \           /   bowl of R = 100 mm in jittered cells; a rosette 2 mm below the surface:
//        '-..o..-'     |F| = 2.0 N everywhere, the proxy is never stuck
TEST_P(FineMeshTest, bowl_does_not_hold_the_proxy) {
  constexpr double kRadius = 0.1;
  const auto bowl = [](double x, double y) { return kRadius - std::sqrt(kRadius * kRadius - x * x - y * y); };
  for (const double cell : {0.001, 0.0005, 0.0002}) {
    for (const double mu : {0.0, 0.5}) {
      clear();
      const int cells = static_cast<int>(0.016 / cell);
      add(heightField(cells * cell / 2, cells, bowl, 0.3), surface(1000, mu, mu));
      const Vec3 centre(0, 0, kRadius);
      start(rosette(centre, kRadius - 0.001, -1, 0));
      to(rosette(centre, kRadius + 0.002, -1, 0));
      double least = 1e9;
      double most = 0;
      for (int i = 0; i < kFineMeshTicks; ++i) {
        const Rendering& r = at(rosette(centre, kRadius + 0.002, -1, i));
        least = std::min(least, r.force_N.norm());
        most = std::max(most, r.force_N.norm());
        EXPECT_EQ(r.status, 0U);
      }
      EXPECT_GT(least, 1.9) << cell << " mu " << mu;
      EXPECT_LT(most, mu > 0 ? 2.24 * 1.05 : 2.1) << cell << " mu " << mu;
    }
  }
}

// T5d    .-"o"-.     the same from outside
//      /         \                                       .
TEST_P(FineMeshTest, dome_does_not_hold_the_proxy) {
  constexpr double kRadius = 0.1;
  const auto dome = [](double x, double y) { return std::sqrt(kRadius * kRadius - x * x - y * y) - kRadius; };
  for (const double cell : {0.001, 0.0005, 0.0002}) {
    for (const double mu : {0.0, 0.5}) {
      clear();
      const int cells = static_cast<int>(0.016 / cell);
      add(heightField(cells * cell / 2, cells, dome, 0.3), surface(1000, mu, mu));
      const Vec3 centre(0, 0, -kRadius);
      start(rosette(centre, kRadius + 0.001, 1, 0));
      to(rosette(centre, kRadius - 0.002, 1, 0));
      for (int i = 0; i < kFineMeshTicks; ++i) {
        const Rendering& r = at(rosette(centre, kRadius - 0.002, 1, i));
        EXPECT_GT(r.force_N.norm(), 1.9) << cell << " mu " << mu;
        EXPECT_LT(r.force_N.norm(), mu > 0 ? 2.24 * 1.05 : 2.1) << cell << " mu " << mu;
        EXPECT_EQ(r.status, 0U);
      }
    }
  }
}

// T13  a flat jittered grid at 50 mm/s: no ripple at the seams
TEST_P(FineMeshTest, seams_of_a_flat_grid_are_not_felt) {
  for (const double cell : {0.005, 0.0005, 0.0001}) {
    clear();
    const int cells = std::min(200, static_cast<int>(0.04 / cell));
    const double half = cells * cell / 2;
    add(heightField(
            half, cells, [](double, double) { return 0.0; }, 0.4),
        surface());
    start({-0.9 * half, -0.83 * half, 0.001});
    to({-0.9 * half, -0.83 * half, -0.001});
    to({0.9 * half, 0.77 * half, -0.001}, 0.05, [&](const Rendering& r) {
      EXPECT_NEAR(r.force_N.z(), 1.0, 0.001);
      EXPECT_LT(r.force_N.head<2>().norm(), 1e-4);
      EXPECT_EQ(r.status, 0U);
    });
  }
}

// More triangles within a ball's radius than a tick can gather.
//
//    .-----.
//   (       )     pushed through a sheet: 1000 N/m up to 0.5 N, and through once there is room behind it
//  --'-----'--
TEST(FineSheet, lets_a_ball_through_at_its_force) {
  constexpr double kRadius = 0.002;
  constexpr double kLimit_N = 0.5;
  for (const int cells : {80, reduced(320, 160)}) {
    SceneFixture scene;
    scene::Surface s = surface(1000);
    s.popthrough_N = kLimit_N;
    scene.add(plane(0.008, cells), s);
    Hand hand(scene.snapshot(), {.toolRadius_m = kRadius});
    double depth = -0.001;
    bool through = false;
    for (; depth < 2.5 * kRadius && !through; depth += 20e-6) {
      const Rendering& r = hand.at({1e-5, 2e-5, kRadius - depth});
      ASSERT_EQ(r.status & kRenderWorkLimit, 0U) << depth;
      through = (r.status & kRenderPopthrough) != 0;
      const double spring_N = 1000 * std::max(0.0, depth);
      if (!through) {
        ASSERT_NEAR(r.force_N.norm(), std::min(spring_N, kLimit_N), 1e-3) << depth;
      }
    }
    EXPECT_TRUE(through) << cells;
    EXPECT_NEAR(depth, 2 * kRadius, 100e-6) << cells;
  }
}

// Under a hand at rest: what a tick gathers in reserve is more than fits, and is gathered anew in every tick.
TEST(FineSheet, that_moves_keeps_its_force) {
  constexpr double kRadius = 0.01;
  SceneFixture scene;
  scene::ObjectState& object = scene.add(plane(0.008, reduced(160, 80)), surface(1000));
  Affine lower = object.motion.destination();
  lower.pretranslate(Vec3(0, 0, -0.0008));
  object.motion = scene::Motion::between(object.motion.origin(), lower, toNanos(0.1), toNanos(0.6));
  Hand hand(scene.snapshot(), {.toolRadius_m = kRadius});
  hand.at({0, 0, kRadius + 0.001});
  hand.to({0, 0, kRadius - 0.001}, 0.05);
  while (hand.time() < toNanos(0.6)) {
    const double moved_s = std::max(0.0, base::toSeconds(hand.time()) - 0.1);
    const Rendering& r = hand.at({0, 0, kRadius - 0.001});
    ASSERT_EQ(r.status, 0U) << moved_s;
    ASSERT_NEAR(r.force_N.norm(), 1000 * (0.001 - 0.0016 * moved_s), 5e-3) << moved_s;
  }
}

// A vertex that stands out elsewhere, and a boss: the ball's centre is outside the box of the mesh, and near
// to what it touches.
TEST(FineSheet, that_is_not_flat_is_felt) {
  for (const double radius : {0.005, 0.02}) {
    for (const bool boss : {false, true}) {
      const double half = 0.4 * radius;
      const int cells = reduced(140, 90);
      TriangleMesh mesh = plane(half, cells);
      for (Vec3f& v : mesh.vertices) {
        const bool corner = v.x() < -0.97 * half && v.y() < -0.97 * half;
        if (boss ? v.x() < -0.8 * half : corner) v.z() = static_cast<float>(0.1 * radius);
      }
      SceneFixture scene;
      scene.add(mesh, surface(1000));
      Hand hand(scene.snapshot(), {.toolRadius_m = radius});
      const double x = 0.3 * half;
      hand.at({x, 0, 1.2 * radius});
      hand.to({x, 0, radius - 0.0005}, 0.05, [&](const Rendering& r) { ASSERT_EQ(r.status, 0U); });
      EXPECT_NEAR(hand.now().force_N.z(), 0.5, 1e-6) << radius << (boss ? " boss" : " corner");
    }
  }
}

// The same: the reserve, too, is what fits.
TEST(FineSheet, that_moves_is_examined_in_part) {
  constexpr double kRadius = 0.01;
  SceneFixture scene;
  scene::ObjectState& object = scene.add(plane(0.008, 160), surface(1000));
  Affine lower = object.motion.destination();
  lower.pretranslate(Vec3(0, 0, -0.0008));
  object.motion = scene::Motion::between(object.motion.origin(), lower, 0, toNanos(0.5));
  const auto snapshot = scene.snapshot();
  const auto proxy = std::make_unique<Proxy>(RenderOptions{.toolRadius_m = kRadius});
  std::vector<int> visits;
  for (int i = 0; i < 200; ++i) {
    std::uint32_t status = 0;
    proxy->follow({snapshot.get(), (i + 1) * kTick}, {0, 0, kRadius + std::max(-0.001, 0.001 - 50e-6 * i)},
                  Vec3::Zero(), 1e-3, status);
    visits.push_back(proxy->visits());
  }
  std::nth_element(visits.begin(), visits.begin() + 100, visits.end());
  EXPECT_LT(visits[100], 1000);
}

// What was learnt elsewhere ends where a recording begins: from there, the same hand gives the same in every
// bit, by the same work. The levels of a fan depend on how far a tick gathers.
TEST(FineSheet, leaves_nothing_behind_once_forgotten) {
  constexpr double kRadius = 0.005;
  constexpr int kMeridians = 600;
  TriangleMesh cone;
  cone.vertices.push_back(Vec3f::Zero());
  for (int i = 0; i < kMeridians; ++i) {
    const double a = 2 * M_PI * i / kMeridians;
    const auto next = static_cast<std::uint32_t>(1 + (i + 1) % kMeridians);
    cone.vertices.push_back(Vec3(0.008 * std::cos(a), 0.008 * std::sin(a), -0.0005).cast<float>());
    cone.triangles.push_back({0, static_cast<std::uint32_t>(1 + i), next});
  }
  SceneFixture scene;
  scene.add(cone, surface(1000));
  scene.add(plane(0.008, 400), surface(1000), Affine(Eigen::Translation3d(0.1, 0, 0)));
  const auto snapshot = scene.snapshot();
  const auto feltAfter = [&](double strokedAt_m) {
    const auto proxy = std::make_unique<Proxy>(RenderOptions{.toolRadius_m = kRadius});
    Nanos now = 0;
    std::vector<std::tuple<std::uint32_t, Vec3, int>> felt;
    const auto at = [&](const Vec3& hip) {
      std::uint32_t status = 0;
      proxy->follow({snapshot.get(), now += kTick}, hip, Vec3::Zero(), 1e-3, status);
      felt.emplace_back(status, proxy->position(), proxy->visits());
    };
    for (int i = 0; std::isfinite(strokedAt_m) && i < 400; ++i)
      at({strokedAt_m + 0.003 * std::cos(0.1 * i), 0.003 * std::sin(0.1 * i),
          kRadius + std::max(-0.0005, 0.001 - 5e-5 * i)});
    for (int i = 0; i < 5; ++i) at({0, 0.0002, kRadius + 0.02});
    proxy->forget();
    felt.clear();
    constexpr int kTicks = reduced(2000);
    for (int i = 0; i < kTicks; ++i) {
      const double t = 2.0 * i / kTicks;
      at({0.001 * std::sin(7 * t), 0.0002 + 0.0007 * std::cos(5 * t),
          kRadius + 0.002 - 0.003 * std::min(1.0, t)});
    }
    return felt;
  };
  const auto nothing = feltAfter(std::numeric_limits<double>::infinity());
  EXPECT_TRUE(feltAfter(0.1) == nothing) << "the sheet";
  EXPECT_TRUE(feltAfter(0) == nothing) << "the cone";
}

// What fits is known from the ticks before, but for the first one: all of it would be too much in every tick.
TEST(FineSheet, is_stroked_at_1_m_per_s_within_the_work_of_a_tick) {
  constexpr double kRadius = 0.002;
  constexpr double kTurn = 0.006;
  SceneFixture scene;
  scene.add(plane(0.008, 320), surface(1000));
  Hand hand(scene.snapshot(), {.toolRadius_m = kRadius});
  hand.at({kTurn, 0, kRadius + 0.001});
  hand.to({kTurn, 0, kRadius - 0.001}, 0.05);
  for (int i = 0; i < reduced(500); ++i) {
    const double angle = 0.001 * i / kTurn;
    const Rendering& r = hand.at({kTurn * std::cos(angle), kTurn * std::sin(angle), kRadius - 0.001});
    if (i < 3) continue;
    ASSERT_EQ(r.status, 0U) << i;
    ASSERT_NEAR(r.force_N.norm(), 1, 0.005) << i;
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture
