#include "geometry/weld.h"

#include <algorithm>
#include <bit>

namespace hapticd::geometry {
namespace {

std::uint64_t hashOf(const Vec3f& v) {
  std::uint64_t hash = 0;
  for (const float c : {v.x(), v.y(), v.z()}) {
    hash = (hash ^ std::bit_cast<std::uint32_t>(c)) * 0x9E3779B97F4A7C15U;
    hash ^= hash >> 29U;
  }
  return hash;
}

}  // namespace

// Open addressing: one table instead of an allocation per vertex.
std::vector<std::uint32_t> firstAtSamePosition(std::span<const Vec3f> vertices) {
  std::vector<std::uint32_t> first(vertices.size(), kNoVertex);
  std::vector<std::uint32_t> table(std::bit_ceil(2 * vertices.size() + 1), kNoVertex);
  const std::size_t mask = table.size() - 1;
  for (std::uint32_t i = 0; i < vertices.size(); ++i) {
    if (!vertices[i].allFinite()) continue;
    const Vec3f position = vertices[i] + Vec3f::Zero();  // -0 becomes 0
    std::size_t slot = hashOf(position) & mask;
    while (table[slot] != kNoVertex && vertices[table[slot]] != position) slot = (slot + 1) & mask;
    if (table[slot] == kNoVertex) table[slot] = i;
    first[i] = table[slot];
  }
  return first;
}

void weld(TriangleMesh& mesh) {
  const auto exists = [&](std::uint32_t i) { return i < mesh.vertices.size(); };
  std::erase_if(mesh.triangles, [&](const Triangle& t) { return !std::all_of(t.begin(), t.end(), exists); });
  const std::vector<std::uint32_t> first = firstAtSamePosition(mesh.vertices);
  std::vector<std::uint32_t> renumbered(mesh.vertices.size(), kNoVertex);
  for (Triangle& t : mesh.triangles) {
    for (std::uint32_t& i : t) {
      if (first[i] != kNoVertex) i = first[i];
      renumbered[i] = 0;
    }
  }
  std::uint32_t next = 0;
  for (std::uint32_t i = 0; i < renumbered.size(); ++i) {
    if (renumbered[i] == kNoVertex) continue;
    mesh.vertices[next] = mesh.vertices[i];
    renumbered[i] = next++;
  }
  mesh.vertices.resize(next);
  for (Triangle& t : mesh.triangles) {
    for (std::uint32_t& i : t) i = renumbered[i];
  }
}

}  // namespace hapticd::geometry
