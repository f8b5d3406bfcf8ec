#include "server/web/display_mesh.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <vector>

namespace hapticd::server {
namespace {

using geometry::Triangle;
using geometry::Vec3f;
using Corners = std::vector<unsigned int>;  // vertex numbers, three per triangle

static_assert(std::endian::native == std::endian::little, "encode() copies memory as it is");
static_assert(sizeof(Vec3f) == 3 * sizeof(float));

constexpr std::size_t kHead_bytes = 16;

struct Mesh {
  std::vector<Vec3f> vertices;
  Corners corners;
};

bool isUsable(std::span<const Vec3f> vertices, const Triangle& t) {
  return std::all_of(t.begin(), t.end(),
                     [&](std::uint32_t i) { return i < vertices.size() && vertices[i].allFinite(); }) &&
         t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
}

// Only the vertices that triangles use, in the order of their use.
Mesh compact(std::span<const Vec3f> vertices, Corners corners) {
  Mesh mesh{std::vector<Vec3f>(vertices.size()), std::move(corners)};
  mesh.vertices.resize(meshopt_optimizeVertexFetch(mesh.vertices.data(), mesh.corners.data(),
                                                   mesh.corners.size(), vertices.data(), vertices.size(),
                                                   sizeof(Vec3f)));
  return mesh;
}

// Scaled into the unit cube, since the simplifier squares coordinates in single precision. Adding 0 makes -0
// and 0 the same bits, which is how it finds equal positions.
std::vector<Vec3f> inUnitCube(const std::vector<Vec3f>& vertices) {
  Vec3f low = vertices.front();
  Vec3f high = low;
  for (const Vec3f& v : vertices) {
    low = low.cwiseMin(v);
    high = high.cwiseMax(v);
  }
  const Eigen::Array3d origin = low.cast<double>();
  const double side =
      std::max((high.cast<double>().array() - origin).maxCoeff(), std::numeric_limits<double>::min());
  std::vector<Vec3f> scaled;
  scaled.reserve(vertices.size());
  for (const Vec3f& v : vertices) {
    scaled.emplace_back(((v.cast<double>().array() - origin) / side + 0.0).cast<float>().matrix());
  }
  return scaled;
}

// Clients often send three vertices per triangle: gives vertices at one position one number, and drops
// triangles that have two corners at one position.
Corners weld(const Corners& corners, const std::vector<Vec3f>& positions) {
  Corners all(corners.size());
  meshopt_generateShadowIndexBuffer(all.data(), corners.data(), corners.size(), positions.data(),
                                    positions.size(), sizeof(Vec3f), sizeof(Vec3f));
  Corners welded;
  welded.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); i += 3) {
    if (all[i] == all[i + 1] || all[i + 1] == all[i + 2] || all[i + 2] == all[i]) continue;
    welded.insert(welded.end(), {all[i], all[i + 1], all[i + 2]});
  }
  return welded;
}

// Evenly spaced triangles: for a soup of separate triangles smaller than any cell, where clustering leaves
// nothing.
Corners sample(const Corners& corners, std::size_t most) {
  const std::size_t count = corners.size() / 3;
  Corners some;
  for (std::size_t i = 0; i < most; ++i) {
    const std::size_t at = 3 * (i * count / most);
    some.insert(some.end(), {corners[at], corners[at + 1], corners[at + 2]});
  }
  return some;
}

// Edge collapses give the better picture, but take about a second per million triangles and keep the
// topology, so that they cannot reduce a soup. Clustering in a grid comes before them in huge meshes and
// after them where they got stuck.
Corners simplify(const Mesh& mesh, std::size_t most, const std::atomic<bool>& cancelled) {
  constexpr std::size_t kMostCollapsed = 4 * kDisplayTriangles;
  constexpr float kAnyError = 1e6F;
  const std::vector<Vec3f> positions = inUnitCube(mesh.vertices);
  Corners corners = weld(mesh.corners, positions);
  Corners result;
  const auto cluster = [&](std::size_t target) {
    if (corners.size() <= 3 * target || cancelled) return;
    result.resize(corners.size());
    result.resize(meshopt_simplifySloppy(result.data(), corners.data(), corners.size(), positions[0].data(),
                                         positions.size(), sizeof(Vec3f), 3 * target, kAnyError));
    if (result.empty()) result = sample(corners, target);
    corners.swap(result);
  };
  const auto collapse = [&](std::size_t target) {
    if (corners.size() <= 3 * target || cancelled) return;
    result.resize(corners.size());
    result.resize(meshopt_simplify(result.data(), corners.data(), corners.size(), positions[0].data(),
                                   positions.size(), sizeof(Vec3f), 3 * target, kAnyError));
    corners.swap(result);
  };
  cluster(std::max(most, kMostCollapsed));
  collapse(most);
  cluster(most);
  return corners;
}

net::Buffer encode(const Mesh& mesh) {
  const std::uint32_t head[3] = {static_cast<std::uint32_t>(mesh.vertices.size()),
                                 static_cast<std::uint32_t>(mesh.corners.size() / 3), 0};
  const std::size_t vertices = mesh.vertices.size() * sizeof(Vec3f);
  const std::size_t corners = mesh.corners.size() * sizeof(std::uint32_t);
  net::Buffer bytes(kHead_bytes + vertices + corners);
  std::memcpy(bytes.data(), "HDM1", 4);
  std::memcpy(bytes.data() + 4, head, sizeof head);
  if (corners == 0) return bytes;
  std::memcpy(bytes.data() + kHead_bytes, mesh.vertices.data(), vertices);
  std::memcpy(bytes.data() + kHead_bytes + vertices, mesh.corners.data(), corners);
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
  Corners corners;
  for (const Triangle& t : triangles) {
    if (isUsable(vertices, t)) corners.insert(corners.end(), t.begin(), t.end());
  }
  if (corners.empty() || most == 0 || cancelled) return encode({});
  Mesh mesh = compact(vertices, std::move(corners));
  if (mesh.corners.size() > 3 * most) mesh = compact(mesh.vertices, simplify(mesh, most, cancelled));
  return encode(cancelled ? Mesh() : mesh);
}

std::size_t displayTriangles(const net::Buffer& mesh) {
  std::uint32_t count = 0;
  std::memcpy(&count, mesh.data() + 8, sizeof count);
  return count;
}

}  // namespace hapticd::server
