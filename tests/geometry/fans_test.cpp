#include "geometry/fans.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>
#include <set>

namespace hapticd::geometry {
namespace {

// Triangles from the origin to a rim: `height` over the angle, 1 away from the axis.
TriangleMesh fanOf(int count, const std::function<double(int)>& height) {
  TriangleMesh mesh;
  mesh.vertices.push_back(Vec3f::Zero());
  for (int i = 0; i < count; ++i) {
    const double a = 2 * M_PI * i / count;
    mesh.vertices.push_back(Vec3(std::cos(a), std::sin(a), height(i)).cast<float>());
  }
  for (int i = 0; i < count; ++i) {
    mesh.triangles.push_back(
        {0, static_cast<std::uint32_t>(1 + i), static_cast<std::uint32_t>(1 + (i + 1) % count)});
  }
  return mesh;
}

TriangleMesh cone(int count) {
  return fanOf(count, [](int) { return -0.4; });
}

// The same mesh, in which no two triangles share a vertex.
TriangleMesh unwelded(const TriangleMesh& mesh) {
  TriangleMesh soup;
  for (const Triangle& t : mesh.triangles) {
    Triangle own;
    for (std::size_t k = 0; k < 3; ++k) {
      own[k] = static_cast<std::uint32_t>(soup.vertices.size());
      soup.vertices.push_back(mesh.vertices[t[k]]);
    }
    soup.triangles.push_back(own);
  }
  return soup;
}

Fans fansOf(const TriangleMesh& mesh) {
  return {mesh.vertices, mesh.triangles, {}};
}

// The distance of p from the part of the plane between two directions from the origin.
double distanceFrom(const TriangleMesh& mesh, const Triangle& t, const Vec3& p) {
  const Vec3 a = mesh.vertices[t[1]].cast<double>();
  const Vec3 b = mesh.vertices[t[2]].cast<double>();
  const Vec3 n = a.cross(b).normalized();
  const bool between = a.cross(p).dot(n) >= 0 && p.cross(b).dot(n) >= 0;
  const auto fromRay = [&](const Vec3& ray) {
    return (p - std::max(0.0, p.dot(ray) / ray.squaredNorm()) * ray).norm();
  };
  return between ? std::abs(n.dot(p)) : std::min(fromRay(a), fromRay(b));
}

TEST(Fans, NoneWithoutAVertexOfManyTriangles) {
  EXPECT_TRUE(fansOf(TriangleMesh{}).empty());
  EXPECT_TRUE(fansOf(cone(Fans::kFewest - 1)).empty());
  EXPECT_FALSE(fansOf(cone(Fans::kFewest)).empty());
  EXPECT_EQ(fansOf(cone(Fans::kFewest - 1)).fanOf(0), -1);
}

TEST(Fans, EveryLevelCoversAllTrianglesOnceInTheirWinding) {
  const TriangleMesh mesh = cone(1000);
  const Fans fans = fansOf(mesh);
  ASSERT_EQ(fans.fanOf(7), 0);
  for (int level = 1; level <= 6; ++level) {
    std::set<std::uint32_t> firsts;
    double angle = 0;
    for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
      const Fans::First first = fans.firstOf(level, t);
      if (!firsts.insert(first.triangle).second) continue;
      EXPECT_EQ(first.place, firsts.size() - 1);
      const Triangle joined = fans.joined(level, first.triangle);
      EXPECT_EQ(joined[0], 0U);
      const Vec3f a = mesh.vertices[joined[1]];
      const Vec3f b = mesh.vertices[joined[2]];
      angle += std::atan2(a.x() * b.y() - a.y() * b.x(), a.x() * b.x() + a.y() * b.y());
    }
    EXPECT_EQ(firsts.size(), (1000U + (1U << level) - 1) >> level);
    EXPECT_NEAR(angle, 2 * M_PI, 1e-5);
  }
}

TEST(Fans, JoinedTrianglesAreWithinTheErrorThatWasAskedFor) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0, 1);
  struct Rim {
    double height;
    double wave;
  };
  for (const Rim& rim : {Rim{-0.4, 0}, {0.4, 0}, {-0.4, 0.05}, {-0.4, 0.3}}) {
    const TriangleMesh mesh =
        fanOf(2000, [&](int i) { return rim.height + rim.wave * std::sin(2 * M_PI * 3 * i / 2000); });
    const Fans fans = fansOf(mesh);
    for (const double error : {1e-6, 1e-4, 1e-3}) {
      for (const double radius : {0.003, 0.1, 0.8}) {
        const int level = fans.levelFor(0, radius, error);
        if (radius == 0.003) {
          EXPECT_GT(level, 1);
        }
        if (level == 0) continue;
        for (int k = 0; k < 500; ++k) {
          const auto t = static_cast<std::uint32_t>(share(random) * 2000);
          const Triangle& fine = mesh.triangles[t];
          const double s = share(random);
          const Vec3 way =
              (1 - s) * mesh.vertices[fine[1]].cast<double>() + s * mesh.vertices[fine[2]].cast<double>();
          const Vec3 p = share(random) * radius * way.normalized();
          const Triangle joined = fans.joined(level, fans.firstOf(level, t).triangle);
          EXPECT_LE(distanceFrom(mesh, joined, p), 1.05 * error) << rim.wave << " level " << level;
        }
      }
    }
  }
}

TEST(Fans, ASmallerErrorAndALargerRadiusTakeAFinerLevel) {
  const Fans fans = fansOf(cone(5000));
  EXPECT_GT(fans.levelFor(0, 0.01, 1e-4), fans.levelFor(0, 0.01, 1e-7));
  EXPECT_GT(fans.levelFor(0, 0.001, 1e-6), fans.levelFor(0, 0.5, 1e-6));
  EXPECT_EQ(fans.levelFor(0, 1.2, 1e-6), 0) << "beyond the rim";
  EXPECT_EQ(fans.levelFor(0, 0.9, 0), 0);
}

TEST(Fans, AZigzagIsNotJoined) {
  const Fans fans = fansOf(fanOf(2000, [](int i) { return i % 2 == 0 ? 0.0 : 0.2; }));
  EXPECT_TRUE(fans.empty() || fans.levelFor(0, 0.01, 1e-4) == 0);
}

// A rim that goes four steps on and two back is covered three times by its triangles.
TEST(Fans, ATwistedFanIsNotJoined) {
  constexpr int kCount = 1000;
  TriangleMesh mesh = fanOf(kCount, [](int) { return 0.0; });
  for (int i = 0; i < kCount; ++i) {
    const double a = 2 * M_PI * (i + (i % 2 == 0 ? 0 : 3)) / kCount;
    mesh.vertices[static_cast<std::size_t>(1 + i)] =
        Vec3(std::cos(a), (1 + 0.1 * (i % 2)) * std::sin(a), 0).cast<float>();
  }
  const Fans fans = fansOf(mesh);
  EXPECT_TRUE(fans.empty() || fans.levelFor(0, 0.01, 1e-4) == 0);
}

TEST(Fans, PlacesCountAndNotNumbers) {
  const TriangleMesh soup = unwelded(cone(600));
  const Fans fans = fansOf(soup);
  ASSERT_FALSE(fans.empty());
  EXPECT_EQ(fans.firstOf(4, 31).triangle, fans.firstOf(4, 16).triangle);
  EXPECT_EQ(soup.vertices[fans.apexOf(0)], Vec3f::Zero());
}

TEST(Fans, TrianglesOfMixedWindingAreSeparateFans) {
  TriangleMesh mesh = cone(2000);
  for (std::size_t i = 1000; i < 2000; ++i) std::swap(mesh.triangles[i][1], mesh.triangles[i][2]);
  const Fans fans = fansOf(mesh);
  // Two triangles end at the first vertex of the rim, and two begin where the halves meet: there is no order.
  EXPECT_TRUE(fans.empty());
}

TEST(Fans, AnOpenFanIsJoinedAndLeftOutTrianglesDoNotCount) {
  TriangleMesh mesh = cone(1200);
  mesh.triangles.resize(600);
  EXPECT_FALSE(fansOf(mesh).empty());
  mesh.triangles.insert(mesh.triangles.end(), mesh.triangles.begin(), mesh.triangles.begin() + 600);
  std::vector<bool> repeated(1200);
  std::fill(repeated.begin() + 600, repeated.end(), true);
  const Fans fans(mesh.vertices, mesh.triangles, repeated);
  ASSERT_FALSE(fans.empty());
  EXPECT_EQ(fans.fanOf(599), 0);
  EXPECT_EQ(fans.fanOf(600), -1);
}

TEST(Fans, TrianglesThatLackACornerAreNotCounted) {
  TriangleMesh mesh = cone(Fans::kFewest);
  mesh.triangles.back()[2] = 1'000'000;
  EXPECT_TRUE(fansOf(mesh).empty());
}

}  // namespace
}  // namespace hapticd::geometry
