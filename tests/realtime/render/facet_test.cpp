// Casts of a ball against one facet.
#include "realtime/render/facet.h"

#include <gtest/gtest.h>

#include <random>

namespace hapticd::realtime {
namespace {

// Which facet of those that stop a path as early is seen first is by chance: it must not hide an earlier one.
TEST(Facet, that_stops_a_path_stops_it_where_nothing_later_counts) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> share(-1, 1);
  const auto vec = [&](double size) {
    return Vec3(size * share(random), size * share(random), size * share(random));
  };
  int stops = 0;
  for (int i = 0; i < 20'000; ++i) {
    const Vec3 middle = vec(0.1);
    const double size = 1e-4 * std::pow(10, 2 * share(random));
    Facet f;
    if (!makeFacet({middle + vec(size), middle + vec(size), middle + vec(size)}, 1e-10, f)) continue;
    f.radius = i % 2 == 0 ? 5e-6 : 1e-3;
    // From one place of contact to the next, as the proxy goes: there the heights differ by rounding only.
    Vec3 p = middle + vec(3 * size + 2 * f.radius);
    for (int k = 0; k < 10; ++k) {
      const Vec3 d = middle + vec(size + f.radius) - p;
      CastHit hit;
      if (!castBall(f, scene::TouchableFaces::both, p, d, 1, 1, hit) || hit.stop > 1) continue;
      CastHit again;
      ASSERT_TRUE(castBall(f, scene::TouchableFaces::both, p, d, 1, hit.stop, again)) << i << ' ' << k;
      ASSERT_EQ(again.stop, hit.stop);
      p += hit.stop * d;
      ++stops;
    }
  }
  EXPECT_GT(stops, 10'000);
}

}  // namespace
}  // namespace hapticd::realtime
