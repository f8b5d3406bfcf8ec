// The index of a mesh that deforms for long, of which a new one is built in a thread of its own.
#include <chrono>
#include <set>

#include "scene_fixture.h"

namespace hapticd::scene {
namespace {

using Rebuild = SceneTest;

// What nobody reads any more is refitted; from time to time another tree is built beside it.
TEST_F(Rebuild, OldTreesServeUntilNewOnesAreBuilt) {
  makeTouchable(0, soup(50, 0));
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  int most = 0;
  for (int frame = 1, now = 0; most <= 64 || now != 1; ++frame) {
    ASSERT_LT(std::chrono::steady_clock::now(), deadline) << "refitted " << most << " times";
    const float z = 0.1F * static_cast<float>(frame % 10);
    previous_.reset();
    say(SetVertices{0, 0, soup(50, z)});
    run(20 * kMillisecond);
    const SpatialIndex& index = object(0)->mesh->index;
    now = index.refits();
    most = std::max(most, now);
    // Covers this shape, the one before, and the one from which that came: a tick may have seen any of them.
    const bool fell = frame % 10 == 0 || (frame > 1 && frame % 10 == 1);
    ASSERT_NEAR(index.bounds().max.z(), fell ? 0.9F : z, 1e-6) << frame;
    std::set<std::uint32_t> found;
    index.visitNear(Vec3(20.2, 0.2, z), 0.1, [&](std::uint32_t id) { found.insert(id); });
    ASSERT_EQ(found, std::set<std::uint32_t>{10}) << frame;
  }
}

// The mesh goes while its new tree is built.
TEST_F(Rebuild, ShapesMayChangeMeanwhile) {
  makeTouchable(0, soup(20'000, 0));
  for (int frame = 1; object(0)->mesh->index.refits() < 64; ++frame) {
    previous_.reset();
    say(SetVertices{0, 0, soup(20'000, static_cast<float>(frame % 2))});
    run(20 * kMillisecond);
  }
  for (int frame = 0; frame < 3; ++frame) {
    previous_.reset();
    say(SetVertices{0, 0, soup(20'000, static_cast<float>(frame))});
    run(20 * kMillisecond);
  }
  say(ClearMesh{0});
  run(20 * kMillisecond);
  EXPECT_EQ(object(0), nullptr);
}

}  // namespace
}  // namespace hapticd::scene
