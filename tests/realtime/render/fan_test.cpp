// Vertices with thousands of triangles: the middle of a disc, the tip of a cone, the bottom of a pit. They
// are felt like any other place, and no tick spends its work on them.
#include <gtest/gtest.h>

#include <random>

#include "realtime/render/proxy.h"
#include "reduced.h"
#include "scene_fixture.h"

namespace hapticd::realtime::fixture {
namespace {

constexpr double kRim_m = 0.02;

struct Shape {
  const char* name;
  double height_m;  // of the middle above the rim
};

// Triangles from a middle to a circle, front side up. In millimetres.
TriangleMesh fanOf(const Shape& shape, int count) {
  TriangleMesh mesh;
  mesh.vertices.push_back(Vec3f(0, 0, static_cast<float>(1000 * shape.height_m)));
  for (int i = 0; i < count; ++i) {
    const double a = 2 * M_PI * i / count;
    mesh.vertices.push_back(Vec3(1000 * kRim_m * std::cos(a), 1000 * kRim_m * std::sin(a), 0).cast<float>());
  }
  for (int i = 0; i < count; ++i) {
    mesh.triangles.push_back(
        {0, static_cast<std::uint32_t>(1 + i), static_cast<std::uint32_t>(1 + (i + 1) % count)});
  }
  return mesh;
}

class FanTest : public testing::TestWithParam<std::tuple<Shape, int, double>> {
 protected:
  FanTest() {
    const auto& [shape, count, radius] = GetParam();
    shape_ = shape;
    radius_ = radius;
    scene_.setWorldUnitsPerMetre(1000);
    scene_.add(fanOf(shape, count), surface(1000));
  }

  // The depth of p below the round surface that the triangles stand for: within a micrometre of theirs.
  double depth(const Vec3& p) const {
    const double rho = std::hypot(p.x(), p.y());
    const double slope = shape_.height_m / kRim_m;
    return (shape_.height_m - slope * rho - p.z()) / std::sqrt(1 + slope * slope);
  }

  Shape shape_{};
  double radius_ = 0;
  SceneFixture scene_;
};
INSTANTIATE_TEST_SUITE_P(, FanTest,
                         testing::Combine(testing::Values(Shape{"disc", 0}, Shape{"cone", 0.008},
                                                          Shape{"pit", -0.008}),
                                          testing::Values(300, 1000, 5000), testing::Values(0.0, 0.002)),
                         [](const auto& p) {
                           return std::string(std::get<0>(p.param).name) +
                                  std::to_string(std::get<1>(p.param)) +
                                  (std::get<2>(p.param) > 0 ? "_ball" : "_point");
                         });

TEST_P(FanTest, is_felt_as_the_round_surface_and_spends_no_tick) {
  constexpr double kDeep_m = 0.0015;
#ifdef HAPTICD_SANITIZED
  constexpr int kTicks = 120;
#else
  constexpr int kTicks = 1500;
#endif
  Hand hand(scene_.snapshot(), {.toolRadius_m = radius_});
  std::mt19937 random(5);
  std::normal_distribution<double> tremor(0, 2e-6);
  const double above = shape_.height_m + 1.2 * radius_ + 0.003;
  hand.at({0, 0, above});
  hand.to({1e-6, -2e-6, shape_.height_m - kDeep_m}, 0.05);
  int spent = 0;
  int lost = 0;
  for (int i = 0; i < kTicks; ++i) {
    // A tremor at the middle, and slow strokes through it.
    const double reach = i < kTicks / 2 ? 20e-6 : 1e-3;
    const double a = 2 * M_PI * i / 400;
    const Rendering& r = hand.at({reach * std::sin(a) + tremor(random),
                                  0.3 * reach * std::sin(3 * a) + tremor(random), shape_.height_m - kDeep_m});
    spent += (r.status & kRenderWorkLimit) != 0 ? 1 : 0;
    lost += r.touching ? 0 : 1;
    // The ball of a point tool has 5 um, and its proxy is on the surface.
    EXPECT_LE(depth(r.proxy_m) + radius_, 3e-6) << "tick " << i;
    if (shape_.height_m == 0) {
      EXPECT_NEAR(r.force_N.z(), 1000 * (kDeep_m + radius_), 0.003) << "tick " << i;
    }
  }
  EXPECT_EQ(spent, 0);
  EXPECT_EQ(lost, 0);
}

class Pit : public testing::TestWithParam<std::tuple<int, double>> {};
INSTANTIATE_TEST_SUITE_P(, Pit,
                         testing::Combine(testing::Values(32, 63, 100, 255, 1000),
                                          testing::Values(0.0, 0.0005, 0.002)));

// The proxy rests on all faces at once, and none of them lets it out.
TEST_P(Pit, takes_few_casts) {
  const auto& [count, radius] = GetParam();
  const Shape pit{"pit", -0.008};
  SceneFixture scene;
  scene.setWorldUnitsPerMetre(1000);
  scene.add(fanOf(pit, count), surface(1000));
  const auto snapshot = scene.snapshot();
  const auto proxy = std::make_unique<Proxy>(RenderOptions{.toolRadius_m = radius});
  Nanos now = 0;
  int casts = 0;
  int facetCasts = 0;
  const auto at = [&](const Vec3& hip) {
    std::uint32_t status = 0;
    proxy->follow({snapshot.get(), now += kTick}, hip, Vec3::Zero(), 1e-3, status);
    casts = std::max(casts, proxy->casts());
    facetCasts = std::max(facetCasts, proxy->facetCasts());
  };
  std::mt19937 random(5);
  std::normal_distribution<double> tremor(0, 2e-6);
  for (double above = 0.003 + radius; above > -0.0015; above -= 50e-6)
    at({1e-6, -2e-6, pit.height_m + above});
  // A tremor at the bottom, then slow strokes through it.
  constexpr int kTremor = 200;
  for (int i = kTremor - reduced(200); i < kTremor + reduced(600); ++i) {
    const double a = 2 * M_PI * i / 400;
    const double reach = i < kTremor ? 20e-6 : 1e-3;
    at({reach * std::sin(a) + tremor(random), 0.3 * reach * std::sin(3 * a) + tremor(random),
        pit.height_m - 0.0015});
  }
  EXPECT_GT(proxy->contactSet().count, 0);
  EXPECT_LE(casts, 30);
  EXPECT_LE(facetCasts, 6000);
}

// Neighbours that differ are not joined: a tick meets all of them.
//
//     rim of the star:  .'\/'.   every second corner farther in
class Star : public testing::TestWithParam<std::tuple<int, double>> {};
INSTANTIATE_TEST_SUITE_P(, Star,
                         testing::Combine(testing::Values(200, 1000, 5000),
                                          testing::Values(0.0, 0.0005, 0.002)));

TEST_P(Star, takes_no_more_work_than_a_tick_has) {
  const auto& [count, radius] = GetParam();
  const Shape pit{"pit", -0.008};
  TriangleMesh star = fanOf(pit, count);
  for (std::size_t i = 1; i < star.vertices.size(); i += 2) star.vertices[i].head<2>() *= 0.6F;
  SceneFixture scene;
  scene.setWorldUnitsPerMetre(1000);
  scene.add(star, surface(1000));
  const auto snapshot = scene.snapshot();
  const auto proxy = std::make_unique<Proxy>(RenderOptions{.toolRadius_m = radius});
  Nanos now = 0;
  int visits = 0;
  int facetCasts = 0;
  int lost = 0;
  const auto at = [&](const Vec3& hip) {
    std::uint32_t status = 0;
    const ContactSet& contact =
        proxy->follow({snapshot.get(), now += kTick}, hip, Vec3::Zero(), 1e-3, status);
    visits = std::max(visits, proxy->visits());
    facetCasts = std::max(facetCasts, proxy->facetCasts());
    return contact.count > 0 && proxy->feltShare() == 1;
  };
  std::mt19937 random(5);
  std::normal_distribution<double> tremor(0, 2e-6);
  for (double above = 0.003 + radius; above > -0.0015; above -= 50e-6)
    at({1e-6, -2e-6, pit.height_m + above});
  for (int i = 0; i < reduced(300); ++i) {
    const double reach = i < reduced(300) / 2 ? 20e-6 : 1e-3;
    const double a = 2 * M_PI * i / 100;
    const Vec3 hip(reach * std::sin(a) + tremor(random), 0.3 * reach * std::sin(3 * a) + tremor(random),
                   pit.height_m - 0.0015);
    lost += at(hip) ? 0 : 1;
  }
  // What seeks the place of a point on the faces, or the way out of a corner, ends what it has begun.
  EXPECT_LE(visits, kMaxVisits + FacetCache::kMaxFacets);
  EXPECT_LE(facetCasts, kMaxVisits + FacetCache::kMaxFacets);
  if (count == 200 || (count == 1000 && radius > 0)) {
    EXPECT_EQ(lost, 0);
  }
}

// Where a search out of a corner needs more work than one tick has for it, the next ticks go on from there.
TEST(RoughPit, goes_on_searching_in_the_next_ticks) {
  constexpr double kBall_m = 5e-6;  // within it, the faces are not what holds the point
  std::mt19937 random(9);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  int later = 0;
  for (int trial = 0; trial < reduced(200); ++trial) {
    TriangleMesh fan = fanOf({"pit", -0.008}, static_cast<int>(uniform(60, 400)));
    const double tilt_mm = uniform(-10, 10);
    for (std::size_t i = 1; i < fan.vertices.size(); ++i) {
      Vec3f& v = fan.vertices[i];
      v.z() = static_cast<float>(uniform(-4, 4) + tilt_mm * v.x() / (1000 * kRim_m));
      v.head<2>() *= static_cast<float>(uniform(0.4, 1));
    }
    SceneFixture scene;
    scene.setWorldUnitsPerMetre(1000);
    scene.add(fan, surface(1000));
    Hand hand(scene.snapshot(), {});
    const Vec3 bottom(0, 0, -0.0095);
    const Vec3 aside = bottom + Vec3(uniform(-0.002, 0.002), uniform(-0.002, 0.002), 0);
    hand.at({0, 0, -0.004});
    hand.to(bottom, 0.1);
    hand.to(aside, 0.1);
    const double first = (hand.at(aside).proxy_m - aside).norm();
    double last = first;
    for (int tick = 0; tick < 60; ++tick) {
      const double now = (hand.at(aside).proxy_m - aside).norm();
      EXPECT_LE(now, last + kBall_m);
      last = now;
    }
    later += last < first - 2 * kBall_m ? 1 : 0;
  }
  EXPECT_GE(later, reduced(200) / 50);
}

}  // namespace
}  // namespace hapticd::realtime::fixture
