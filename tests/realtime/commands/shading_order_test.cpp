// Force shading sums over the faces at a corner: the sum must not depend on the shape of the tree that finds
// them.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

#include "loop.h"

namespace hapticd::realtime::commands {
namespace {

// Corners of the triangles of a ball, front outwards, millimetres.
std::vector<Vec3f> ballTriples(double radius, int rings) {
  const auto at = [&](int ring, int segment) -> Vec3f {
    const double polar = std::numbers::pi * ring / rings;
    const double around = std::numbers::pi * (segment % (2 * rings)) / rings;
    return (radius *
            Vec3(std::sin(polar) * std::cos(around), std::cos(polar), -std::sin(polar) * std::sin(around)))
        .cast<float>();
  };
  std::vector<Vec3f> corners;
  for (int ring = 0; ring < rings; ++ring) {
    for (int segment = 0; segment < 2 * rings; ++segment) {
      const Vec3f a = at(ring, segment);
      const Vec3f b = at(ring + 1, segment);
      const Vec3f c = at(ring + 1, segment + 1);
      const Vec3f d = at(ring, segment + 1);
      if (ring + 1 < rings) corners.insert(corners.end(), {a, b, c});
      if (ring > 0) corners.insert(corners.end(), {a, c, d});
    }
  }
  return corners;
}

// Forces of a stroke over a ball that became one from another shape.
std::vector<Vec3> stroke(const RenderOptions& options, const std::vector<Vec3f>& before) {
  const std::vector<Vec3f> ball = ballTriples(20, 10);
  Loop loop(options);
  loop.add(0, before);
  loop.rest(Vec3(0, 0.03, 0), toNanos(1));
  loop.send(scene::SetVertices{0, 0, ball});
  loop.rest(Vec3(0, 0.03, 0), toNanos(1));
  std::vector<Vec3> forces;
  for (int i = 0; i < 400; ++i) {
    const double angle = 0.004 * i;
    forces.push_back(loop.tick((0.022 - 1e-4 * std::min(i, 40)) *
                               Vec3(std::sin(angle), std::cos(angle), 0.2 * angle).normalized())
                         .force_N);
  }
  return forces;
}

TEST(ShadingOrder, ForcesDoNotDependOnTheTreeOfTheMesh) {
  std::vector<Vec3f> torn = ballTriples(20, 10);
  std::mt19937 random(1);
  for (int i = 0; i < 3; ++i) std::swap(torn[random() % torn.size()], torn[random() % torn.size()]);
  for (const double radius : {0.0, 0.002}) {
    for (const bool shading : {false, true}) {
      const RenderOptions options{.toolRadius_m = radius, .forceShading = shading};
      const std::vector<Vec3> one = stroke(options, torn);
      EXPECT_EQ(one, stroke(options, ballTriples(19, 10))) << "ball " << radius << ", shading " << shading;
      EXPECT_GT(one.back().norm(), 0.5);
    }
  }
}

}  // namespace
}  // namespace hapticd::realtime::commands
