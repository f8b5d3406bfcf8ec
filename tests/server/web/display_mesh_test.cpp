#include "server/web/display_mesh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>

namespace hapticd::server {
namespace {

using geometry::Triangle;
using geometry::Vec3f;

struct Shape {
  std::vector<Vec3f> vertices;
  std::vector<Triangle> triangles;
};

/// Decodes as the page does; fails unless the bytes are exactly one mesh.
Shape decode(const net::Buffer& bytes) {
  std::uint32_t head[4];
  EXPECT_GE(bytes.size(), sizeof head);
  std::memcpy(head, bytes.data(), sizeof head);
  EXPECT_EQ(std::memcmp(bytes.data(), "HDM1", 4), 0);
  EXPECT_EQ(head[3], 0u);
  Shape shape;
  shape.vertices.resize(head[1]);
  shape.triangles.resize(head[2]);
  EXPECT_EQ(bytes.size(), sizeof head + head[1] * 12u + head[2] * 12u);
  if (bytes.size() == sizeof head) return shape;
  std::memcpy(static_cast<void*>(shape.vertices.data()), bytes.data() + 16, head[1] * 12u);
  std::memcpy(shape.triangles.data(), bytes.data() + 16 + head[1] * 12u, head[2] * 12u);
  for (const Triangle& t : shape.triangles) {
    for (const std::uint32_t corner : t) EXPECT_LT(corner, shape.vertices.size());
  }
  return shape;
}

Shape displayed(const Shape& shape, std::size_t most) {
  return decode(displayMesh(shape.vertices, shape.triangles, most, false));
}

/// A sphere with 2 n n faces.
Shape sphere(std::uint32_t n, float radius = 50) {
  Shape shape;
  for (std::uint32_t i = 0; i <= n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      const double polar = std::numbers::pi * i / n;
      const double round = 2 * std::numbers::pi * j / n;
      shape.vertices.emplace_back(radius * static_cast<float>(std::sin(polar) * std::cos(round)),
                                  radius * static_cast<float>(std::cos(polar)),
                                  radius * static_cast<float>(-std::sin(polar) * std::sin(round)));
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t j = 0; j < n; ++j) {
      const std::uint32_t a = i * n + j, b = i * n + (j + 1) % n, c = a + n, d = b + n;
      shape.triangles.push_back({a, c, b});
      shape.triangles.push_back({b, c, d});
    }
  }
  return shape;
}

TEST(DisplayMesh, AMeshWithinTheLimitIsNotChanged) {
  const Shape shape = sphere(20);
  const Shape shown = displayed(shape, 800);
  EXPECT_EQ(shown.triangles.size(), 800u);
  for (std::size_t i = 0; i < shape.triangles.size(); ++i) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      EXPECT_EQ(shown.vertices[shown.triangles[i][corner]], shape.vertices[shape.triangles[i][corner]]);
    }
  }
}

double volumeOf(const Shape& shape) {
  double volume = 0;
  for (const Triangle& t : shape.triangles) {
    const Vec3f &a = shape.vertices[t[0]], &b = shape.vertices[t[1]], &c = shape.vertices[t[2]];
    volume += a.cast<double>().dot(b.cast<double>().cross(c.cast<double>())) / 6;
  }
  return volume;
}

/// Largest distance of a triangle's centre or vertex from the sphere.
double errorOf(const Shape& shape, double radius) {
  double error = 0;
  for (const Triangle& t : shape.triangles) {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    for (const std::uint32_t corner : t) {
      const Eigen::Vector3d vertex = shape.vertices[corner].cast<double>();
      error = std::max(error, std::abs(vertex.norm() - radius));
      centre += vertex / 3;
    }
    error = std::max(error, std::abs(centre.norm() - radius));
  }
  return error;
}

TEST(DisplayMesh, SimplifiesToTheLimitAndKeepsTheShape) {
  const Shape shape = sphere(250);  // 125000 faces
  struct Case {
    std::size_t most;
    double error, volumeError;
  };
  for (const auto& [most, error, volumeError] :
       {Case{50'000, 0.1, 0.001}, Case{5'000, 0.4, 0.005}, Case{500, 4, 0.05}}) {
    const Shape shown = displayed(shape, most);
    EXPECT_LE(shown.triangles.size(), most);
    EXPECT_GE(shown.triangles.size(), most * 9 / 10) << most;
    EXPECT_LT(errorOf(shown, 50), error) << most;
    EXPECT_NEAR(volumeOf(shown) / (4.0 / 3 * std::numbers::pi * std::pow(50, 3)), 1, volumeError)
        << most << ": the faces point outwards, as before";
  }
}

TEST(DisplayMesh, ATriangleSoupOfASurfaceIsSimplifiedLikeTheSurface) {
  const Shape shape = sphere(100);
  Shape soup;  // three vertices per triangle, as stock clients send them
  for (const Triangle& t : shape.triangles) {
    const auto first = static_cast<std::uint32_t>(soup.vertices.size());
    for (const std::uint32_t corner : t) soup.vertices.push_back(shape.vertices[corner]);
    soup.triangles.push_back({first, first + 1, first + 2});
  }
  const Shape shown = displayed(soup, 2000);
  EXPECT_GE(shown.triangles.size(), 1800u);
  EXPECT_LE(shown.triangles.size(), 2000u);
  EXPECT_LE(shown.vertices.size(), 1100u) << "neighbours share their vertices";
  EXPECT_LT(errorOf(shown, 50), 1);
}

TEST(DisplayMesh, TheSameShapeGivesTheSameBytes) {
  const Shape shape = sphere(60);
  EXPECT_EQ(displayMesh(shape.vertices, shape.triangles, 1000, false),
            displayMesh(shape.vertices, shape.triangles, 1000, false));
}

TEST(DisplayMesh, DropsTrianglesWithEqualMissingOrNonFiniteVertices) {
  constexpr float kNaN = std::numeric_limits<float>::quiet_NaN();
  constexpr float kInf = std::numeric_limits<float>::infinity();
  const Shape shape{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {kNaN, 0, 0}, {0, kInf, 0}},
                    {{0, 1, 2}, {0, 0, 0}, {0, 1, 3}, {0, 4, 2}, {0, 1, 5}, {0xffffffffU, 1, 2}, {1, 1, 2}}};
  const Shape shown = displayed(shape, 10);
  EXPECT_EQ(shown.triangles.size(), 1u);
  EXPECT_EQ(shown.vertices.size(), 3u);
}

TEST(DisplayMesh, EncodesAnEmptyMesh) {
  EXPECT_TRUE(displayed({}, 10).triangles.empty());
  EXPECT_TRUE(displayed(sphere(10), 0).triangles.empty());
  const std::vector<Vec3f> many(100000, Vec3f::Zero());
  EXPECT_TRUE(decode(displayMesh(many, {}, 10, false)).vertices.empty());
}

TEST(DisplayMesh, SimplifiesFlatHugeTinyAndCoincidentShapes) {
  Shape flat = sphere(100);
  for (Vec3f& v : flat.vertices) v.y() = 7;
  EXPECT_GT(displayed(flat, 2000).triangles.size(), 100u);
  for (const float radius : {1e-30F, 1e-6F, 1e30F}) {
    EXPECT_GT(displayed(sphere(100, radius), 2000).triangles.size(), 500u) << radius;
  }
  Shape point = sphere(100);
  for (Vec3f& v : point.vertices) v = Vec3f::Ones();
  EXPECT_LE(displayed(point, 2000).triangles.size(), 2000u);
}

/// Separate triangles of a size anywhere in the unit cube.
Shape soupOf(std::uint32_t count, float size) {
  std::mt19937 random(4);
  std::uniform_real_distribution<float> at(-1, 1);
  Shape soup;
  for (std::uint32_t i = 0; i < count; ++i) {
    const Vec3f centre(at(random), at(random), at(random));
    for (int corner = 0; corner < 3; ++corner) {
      soup.vertices.emplace_back(centre + size * Vec3f(at(random), at(random), at(random)));
    }
    soup.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  return soup;
}

TEST(DisplayMesh, SoupsOfSeparateTrianglesStayWithinTheLimitAndVisible) {
  for (const float size : {1.0F, 0.01F, 1e-6F}) {
    const Shape shown = displayed(soupOf(20000, size), 3000);
    EXPECT_LE(shown.triangles.size(), 3000u) << size;
    EXPECT_GE(shown.triangles.size(), 300u) << size;
  }
}

// The library's assertions are enabled in Debian's package: no input may reach one.
TEST(DisplayMesh, AnyInputGivesAMeshWithinTheLimit) {
  std::mt19937 random(6);
  constexpr float kExtremes[] = {0,      -0.0F, 1,      -1,
                                 1e-45F, 3e38F, -3e38F, std::numeric_limits<float>::infinity()};
  for (int round = 0; round < 300; ++round) {
    Shape shape;
    const std::uint32_t vertices = 1 + random() % 200;
    for (std::uint32_t i = 0; i < vertices; ++i) {
      const auto at = [&] {
        return random() % 4 == 0 ? kExtremes[random() % 8] : static_cast<float>(random() % 10);
      };
      const float x = at(), y = at(), z = at();
      shape.vertices.emplace_back(x, y, z);
    }
    for (std::uint32_t i = 0; i < random() % 400; ++i) {
      const auto corner = [&] { return static_cast<std::uint32_t>(random() % (vertices + 2)); };
      shape.triangles.push_back({corner(), corner(), corner()});
    }
    const std::size_t most = random() % 100;
    EXPECT_LE(displayed(shape, most).triangles.size(), most);
  }
}

TEST(DisplayMesh, IsEmptyWhenCancelled) {
  const Shape shape = sphere(100);
  EXPECT_TRUE(decode(displayMesh(shape.vertices, shape.triangles, 100, true)).triangles.empty());
}

TEST(DisplayShare, SharesAddUpToTheLimitAtMost) {
  EXPECT_EQ(displayShare(100'000, 100'000, 1), 100'000u);
  EXPECT_EQ(displayShare(12, 1'000'012, 2), 12u) << "a cube beside a scan stays a cube";
  std::mt19937 random(5);
  for (int round = 0; round < 200; ++round) {
    std::vector<std::size_t> sizes(1 + random() % 300);
    std::size_t all = 0;
    for (std::size_t& size : sizes) all += size = random() % (1U << (random() % 22));
    std::size_t shown = 0;
    for (const std::size_t size : sizes) shown += displayShare(size, all, sizes.size());
    EXPECT_LE(shown, kDisplayTriangles);
  }
}

}  // namespace
}  // namespace hapticd::server
