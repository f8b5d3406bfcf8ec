// Meshes for the renderer's tests, in metres unless said otherwise.
#pragma once

#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <utility>

#include "geometry/triangle_mesh.h"

namespace hapticd::realtime::fixture {

using geometry::TriangleMesh;
using geometry::Vec3;

/// A height field z(x, y) over [-half, half]^2 in square cells, front side up; vertices moved by up to
/// `jitter` cells in x and y, and diagonals alternating at random when jittered.
inline TriangleMesh heightField(double half, int cells, const std::function<double(double, double)>& z,
                                double jitter = 0, unsigned seed = 1) {
  TriangleMesh mesh;
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> shift(-jitter, jitter);
  const double cell = 2 * half / cells;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      const bool inside = i > 0 && j > 0 && i < cells && j < cells;
      const double x = -half + cell * (i + (inside ? shift(random) : 0.0));
      const double y = -half + cell * (j + (inside ? shift(random) : 0.0));
      mesh.vertices.push_back(Vec3(x, y, z(x, y)).cast<float>());
    }
  }
  const auto id = [cells](int i, int j) { return static_cast<std::uint32_t>(j * (cells + 1) + i); };
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      const auto a = id(i, j);
      const auto b = id(i + 1, j);
      const auto c = id(i + 1, j + 1);
      const auto d = id(i, j + 1);
      if (jitter > 0 && shift(random) > 0) {
        mesh.triangles.push_back({a, b, d});
        mesh.triangles.push_back({b, c, d});
      } else {
        mesh.triangles.push_back({a, b, c});
        mesh.triangles.push_back({a, c, d});
      }
    }
  }
  return mesh;
}

inline TriangleMesh plane(double half, int cells = 1) {
  return heightField(half, cells, [](double, double) { return 0.0; });
}

inline TriangleMesh box(const Vec3& lower, const Vec3& upper) {
  TriangleMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.vertices.push_back(Vec3((i & 1) != 0 ? upper.x() : lower.x(), (i & 2) != 0 ? upper.y() : lower.y(),
                                 (i & 4) != 0 ? upper.z() : lower.z())
                                .cast<float>());
  }
  mesh.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

/// An octahedron, each side split into n x n, on a sphere; front side out. 8 n^2 triangles.
inline TriangleMesh sphere(double radius, int n) {
  TriangleMesh mesh;
  std::map<std::array<float, 3>, std::uint32_t> ids;
  const auto id = [&](const Vec3& p) {
    const Eigen::Vector3f v = (radius * p.normalized()).cast<float>();
    const auto [it, fresh] = ids.try_emplace({v.x(), v.y(), v.z()}, static_cast<std::uint32_t>(ids.size()));
    if (fresh) mesh.vertices.push_back(v);
    return it->second;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const Vec3 a((octant & 1) != 0 ? -1 : 1, 0, 0);
    Vec3 b(0, (octant & 2) != 0 ? -1 : 1, 0);
    Vec3 c(0, 0, (octant & 4) != 0 ? -1 : 1);
    if (a.cross(b).dot(c) < 0) std::swap(b, c);
    const auto at = [&](int i, int j) { return Vec3((a * (n - i - j) + b * i + c * j) / n); };
    for (int i = 0; i < n; ++i) {
      for (int j = 0; i + j < n; ++j) {
        mesh.triangles.push_back({id(at(i, j)), id(at(i + 1, j)), id(at(i, j + 1))});
        if (i + j + 2 <= n) {
          mesh.triangles.push_back({id(at(i + 1, j)), id(at(i + 1, j + 1)), id(at(i, j + 1))});
        }
      }
    }
  }
  return mesh;
}

}  // namespace hapticd::realtime::fixture
