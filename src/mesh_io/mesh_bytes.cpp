#include "mesh_io/mesh_bytes.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <stdexcept>
#include <type_traits>

namespace hapticd::mesh_io {
namespace {

using geometry::Triangle;
using geometry::TriangleMesh;
using geometry::Vec3f;

using Counts = std::array<std::uint64_t, 2>;  // vertices, triangles

static_assert(sizeof(Vec3f) == 12 && sizeof(Triangle) == 12);

template <class T>
std::vector<T> take(std::span<const std::byte>& bytes, std::uint64_t count) {
  std::vector<T> values(count);
  const std::size_t size = count * sizeof(T);
  if (size > 0) std::memcpy(static_cast<void*>(values.data()), bytes.data(), size);
  bytes = bytes.subspan(size);
  return values;
}

}  // namespace

void sendMesh(const TriangleMesh& mesh, const std::function<void(std::span<const std::byte>)>& send) {
  const Counts counts{mesh.vertices.size(), mesh.triangles.size()};
  send(std::as_bytes(std::span(counts)));
  send(std::as_bytes(std::span(mesh.vertices)));
  send(std::as_bytes(std::span(mesh.triangles)));
}

TriangleMesh receivedMesh(std::span<const std::byte> bytes) {
  constexpr std::uint64_t kMost = 1U << 31U;  // so that sizes do not overflow
  Counts counts{};
  if (bytes.size() >= sizeof counts) std::memcpy(counts.data(), bytes.data(), sizeof counts);
  const auto [vertices, triangles] = counts;
  if (bytes.size() < sizeof counts || vertices > kMost || triangles > kMost ||
      bytes.size() - sizeof counts != vertices * sizeof(Vec3f) + triangles * sizeof(Triangle)) {
    throw std::runtime_error("its reader sent an incomplete mesh");
  }
  bytes = bytes.subspan(sizeof counts);
  TriangleMesh mesh;
  mesh.vertices = take<Vec3f>(bytes, vertices);
  mesh.triangles = take<Triangle>(bytes, triangles);
  if (mesh.triangles.empty()) throw std::runtime_error("it holds no triangles");
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    if (!mesh.vertices[i].allFinite())
      throw std::runtime_error("a coordinate of vertex " + std::to_string(i) + " is not finite");
  }
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    for (const std::uint32_t corner : mesh.triangles[i]) {
      if (corner < vertices) continue;
      throw std::runtime_error("triangle " + std::to_string(i) + " has corner " + std::to_string(corner) +
                               ", but there are " + std::to_string(vertices) + " vertices");
    }
  }
  return mesh;
}

}  // namespace hapticd::mesh_io
