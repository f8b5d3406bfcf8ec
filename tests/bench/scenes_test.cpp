#include "bench/scenes.h"
#include "base/time.h"

#include <gtest/gtest.h>

#include <map>
#include <numbers>

#include "realtime/render/renderer.h"

namespace hapticd::bench {
namespace {

TEST(BumpyBall, hasAboutTheTrianglesThatWereAsked) {
  for (const std::size_t triangles : {100, 1'000, 10'000, 100'000}) {
    const auto made = static_cast<double>(makeBumpyBall(triangles).triangles.size());
    EXPECT_NEAR(made / static_cast<double>(triangles), 1, 0.1) << triangles;
  }
}

TEST(BumpyBall, isClosedAndItsFrontsAreOutside) {
  const geometry::TriangleMesh mesh = makeBumpyBall(1'000);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  double volume = 0;
  for (const auto& t : mesh.triangles) {
    for (std::size_t k = 0; k < 3; ++k) ++edges[{t[k], t[(k + 1) % 3]}];
    const auto at = [&](std::size_t k) { return Vec3(mesh.vertices[t[k]].cast<double>()); };
    volume += at(0).cross(at(1)).dot(at(2)) / 6;
  }
  for (const auto& [edge, count] : edges) {
    EXPECT_EQ(count, 1);
    EXPECT_EQ(edges.count({edge.second, edge.first}), 1U);
  }
  EXPECT_NEAR(volume / (4.0 / 3 * std::numbers::pi * 27'000), 1, 0.03);
}

TEST(Hand, touchesInEachActAndNotOnItsWays) {
  const auto scene = sceneOf(bumpyBall(10'000));
  realtime::Renderer renderer;
  device::DeviceState state;
  realtime::Rendering out;
  std::map<Act, std::pair<int, int>> touched;
  base::Nanos now = 0;
  Vec3 before = Vec3::Zero();
  double farthest_m = 0;
  for (const HandTick& tick : handOf(1)) {
    state.position_m = tick.position_m;
    renderer.step(*scene, state, now += 1'000'000, 1'000'000, out);
    touched[tick.act].first += out.touching ? 1 : 0;
    touched[tick.act].second += 1;
    if (!before.isZero(0)) farthest_m = std::max(farthest_m, (tick.position_m - before).norm());
    before = tick.position_m;
  }
  EXPECT_EQ(touched[Act::contact].first, touched[Act::contact].second);
  EXPECT_EQ(touched[Act::slide].first, touched[Act::slide].second);
  EXPECT_NEAR(static_cast<double>(touched[Act::tap].first) / touched[Act::tap].second, 0.5, 0.1);
  EXPECT_LT(touched[Act::way].first, touched[Act::way].second / 5);
  EXPECT_LT(farthest_m, 0.002) << "a motion, not a jump";
}

}  // namespace
}  // namespace hapticd::bench
