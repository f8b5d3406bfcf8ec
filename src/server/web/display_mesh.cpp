#include "server/web/display_mesh.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

namespace hapticd::server {
namespace {

using geometry::Triangle;
using geometry::Vec3f;

static_assert(std::endian::native == std::endian::little, "the mesh is copied as it lies in memory");

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t kHead_bytes = 16;

struct Mesh {
  std::vector<Vec3f> vertices;
  std::vector<Triangle> triangles;
};

bool isUsable(std::span<const Vec3f> vertices, const Triangle& t) {
  return std::all_of(t.begin(), t.end(),
                     [&](std::uint32_t i) { return i < vertices.size() && vertices[i].allFinite(); }) &&
         t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
}

// Only the vertices that are used, however many there are.
Mesh compact(std::span<const Vec3f> vertices, const std::vector<Triangle>& triangles) {
  Mesh mesh;
  std::vector<std::uint32_t> renamed(vertices.size(), kNone);
  mesh.triangles.reserve(triangles.size());
  for (Triangle t : triangles) {
    for (std::uint32_t& corner : t) {
      std::uint32_t& name = renamed[corner];
      if (name == kNone) {
        name = static_cast<std::uint32_t>(mesh.vertices.size());
        mesh.vertices.push_back(vertices[corner]);
      }
      corner = name;
    }
    mesh.triangles.push_back(t);
  }
  return mesh;
}

// The cell of each vertex in a grid of so many cells along the longest side, as a number from 0.
std::vector<std::uint32_t> cellsOf(const std::vector<Vec3f>& vertices, double cells, std::uint32_t& count) {
  Vec3f low = vertices.front();
  Vec3f high = low;
  for (const Vec3f& v : vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  const Eigen::Vector3d origin = low.cast<double>();
  const double side = std::max((high.cast<double>() - origin).maxCoeff() / cells, 1e-300);
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys(vertices.size());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const Eigen::Vector3d at = (vertices[i].cast<double>() - origin) / side;
    std::uint64_t key = 0;
    for (int axis = 0; axis < 3; ++axis) {
      key = key << 21 | static_cast<std::uint64_t>(std::clamp(at[axis], 0.0, 2097151.0));
    }
    keys[i] = {key, static_cast<std::uint32_t>(i)};
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> cell(vertices.size());
  count = 0;
  for (std::size_t i = 0; i < keys.size(); ++i) {
    if (i > 0 && keys[i].first != keys[i - 1].first) ++count;
    cell[keys[i].second] = count;
  }
  ++count;
  return cell;
}

// Each cell becomes the mean of its vertices; faces that fall into two cells or one vanish, equal ones merge.
Mesh cluster(const Mesh& mesh, double cells) {
  std::uint32_t count = 0;
  const std::vector<std::uint32_t> cell = cellsOf(mesh.vertices, cells, count);
  std::vector<Triangle> triangles;
  for (const Triangle& t : mesh.triangles) {
    Triangle c{cell[t[0]], cell[t[1]], cell[t[2]]};
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    triangles.push_back(c);
  }
  std::sort(triangles.begin(), triangles.end());
  triangles.erase(std::unique(triangles.begin(), triangles.end()), triangles.end());
  std::vector<Eigen::Vector3d> sum(count, Eigen::Vector3d::Zero());
  std::vector<std::uint32_t> members(count, 0);
  for (std::size_t i = 0; i < cell.size(); ++i) {
    sum[cell[i]] += mesh.vertices[i].cast<double>();
    ++members[cell[i]];
  }
  std::vector<Vec3f> means(count);
  for (std::uint32_t i = 0; i < count; ++i) means[i] = (sum[i] / members[i]).cast<float>();
  return compact(means, triangles);
}

// The faces of a surface grow with the square of the cells along a side, so a few tries come close.
Mesh simplify(const Mesh& mesh, std::size_t most, const std::atomic<bool>& cancelled) {
  constexpr int kTries = 6;
  Mesh best;
  double cells = std::clamp(std::sqrt(static_cast<double>(most) / 6), 1.0, 2e6);
  for (int i = 0; i < kTries && !cancelled; ++i) {
    Mesh coarse = cluster(mesh, cells);
    const std::size_t have = coarse.triangles.size();
    if (have <= most && have >= best.triangles.size()) best = std::move(coarse);
    if (best.triangles.size() * 10 >= most * 8) break;
    const double ratio = static_cast<double>(most) / static_cast<double>(std::max<std::size_t>(have, 1));
    cells = std::clamp(cells * std::clamp(0.95 * std::sqrt(ratio), 0.1, 10.0), 1.0, 2e6);
  }
  return best;
}

net::Buffer encode(const Mesh& mesh) {
  const std::uint32_t head[3] = {static_cast<std::uint32_t>(mesh.vertices.size()),
                                 static_cast<std::uint32_t>(mesh.triangles.size()), 0};
  const std::size_t vertices = mesh.vertices.size() * sizeof(Vec3f);
  const std::size_t triangles = mesh.triangles.size() * sizeof(Triangle);
  net::Buffer bytes(kHead_bytes + vertices + triangles);
  std::memcpy(bytes.data(), "HDM1", 4);
  std::memcpy(bytes.data() + 4, head, sizeof head);
  if (triangles == 0) return bytes;
  std::memcpy(bytes.data() + kHead_bytes, mesh.vertices.data(), vertices);
  std::memcpy(bytes.data() + kHead_bytes + vertices, mesh.triangles.data(), triangles);
  return bytes;
}

}  // namespace

std::size_t displayShare(std::size_t triangles, std::size_t trianglesInAll, std::size_t objects) {
  if (trianglesInAll <= kDisplayTriangles) return triangles;
  constexpr std::size_t kHalf = kDisplayTriangles / 2;
  return std::min(triangles, kHalf / std::max<std::size_t>(objects, 1) + kHalf * triangles / trianglesInAll);
}

net::Buffer displayMesh(std::span<const Vec3f> vertices, std::span<const Triangle> triangles,
                        std::size_t most, const std::atomic<bool>& cancelled) {
  std::vector<Triangle> usable;
  std::copy_if(triangles.begin(), triangles.end(), std::back_inserter(usable),
               [&](const Triangle& t) { return isUsable(vertices, t); });
  const Mesh mesh = compact(vertices, usable);
  if (mesh.triangles.size() <= most || cancelled) return encode(cancelled ? Mesh() : mesh);
  return encode(simplify(mesh, most, cancelled));
}

std::size_t displayTriangles(const net::Buffer& mesh) {
  std::uint32_t count = 0;
  std::memcpy(&count, mesh.data() + 8, sizeof count);
  return count;
}

}  // namespace hapticd::server
