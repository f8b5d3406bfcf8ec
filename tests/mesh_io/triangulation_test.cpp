// Polygons by their area: triangles that cover one once have its area together, and none of them looks back.
#include "mesh_io/triangulation.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numeric>
#include <random>
#include <string>
#include <vector>

namespace hapticd::mesh_io {
namespace {

using geometry::Quat;
using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3;
using Points = std::vector<Eigen::Vector2d>;

struct Areas {
  double along = 0;  // the normal
  double all = 0;
};

// As one face in some plane.
Areas areasOf(const Points& points, const Quat& turn, double scale, std::size_t first) {
  PolygonMesh polygons;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d& p = points[(i + first) % points.size()];
    polygons.vertices.emplace_back((scale * (turn * Vec3(p.x(), p.y(), 2))).cast<float>());
    polygons.corners.push_back(static_cast<std::uint32_t>(i));
  }
  polygons.sizes = {static_cast<std::uint32_t>(points.size())};
  const TriangleMesh mesh = triangulated(std::move(polygons));
  EXPECT_EQ(mesh.triangles.size(), points.size() - 2);
  Areas areas;
  for (const Triangle& t : mesh.triangles) {
    const auto at = [&](std::size_t k) { return mesh.vertices[t[k]].cast<double>().eval(); };
    const Vec3 area = (at(1) - at(0)).cross(at(2) - at(0)) / (2 * scale * scale);
    areas.along += area.dot(turn * Vec3::UnitZ());
    areas.all += area.norm();
  }
  return areas;
}

double areaOf(const Points& p) {
  double twice = 0;
  for (std::size_t i = 0; i < p.size(); ++i) {
    const Eigen::Vector2d& next = p[(i + 1) % p.size()];
    twice += p[i].x() * next.y() - next.x() * p[i].y();
  }
  return twice / 2;
}

Points comb(int teeth) {
  Points p = {{0, 0}, {teeth, 0}};
  for (int i = teeth; i > 0; --i) p.insert(p.end(), {{i, 2}, {i - 0.5, 0.2}});
  p.emplace_back(0, 2);
  return p;
}

Points spiral(int corners) {
  Points p;
  for (int side = 0; side < 2; ++side) {
    for (int i = 0; i < corners; ++i) {
      const double angle = 0.6 * (side == 0 ? i : corners - 1 - i);
      const double radius = (side == 0 ? 1.0 : 0.8) + 0.3 * angle;
      p.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
    }
  }
  return p;
}

Points rectangleWithCornersInARow(int inARow) {
  const Points corners = {{0, 0}, {2, 0}, {2, 1}, {0, 1}};
  Points p;
  for (std::size_t i = 0; i < 4; ++i) {
    for (int k = 0; k < inARow; ++k)
      p.emplace_back(corners[i] + (corners[(i + 1) % 4] - corners[i]) * k / inARow);
  }
  return p;
}

Points plateWithAHole(int corners) {
  Points p = {{-2, -2}};
  for (int i = 0; i <= corners; ++i) {
    const double angle = -2 * EIGEN_PI * i / corners - 0.7 * EIGEN_PI;
    p.emplace_back(std::cos(angle), std::sin(angle));
  }
  p.insert(p.end(), {{-2, -2}, {2, -2}, {2, 2}, {-2, 2}});
  return p;
}

TEST(Triangulation, CoversAFaceOnce) {
  std::mt19937_64 random(1);  // NOLINT(cert-msc51-cpp)
  std::normal_distribution<double> normal;
  const auto below = [&](std::size_t n) { return static_cast<int>(random() % n); };
  for (int run = 0; run < 400; ++run) {
    const std::vector<Points> faces = {comb(2 + below(7)), spiral(5 + below(15)),
                                       rectangleWithCornersInARow(1 + below(6)),
                                       plateWithAHole(3 + below(7))};
    Quat turn(normal(random), normal(random), normal(random), normal(random));
    if (run % 3 == 0) turn = Quat(Eigen::AngleAxisd(below(4) * EIGEN_PI / 2, Vec3::Unit(below(3))));
    turn.normalize();
    for (const Points& face : faces) {
      const double area = areaOf(face);
      const Areas found = areasOf(face, turn, std::pow(10.0, below(6) - 2), random() % face.size());
      EXPECT_NEAR(found.along, area, 1e-4 * area) << "run " << run << ", corners " << face.size();
      EXPECT_NEAR(found.all, area, 1e-4 * area) << "run " << run << ", corners " << face.size();
    }
  }
}

TEST(Triangulation, KeepsTheTurnOfFaces) {
  const Points square = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  const Points back(square.rbegin(), square.rend());
  EXPECT_NEAR(areasOf(square, Quat::Identity(), 1, 0).along, 1, 1e-6);
  EXPECT_NEAR(areasOf(back, Quat::Identity(), 1, 0).along, -1, 1e-6);
}

// The number of triangles is checked in each case.
TEST(Triangulation, DividesFacesThatCrossThemselvesOrHaveNoArea) {
  areasOf({{0, 0}, {1, 1}, {1, 0}, {0, 1}}, Quat::Identity(), 1, 0);
  areasOf({{0, 0}, {1, 0}, {2, 0}, {3, 0}, {1, 0}}, Quat::Identity(), 1, 0);
  areasOf(Points(6, Eigen::Vector2d(1, 1)), Quat::Identity(), 1, 0);
}

}  // namespace
}  // namespace hapticd::mesh_io
