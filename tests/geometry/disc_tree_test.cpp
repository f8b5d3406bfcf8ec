#include "geometry/disc_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <random>
#include <set>

namespace hapticd::geometry {
namespace {

// Random triangles of all sizes and shapes, needles among them, `scale` wide and away from the origin.
TriangleMesh soup(std::mt19937& random, int count, double scale, double away) {
  std::uniform_real_distribution<double> place(-1, 1);
  std::lognormal_distribution<double> size(-4, 1.5);
  const auto direction = [&] { return Vec3(place(random), place(random), place(random)); };
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const Vec3 middle = Vec3::Constant(away) + direction();
    const Vec3 along = size(random) * direction();
    const Vec3 aside = (i % 4 == 0 ? 1e-4 : 1) * size(random) * direction();
    const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
    for (const Vec3& corner : {Vec3(middle - along), Vec3(middle + along), Vec3(middle + aside)})
      mesh.vertices.push_back((scale * corner).cast<float>());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

// The least distance between points of a triangle and of a segment: no less than that between the two.
double sampled(const TriangleMesh& mesh, const Triangle& t, const Vec3& from, const Vec3& way) {
  constexpr int kSteps = 12;
  const std::array<Vec3, 3> c{mesh.vertices[t[0]].cast<double>(), mesh.vertices[t[1]].cast<double>(),
                              mesh.vertices[t[2]].cast<double>()};
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= kSteps; ++i) {
    for (int k = 0; i + k <= kSteps; ++k) {
      const Vec3 x = c[0] + (c[1] - c[0]) * i / kSteps + (c[2] - c[0]) * k / kSteps;
      const double length2 = way.squaredNorm();
      const double share = length2 > 0 ? std::clamp((x - from).dot(way) / length2, 0.0, 1.0) : 0;
      least = std::min(least, (from + share * way - x).norm());
    }
  }
  return least;
}

TEST(DiscTree, finds_all_that_is_near_a_way) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-1.5, 1.5);
  std::vector<std::uint32_t> places(4000);
  for (const double scale : {1e-3, 1.0, 1e6}) {
    for (const double away : {0.0, 100.0}) {
      const TriangleMesh mesh = soup(random, 2000, scale, away);
      const DiscTree tree(mesh.vertices, mesh.triangles, {});
      for (int query = 0; query < 40; ++query) {
        const auto any = [&] { return Vec3(place(random), place(random), place(random)); };
        const Vec3 from = scale * (Vec3::Constant(away) + any());
        const Vec3 way = query % 3 == 0 ? Vec3(Vec3::Zero()) : Vec3(scale * 0.3 * any());
        const double distance = scale * std::pow(10.0, place(random) - 1);
        int groups = 0;
        const std::size_t count = tree.findNear(from, way, distance, 1 << 20, places, groups);
        ASSERT_LE(count, places.size());
        std::set<std::uint32_t> found;
        for (std::size_t i = 0; i < count; ++i) found.insert(tree.triangleAt(places[i]));
        EXPECT_EQ(found.size(), count) << "each once";
        for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
          if (sampled(mesh, mesh.triangles[i], from, way) > distance) continue;
          ASSERT_TRUE(found.contains(i)) << "triangle " << i << ", query " << query << ", scale " << scale;
        }
      }
    }
  }
}

// Above the middle of a triangle its disc is exactly as far as itself: what is left is rounding.
TEST(DiscTree, finds_what_is_just_as_far) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> height(0.001, 2);
  std::vector<std::uint32_t> places(4000);
  for (const double away : {0.0, 100.0}) {
    const TriangleMesh mesh = soup(random, 2000, 1, away);
    const DiscTree tree(mesh.vertices, mesh.triangles, {});
    for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
      const Triangle& t = mesh.triangles[i];
      const auto corner = [&](int k) {
        return Vec3(mesh.vertices[t[static_cast<std::size_t>(k)]].cast<double>());
      };
      const Vec3 normal = (corner(1) - corner(0)).cross(corner(2) - corner(0)).normalized();
      const double h = height(random);
      const Vec3 above = (corner(0) + corner(1) + corner(2)) / 3 + h * normal;
      int groups = 0;
      const std::size_t count = tree.findNear(above, Vec3::Zero(), h, 1 << 20, places, groups);
      ASSERT_LE(count, places.size());
      const auto end = places.begin() + static_cast<std::ptrdiff_t>(count);
      EXPECT_TRUE(
          std::any_of(places.begin(), end, [&](std::uint32_t at) { return tree.triangleAt(at) == i; }))
          << "triangle " << i << ", away " << away;
    }
  }
}

// A ball that lies on a fine plane is near few of its triangles, also those of a way along it.
TEST(DiscTree, finds_little_more_along_a_plane) {
  TriangleMesh mesh;
  constexpr int kCells = 200;
  for (int j = 0; j <= kCells; ++j) {
    for (int i = 0; i <= kCells; ++i)
      mesh.vertices.emplace_back(static_cast<float>(0.1 * i), static_cast<float>(0.1 * j), 0.0F);
  }
  for (std::uint32_t j = 0; j < kCells; ++j) {
    for (std::uint32_t i = 0; i < kCells; ++i) {
      const std::uint32_t a = j * (kCells + 1) + i;
      mesh.triangles.push_back({a, a + 1, a + kCells + 2});
      mesh.triangles.push_back({a, a + kCells + 2, a + kCells + 1});
    }
  }
  const DiscTree tree(mesh.vertices, mesh.triangles, {});
  std::vector<std::uint32_t> places(8192);
  int groups = 0;
  // Radius 5, 50 um around a way of 1 mm: 2.9 mm2 of the plane, 580 triangles.
  EXPECT_LT(tree.findNear({10, 10, 5}, {1, 0, 0}, 5.05, 1 << 20, places, groups), 800U);
  EXPECT_LT(groups, 400);
}

TEST(DiscTree, leaves_out_what_is_no_triangle_and_tells_what_does_not_fit) {
  std::mt19937 random(5);
  TriangleMesh mesh = soup(random, 100, 1, 0);
  mesh.vertices[3].x() = std::numeric_limits<float>::quiet_NaN();
  mesh.triangles[2] = {0, 1, 100'000};
  std::vector<bool> leftOut(100);
  leftOut[7] = true;
  const DiscTree tree(mesh.vertices, mesh.triangles, leftOut);
  int groups = 0;
  std::vector<std::uint32_t> places(97);
  ASSERT_EQ(tree.findNear(Vec3::Zero(), Vec3::Zero(), 100, 1 << 20, places, groups), 97U);
  for (const std::uint32_t place : places) {
    const std::uint32_t triangle = tree.triangleAt(place);
    EXPECT_TRUE(triangle != 1 && triangle != 2 && triangle != 7) << triangle;
  }
  places.resize(96);
  EXPECT_GT(tree.findNear(Vec3::Zero(), Vec3::Zero(), 100, 1 << 20, places, groups), places.size());
  places.resize(97);
  for (const int most : {1, 2, 14}) {  // 13 groups of discs and three of boxes
    groups = 0;
    EXPECT_GT(tree.findNear(Vec3::Zero(), Vec3::Zero(), 100, most, places, groups), places.size()) << most;
    EXPECT_EQ(groups, most);
  }
  groups = 0;
  EXPECT_EQ(tree.findNear(Vec3::Zero(), Vec3::Zero(), 100, 16, places, groups), 97U);
  EXPECT_EQ(groups, 16);
  EXPECT_EQ(DiscTree(mesh.vertices, {}, {}).findNear(Vec3::Zero(), Vec3::Zero(), 1, 1 << 20, places, groups),
            0U);
}

// Of one triangle, of copies of it, of one without an extent, and of the smallest numbers.
TEST(DiscTree, has_room_for_meshes_without_an_extent) {
  constexpr float kTiny = std::numeric_limits<float>::denorm_min();
  for (const float size : {0.0F, kTiny, 1.0F}) {
    const std::vector<Vec3f> corners = {{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {2 * size, 0, 0}};
    for (const std::size_t copies : {1U, 20U}) {
      std::vector<Triangle> triangles(copies, {0, 1, 2});
      triangles.push_back({0, 3, 2});
      const DiscTree tree(corners, triangles, {});
      int groups = 0;
      std::vector<std::uint32_t> places(100);
      EXPECT_EQ(tree.findNear(Vec3::Zero(), Vec3::Zero(), 1, 1 << 20, places, groups), copies + 1);
      EXPECT_EQ(tree.findNear(Vec3(0, 0, 9), Vec3::Zero(), 1, 1 << 20, places, groups), 0U);
    }
  }
}

}  // namespace
}  // namespace hapticd::geometry
