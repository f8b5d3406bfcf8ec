#include "truth/meshes.h"

#include <cmath>
#include <map>
#include <numbers>

namespace hapticd::truth {

void Shape::append(const Shape& other) {
  const auto first = static_cast<std::uint32_t>(vertices.size());
  vertices.insert(vertices.end(), other.vertices.begin(), other.vertices.end());
  for (const auto& t : other.triangles) triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
}

void Shape::flip(std::size_t triangle) {
  std::swap(triangles[triangle][1], triangles[triangle][2]);
}

Point Dice::direction() {
  std::normal_distribution<double> normal;
  return Point(normal(engine_), normal(engine_), normal(engine_)).normalized();
}

Eigen::Quaterniond Dice::rotation() {
  return Eigen::Quaterniond(Eigen::AngleAxisd(uniform(0, 2 * std::numbers::pi), direction()));
}

Shape patch(const Point& origin, const Point& u, const Point& v, int cellsU, int cellsV, double jitter,
            Dice& dice) {
  Shape out;
  for (int j = 0; j <= cellsV; ++j) {
    for (int i = 0; i <= cellsU; ++i) {
      const double alongU = i + (i > 0 && i < cellsU ? dice.uniform(-jitter, jitter) : 0.0);
      const double alongV = j + (j > 0 && j < cellsV ? dice.uniform(-jitter, jitter) : 0.0);
      out.vertices.push_back(origin + alongU / cellsU * u + alongV / cellsV * v);
    }
  }
  const auto id = [&](int i, int j) { return static_cast<std::uint32_t>(j * (cellsU + 1) + i); };
  for (int j = 0; j < cellsV; ++j) {
    for (int i = 0; i < cellsU; ++i) {
      const auto a = id(i, j);
      const auto b = id(i + 1, j);
      const auto c = id(i + 1, j + 1);
      const auto d = id(i, j + 1);
      if (dice.chance(0.5)) {
        out.triangles.push_back({a, b, d});
        out.triangles.push_back({b, c, d});
      } else {
        out.triangles.push_back({a, b, c});
        out.triangles.push_back({a, c, d});
      }
    }
  }
  return out;
}

Shape pocket(const Point& half, int maxCells, double gap, Dice& dice) {
  Shape out;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {-1.0, 1.0}) {
      const int u = (axis + 1) % 3;
      const int v = (axis + 2) % 3;
      // u x v is +axis; the front looks inwards.
      Point origin;
      origin[axis] = sign * half[axis];
      const double lowU = -half[u] + dice.uniform(0, 0.5) * gap;
      const double lowV = -half[v] + dice.uniform(0, 0.5) * gap;
      Point alongU = Point::Zero();
      Point alongV = Point::Zero();
      alongU[u] = half[u] - dice.uniform(0, 0.5) * gap - lowU;
      alongV[v] = half[v] - dice.uniform(0, 0.5) * gap - lowV;
      origin[u] = lowU;
      origin[v] = lowV;
      const int cellsU = dice.integer(1, maxCells);
      const int cellsV = dice.integer(1, maxCells);
      out.append(sign < 0 ? patch(origin, alongU, alongV, cellsU, cellsV, 0.3, dice)
                          : patch(origin, alongV, alongU, cellsV, cellsU, 0.3, dice));
    }
  }
  return out;
}

Shape box(const Point& centre, const Point& half) {
  Shape out;
  for (int i = 0; i < 8; ++i) {
    const Point corner((i & 1) != 0 ? 1 : -1, (i & 2) != 0 ? 1 : -1, (i & 4) != 0 ? 1 : -1);
    out.vertices.push_back(centre + corner.cwiseProduct(half));
  }
  out.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                   {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return out;
}

Shape soup(int triangles, double half, double smallest, double largest, Dice& dice) {
  Shape out;
  for (int i = 0; i < triangles; ++i) {
    const Point centre = dice.inCube(half);
    const auto first = static_cast<std::uint32_t>(out.vertices.size());
    for (int k = 0; k < 3; ++k)
      out.vertices.push_back(centre + dice.logarithmic(smallest, largest) * dice.direction());
    out.triangles.push_back({first, first + 1, first + 2});
  }
  return out;
}

Shape fan(int n, double radius, double height) {
  Shape out;
  out.vertices.emplace_back(0, 0, height);
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * std::numbers::pi * i / n;
    out.vertices.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0);
    out.triangles.push_back(
        {0, static_cast<std::uint32_t>(1 + i), static_cast<std::uint32_t>(1 + (i + 1) % n)});
  }
  return out;
}

Shape strips(int n, double half, Dice& dice) {
  // Widths over six decades: a needle stands beside a wide strip.
  std::vector<double> edges{0};
  for (int i = 0; i < n; ++i) edges.push_back(edges.back() + dice.logarithmic(1e-6, 1));
  Shape out;
  for (const double edge : edges) {
    const double x = half * (2 * edge / edges.back() - 1);
    out.vertices.emplace_back(x, -half, 0);
    out.vertices.emplace_back(x, half, 0);
  }
  for (int i = 0; i < n; ++i) {
    const auto a = static_cast<std::uint32_t>(2 * i);
    out.triangles.push_back({a, a + 2, a + 3});
    out.triangles.push_back({a, a + 3, a + 1});
  }
  return out;
}

Shape bumps(int cells, double half, double amplitude, double jitter, Dice& dice) {
  Shape out = patch({-half, -half, 0}, {2 * half, 0, 0}, {0, 2 * half, 0}, cells, cells, jitter, dice);
  for (int wave = 0; wave < 3; ++wave) {
    const Point k = dice.logarithmic(0.5, 4) * std::numbers::pi / half * dice.direction();
    const double phase = dice.uniform(0, 6);
    for (Point& p : out.vertices) p.z() += amplitude / 3 * std::sin(k.x() * p.x() + k.y() * p.y() + phase);
  }
  return out;
}

Shape sphere(int n, double radius, double roughness, Dice& dice) {
  Shape out;
  std::map<std::array<int, 3>, std::uint32_t> ids;
  const auto id = [&](int x, int y, int z) {
    const auto [it, fresh] = ids.try_emplace({x, y, z}, static_cast<std::uint32_t>(ids.size()));
    if (fresh)
      out.vertices.push_back(radius * dice.uniform(1 - roughness, 1 + roughness) *
                             Point(x, y, z).normalized());
    return it->second;
  };
  for (int octant = 0; octant < 8; ++octant) {
    const int sx = (octant & 1) != 0 ? -1 : 1;
    const int sy = (octant & 2) != 0 ? -1 : 1;
    const int sz = (octant & 4) != 0 ? -1 : 1;
    const auto at = [&](int i, int j) { return id(sx * (n - i - j), sy * i, sz * j); };
    for (int i = 0; i < n; ++i) {
      for (int j = 0; i + j < n; ++j) {
        out.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
        if (sx * sy * sz < 0) out.flip(out.triangles.size() - 1);
        if (i + j + 2 > n) continue;
        out.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        if (sx * sy * sz < 0) out.flip(out.triangles.size() - 1);
      }
    }
  }
  return out;
}

void transform(Shape& shape, const Eigen::Quaterniond& rotation, const Point& offset) {
  for (Point& p : shape.vertices) p = rotation * p + offset;
}

TrialObject bake(const Shape& shape, const Pose& pose) {
  TrialObject object;
  object.triangles = shape.triangles;
  object.poses = {pose};
  for (const Point& p : shape.vertices) {
    const Point local = pose.rotation.conjugate() * (p - pose.position_m);
    object.vertices.emplace_back(local.cwiseQuotient(pose.scale).cast<float>());
  }
  return object;
}

}  // namespace hapticd::truth
