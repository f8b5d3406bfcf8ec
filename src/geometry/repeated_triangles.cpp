#include "geometry/repeated_triangles.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

namespace hapticd::geometry {
namespace {

using Corner = std::array<std::uint32_t, 3>;
using Key = std::array<Corner, 3>;

// The bits of a position, with one zero.
Corner cornerOf(const Vec3f& v) {
  return {std::bit_cast<std::uint32_t>(v.x() + 0.0F), std::bit_cast<std::uint32_t>(v.y() + 0.0F),
          std::bit_cast<std::uint32_t>(v.z() + 0.0F)};
}

// The corners, beginning with the lowest.
Key keyOf(std::span<const Vec3f> vertices, const Triangle& t) {
  Key key{cornerOf(vertices[t[0]]), cornerOf(vertices[t[1]]), cornerOf(vertices[t[2]])};
  std::rotate(key.begin(), std::min_element(key.begin(), key.end()), key.end());
  return key;
}

std::uint64_t hashOf(const Key& key) {
  constexpr std::uint64_t kOdd = 0x9E3779B97F4A7C15U;
  std::uint64_t hash = 0;
  for (const Corner& corner : key) {
    for (const std::uint32_t bits : corner) hash = std::rotl(hash, 23) * kOdd + bits;
  }
  hash = (hash ^ (hash >> 32U)) * kOdd;
  return hash ^ (hash >> 29U);
}

}  // namespace

std::vector<bool> repeatedTriangles(std::span<const Vec3f> vertices, std::span<const Triangle> triangles) {
  // Open addressing. Part of the hash tells most triangles apart without a look at their corners.
  struct Slot {
    std::uint32_t first = 0xFFFFFFFFU;  // free
    std::uint32_t tag = 0;
  };
  std::vector<Slot> slots(std::bit_ceil(2 * triangles.size() + 1));
  std::vector<bool> repeated;
  for (std::uint32_t i = 0; i < triangles.size(); ++i) {
    const Triangle& t = triangles[i];
    if (std::max({t[0], t[1], t[2]}) >= vertices.size()) continue;
    const Key key = keyOf(vertices, t);
    const std::uint64_t hash = hashOf(key);
    const auto tag = static_cast<std::uint32_t>(hash >> 32U);
    const auto other = [&](const Slot& slot) {
      return slot.first < i && (slot.tag != tag || keyOf(vertices, triangles[slot.first]) != key);
    };
    std::size_t at = hash & (slots.size() - 1);
    while (other(slots[at])) at = (at + 1) & (slots.size() - 1);
    if (slots[at].first > i) {
      slots[at] = {i, tag};
    } else {
      repeated.resize(triangles.size());
      repeated[i] = true;
    }
  }
  return repeated;
}

}  // namespace hapticd::geometry
