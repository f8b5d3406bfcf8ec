// Statics of a frictionless contact: T1, T2, T4, T5, T6, T8, T10, T11 of the ground truth.
#include <algorithm>
#include <random>

#include "reduced.h"
#include "variants.h"

namespace hapticd::realtime::fixture {
namespace {

class ContactTest : public VariantTest {};
INSTANTIATE_TEST_SUITE_P(, ContactTest, kVariants, variantName);

// T1         o HIP above, then
//     -------+------- z = 0
//            o  d: F = k d n, nothing sideways
TEST_P(ContactTest, plane_pushes_back_by_stiffness_times_depth) {
  add(plane(0.05, 10), surface());
  start({0.0013, 0.0021, 0.001});
  for (int i = 0; i <= 40; ++i) {
    const double depth = i * 5e-5;
    const Rendering& r = to({0.0013 + 3e-5 * i, 0.0021, -depth});
    EXPECT_NEAR(r.force_N.z(), 1000 * depth, 1e-6);
    EXPECT_NEAR(r.force_N.head<2>().norm(), 0, 1e-6);
    EXPECT_TRUE(r.touching || depth == 0);
    EXPECT_EQ(r.status, 0U);
    if (depth > 0) {
      EXPECT_NEAR(r.depth_m, depth, 1e-9);
      EXPECT_NEAR((r.normal - Vec3::UnitZ()).norm(), 0, 1e-9);
      EXPECT_NEAR((r.scp_m - offset() - Vec3(hip().x(), hip().y(), 0)).norm(), 0, 1e-7);
    }
  }
}

// T2      .-"""-.
//        /   o<--\-- 2 mm below, from 200 directions: F = k (R - |x|) along the radius
//        \       /
//         '-...-'
TEST_P(ContactTest, sphere_pushes_along_its_radius) {
  constexpr double kRadius = 0.05;
  add(sphere(kRadius, 112), surface());
  std::mt19937 random(2);
  std::normal_distribution<double> gauss;
  for (int i = 0; i < 200; ++i) {
    const Vec3 direction = Vec3(gauss(random), gauss(random), gauss(random)).normalized();
    start(1.02 * kRadius * direction);
    const Rendering& r = to((kRadius - 0.002) * direction);
    // The facets are up to 10 um inside the sphere: 0.5 % of the depth.
    EXPECT_NEAR(r.force_N.norm(), 2.0, 0.02);
    EXPECT_GT(r.force_N.normalized().dot(direction), std::cos(1.0 * M_PI / 180));
  }
}

// Two walls that meet in a concave edge along y: z = 0 for x > 0 and x = 0 for z > 0, front sides inwards.
TriangleMesh concaveEdge() {
  TriangleMesh mesh;
  mesh.vertices = {{0, -0.05F, 0}, {0.05F, -0.05F, 0}, {0.05F, 0.05F, 0},
                   {0, 0.05F, 0},  {0, -0.05F, 0.05F}, {0, 0.05F, 0.05F}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {0, 3, 5}, {0, 5, 4}};
  return mesh;
}

// T4   |
//      |   the proxy stays on the edge line, F = (1, 0, 2) N, in the same tick
//      +--------
//    o  1 mm behind the wall, 2 mm below the floor
TEST_P(ContactTest, concave_edge_holds_with_two_planes) {
  add(concaveEdge(), surface());
  start({0.003, 0.0107, 0.003});
  const Rendering& r = at({-0.001, 0.0107, -0.002});
  EXPECT_NEAR((r.force_N - Vec3(1, 0, 2)).norm(), 0, 1e-5);
  EXPECT_NEAR((proxy() - Vec3(0, 0.0107, 0)).norm(), 0, 1e-6);
  at({-0.001, 0.0107, -0.002});
  EXPECT_NEAR((r.force_N - Vec3(1, 0, 2)).norm(), 0, 1e-5);
  // It follows along the edge and out of it without delay.
  EXPECT_NEAR((at({-0.001, 0.0117, -0.002}).force_N - Vec3(1, 0, 2)).norm(), 0, 1e-5);
  EXPECT_NEAR((at({0.001, 0.0117, -0.002}).force_N - Vec3(0, 0, 2)).norm(), 0, 1e-5);
}

// T5   a corner of three walls: the proxy on the vertex, F = (1, 1.5, 2) N, and no ripple at rest
TEST_P(ContactTest, corner_holds_with_three_planes) {
  TriangleMesh corner = box(Vec3::Zero(), Vec3::Constant(0.05));
  for (auto& t : corner.triangles) std::swap(t[1], t[2]);  // felt from inside
  add(corner, surface());
  start({0.003, 0.002, 0.004});
  const Rendering& r = at({-0.001, -0.0015, -0.002});
  const Vec3 first = r.force_N;
  EXPECT_NEAR((first - Vec3(1, 1.5, 2)).norm(), 0, 1e-5);
  EXPECT_NEAR(proxy().norm(), 0, 1e-6);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(at({-0.001, -0.0015, -0.002}).force_N, first);
}

// Vertices between ridges and valleys, under a point that is pulled across. The faces are a cone: a point at
// its tip rests there only if no ray of a face leads down along the pull.
TEST_P(ContactTest, point_slides_over_vertices_between_ridges_and_valleys) {
  constexpr double kRim_m = 0.01;
  constexpr double kAt_m = 1e-6;
  constexpr double kSlope = 0.1;
  constexpr double kTremor_m = 1e-6;  // of a hand that is not exactly above an edge
  std::mt19937 random(17);
  std::uniform_real_distribution<double> share(0, 1);
  int crossed = 0;
  int stuck = 0;
  const int trials = reduced(1000, 250);
  for (int trial = 0; trial < trials; ++trial) {
    TriangleMesh fan;
    fan.vertices.push_back(Vec3f::Zero());
    const int count = 4 + static_cast<int>(5 * share(random));
    for (int i = 0; i < count; ++i) {
      const double a = 2 * M_PI * (i + 0.6 * share(random)) / count;
      fan.vertices.push_back(
          Vec3f(kRim_m * Vec3(std::cos(a), std::sin(a), 1.6 * share(random) - 0.8).cast<float>()));
      fan.triangles.push_back(
          {0, static_cast<std::uint32_t>(1 + i), static_cast<std::uint32_t>(1 + (i + 1) % count)});
      if (trial % 2 == 1 && share(random) < 0.5) std::swap(fan.triangles.back()[1], fan.triangles.back()[2]);
    }
    const auto slope = [&](const Vec3& pull) {
      double steepest = -1;
      for (const auto& t : fan.triangles) {
        const Vec3 b = fan.vertices[t[1]].cast<double>();
        const Vec3 c = fan.vertices[t[2]].cast<double>();
        for (int i = 0; i <= 100; ++i)
          steepest = std::max(steepest, pull.dot((b + 0.01 * i * (c - b)).normalized()));
      }
      return steepest / pull.norm();
    };
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    if (trial % 2 == 1) scene.faces = scene::TouchableFaces::both;
    add(fan, surface());
    const double a = 2 * M_PI * share(random);
    const Vec3 away(std::cos(a), std::sin(a), 0);
    start(0.004 * Vec3::UnitZ() - 1e-4 * away);
    to(-0.001 * Vec3::UnitZ() - 1e-4 * away);
    to(-0.001 * Vec3::UnitZ() + 0.001 * away, 0.02, [&](const Rendering&) {
      if (proxy().norm() > kAt_m) return;
      ++crossed;
      const Vec3 h = hip();
      if (slope(h) < kSlope) return;
      for (int i = 0; i < 3; ++i) at(h + kTremor_m * Vec3(share(random) - 0.5, share(random) - 0.5, 0));
      if (proxy().norm() > kAt_m) return;
      ++stuck;
    });
  }
  EXPECT_GT(crossed, trials * 6 / 10);
  EXPECT_LT(100 * stuck, crossed) << "in the narrowest valleys";
}

// T5b  two planes at 0.0003 ... 0.3 rad: sliding from one to the other at 50 mm/s, the proxy never lags
TEST_P(ContactTest, shallow_concave_seam_does_not_hold_the_proxy_back) {
  for (const double angle : {0.0003, 0.003, 0.03, 0.3}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    add(heightField(0.05, 100, [&](double x, double) { return std::tan(angle / 2) * std::abs(x); }),
        surface());
    start({-0.01, 0.00023, 0.002});
    to({-0.01, 0.00023, -0.002});
    to({0.01, 0.00023, -0.002}, 0.05, [&](const Rendering&) {
      const Vec3 h = hip();
      const double side = h.x() < 0 ? -1 : 1;
      const Vec3 n = Vec3(-side * std::sin(angle / 2), 0, std::cos(angle / 2));
      Vec3 nearest = h - n * n.dot(h);
      if (nearest.x() * side < 0) nearest = Vec3(0, h.y(), 0);
      EXPECT_LT((proxy() - nearest).norm(), 1e-6) << angle << " at " << h.x();
    });
  }
}

// T6  ----+        sliding over a convex edge of exterior angle phi, the HIP d below the top:
//      o->| phi    one jump of at most k d sin(phi) + k v T
TEST_P(ContactTest, convex_edge_gives_one_bounded_jump) {
  constexpr double kDepth = 0.001;
  constexpr double kSpeed = 0.05;
  for (const double phi : {0.1, 0.5, 1.0, M_PI / 2}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    // The top for x < 0, then a slope down by phi, then back underneath.
    TriangleMesh mesh;
    const auto c = static_cast<float>(0.05 * std::cos(phi));
    const auto s = static_cast<float>(0.05 * std::sin(phi));
    mesh.vertices = {{-0.05F, -0.05F, 0}, {0, -0.05F, 0},  {0, 0.05F, 0},
                     {-0.05F, 0.05F, 0},  {c, -0.05F, -s}, {c, 0.05F, -s}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}, {1, 4, 5}, {1, 5, 2}};
    add(mesh, surface());
    start({-0.01, 0.0007, 0.001});
    to({-0.01, 0.0007, -kDepth});
    Vec3 last = hand->now().force_N;
    int jumps = 0;
    to({0.005, 0.0007, -kDepth}, kSpeed, [&](const Rendering& r) {
      const double step = (r.force_N - last).norm();
      EXPECT_LE(step, 1000 * (kDepth * std::sin(phi) + kSpeed * 1e-3) + 1e-3);
      jumps += step > 1000 * 2 * kSpeed * 1e-3 ? 1 : 0;
      last = r.force_N;
    });
    EXPECT_LE(jumps, 1);
  }
}

// T6 with force shading: the same depth on a coarse sphere, and the direction turns without steps.
TEST_P(ContactTest, force_shading_turns_the_force_and_keeps_its_size) {
  constexpr double kRadius = 0.05;
  add(sphere(kRadius, 6), surface());
  const auto onSphere = [](double a) -> Vec3 {
    return (kRadius - 0.004) * Vec3(std::cos(0.3) * std::cos(a), std::cos(0.3) * std::sin(a), std::sin(0.3));
  };
  double steps[2] = {0, 0};
  for (const bool shading : {false, true}) {
    RenderOptions options;
    options.forceShading = shading;
    start(1.1 * onSphere(0), options);
    to(onSphere(0));
    Vec3 last = hand->now().force_N;
    for (int i = 1; i < 1500; ++i) {
      const Rendering& r = at(onSphere(1e-3 * i));
      EXPECT_NEAR(r.force_N.norm(), 1000 * r.depth_m, 1e-6);
      EXPECT_GT(r.force_N.normalized().dot(r.normal), std::cos(0.3));  // the dihedral is up to 0.27
      auto& step = steps[shading ? 1 : 0];
      step = std::max(step, (r.force_N.normalized() - last.normalized()).norm());
      last = r.force_N;
    }
  }
  EXPECT_GT(steps[0], 0.1);
  EXPECT_LT(steps[1], 0.5 * steps[0]);
}

// T8  50 mm deep: F = 50 N before the guard
TEST_P(ContactTest, deep_press_is_not_released) {
  add(plane(0.1, 4), surface());
  start({0.001, 0.002, 0.005});
  EXPECT_NEAR(to({0.001, 0.002, -0.05}, 0.5).force_N.z(), 50, 1e-4);
}

// A first contact deeper than 30 mm gives no force until the HIP leaves.
TEST_P(ContactTest, deep_first_contact_is_released_until_the_hand_leaves) {
  add(plane(0.1, 4), surface());
  start({0.001, 0.002, 0.005});
  EXPECT_EQ(at({0.001, 0.002, -0.031}).force_N.norm(), 0);
  EXPECT_NE(hand->now().status & kRenderReleased, 0U);
  EXPECT_EQ(at({0.001, 0.002, -0.001}).force_N.norm(), 0);
  EXPECT_EQ(at({0.001, 0.002, 0.001}).status, 0U);
  EXPECT_NEAR(at({0.001, 0.002, -0.001}).force_N.z(), 1, 1e-4);
}

// T10  the same hills in cells of 2 ... 0.05 mm: the same forces within 1 %
TEST_P(ContactTest, cell_size_is_not_felt) {
  for (const double cell : {0.002, 0.0005, 0.0002, 0.00005}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    const double half = cell * 40;
    add(heightField(
            half, 80, [](double x, double y) { return 0.3 * x + 0.1 * y; }, 0.3),
        surface());
    start({-0.5 * half, 0.1 * half, 0.3 * -0.5 * half + 0.1 * 0.1 * half + 0.001});
    const Vec3 n = Vec3(-0.3, -0.1, 1).normalized();
    hand->to(hand->hip() - n * (0.001 / std::sqrt(1.1) + 0.001), 0.1);
    const Vec3 from = hip();
    const Vec3 along = Vec3(0.5, 0.1, 0.5 * 0.3 + 0.1 * 0.1) * half;
    to(from + along, 0.05, [&](const Rendering& r) {
      EXPECT_NEAR(r.force_N.norm(), 1000 * -n.dot(hip()), 0.01);
      EXPECT_GT(r.force_N.normalized().dot(n), 0.9999);
    });
  }
}

// T11  front, back, both: a force only from the enabled side, along that side's normal
TEST_P(ContactTest, only_touchable_sides_are_felt) {
  using scene::TouchableFaces;
  for (const auto faces : {TouchableFaces::front, TouchableFaces::back, TouchableFaces::both}) {
    scene = SceneFixture();
    scene.setWorldUnitsPerMetre(GetParam().worldUnitsPerMetre);
    scene.faces = faces;
    add(plane(0.05, 10), surface());
    for (const double side : {1.0, -1.0}) {
      const bool felt = faces == TouchableFaces::both || (faces == TouchableFaces::front) == (side > 0);
      start({0.0013, 0.0021, side * 0.001});
      const Rendering& r = to({0.0013, 0.0021, -side * 0.001});
      EXPECT_NEAR((r.force_N - Vec3(0, 0, felt ? side : 0)).norm(), 0, 1e-4);
      EXPECT_EQ(r.touching, felt);
    }
  }
}

// A hand with friction comes through a sheet from behind and creeps on, 1 um above it, across an edge between
// two of its triangles: as a ball of 5 um it overlaps both, and the edge holds nothing.
TEST_P(ContactTest, what_came_from_behind_meets_no_edges) {
  add(plane(0.05, 100), surface(1000, 0.8, 0.5));
  start({0.003225, 0.003775, -0.001});
  to({0.003225, 0.003775, -5e-7});
  for (int i = 0; i <= 30; ++i) {
    const Rendering& r = to({0.003225 + 5e-5 * i, 0.003775 - 5e-5 * i, -5e-7 + 3e-7 * i});
    EXPECT_FALSE(r.touching) << i;
    EXPECT_EQ(r.force_N.norm(), 0) << i;
  }
}

}  // namespace
}  // namespace hapticd::realtime::fixture
