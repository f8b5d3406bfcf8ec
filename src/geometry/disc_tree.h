// Discs around the triangles of a mesh, in a tree of boxes: which triangles a ball may meet on its way.
//
// An index of boxes finds what is around a place. A ball that moves along a surface is near few of the
// triangles around the middle of its way, and to look at all of them took most of a tick. The numbers of a
// disc lie in the order of the tree, eight to a group, so that no corner is fetched and the compiler tests
// several at once.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// A path, for what lies within a distance of it. In single precision.
struct NearPath {
  Vec3f from, way;
  float length2;  ///< of the way
  float distance, distance2;
};

/// Above 0 where no place of the path is within its distance of a disc (square lengths). `x`, `y` and `z`
/// lead from the centre to the begin of the path; `rounding` is relative. Numbers and no vectors, so that the
/// compiler computes several discs at once.
inline float missOfDisc(const NearPath& path, float x, float y, float z, float nx, float ny, float nz,
                        float radius, float rounding) noexcept {
  // Of the path, the part above the disc and the part beside it.
  const float up = nx * x + ny * y + nz * z;
  const float rise = nx * path.way.x() + ny * path.way.y() + nz * path.way.z();
  const float lowest = up * (up + rise) > 0 ? std::min(std::abs(up), std::abs(up + rise)) : 0.0F;
  const float offset2 = x * x + y * y + z * z;
  const float inPlane = x * path.way.x() + y * path.way.y() + z * path.way.z() - up * rise;
  const float wayInPlane2 = path.length2 - rise * rise;
  const float along = wayInPlane2 > 0 ? -inPlane / wayInPlane2 : 0.0F;
  const float share = std::min(std::max(along, 0.0F), 1.0F);
  const float aside2 = offset2 - up * up + share * (2 * inPlane + share * wayInPlane2);
  const float error2 = rounding * (offset2 + path.length2 + path.distance2);
  const float room2 = path.distance2 + error2 - lowest * lowest;
  const float farthest = radius + std::sqrt(std::max(0.0F, room2));
  const float beyond = aside2 - farthest * farthest - error2;
  return room2 < 0 ? 1.0F : beyond;
}

/// Immutable. Queries are noexcept, lock-free and allocation-free. All is in single precision and padded by
/// more than its rounding: a query finds a superset of what is near.
class DiscTree {
 public:
  /// Around the middle of the corners.
  struct Disc {
    Vec3f centre;
    float radius = 0;
    Vec3f normal;  ///< unit; zero for a line: then it is a ball
  };

  /// Triangles that are `leftOut` (or empty: none), not finite or without a vertex are not in the tree.
  DiscTree(std::span<const Vec3f> vertices, std::span<const Triangle> triangles,
           const std::vector<bool>& leftOut);

  /// Writes the places of at least all triangles within `distance` of the segment from `from` to from + way
  /// and returns how many these are; more than there is room for when they do not fit, or when more than
  /// `most` groups would have to be tested. Adds the number of groups that it tested to `groups`. The order
  /// depends on the mesh alone.
  std::size_t findNear(const Vec3& from, const Vec3& way, double distance, int most,
                       std::span<std::uint32_t> found, int& groups) const noexcept;
  std::uint32_t triangleAt(std::uint32_t place) const noexcept { return triangles_[place]; }
  Disc discAt(std::uint32_t place) const noexcept {
    const DiscGroup& group = discs_[place / kGroup];
    const std::size_t i = place % kGroup;
    return {{group.centre[0][i], group.centre[1][i], group.centre[2][i]},
            group.radius[i],
            {group.normal[0][i], group.normal[1][i], group.normal[2][i]}};
  }
  /// By how much a centre may be off.
  double rounding() const noexcept { return rounding_; }

 private:
  static constexpr std::size_t kGroup = 8;
  using Column = std::array<float, kGroup>;
  struct DiscGroup {
    std::array<Column, 3> centre{};
    std::array<Column, 3> normal{};
    Column radius{};
  };
  struct BoxGroup {
    std::array<Column, 3> lower{};
    std::array<Column, 3> upper{};
  };
  // Groups of boxes: of level 0 around each group of discs, of the others around each group below.
  struct Level {
    std::vector<BoxGroup> groups;
    std::size_t count = 0;  // of the boxes
  };
  struct Query;
  struct FloatBox;

  static std::size_t groupsFor(std::size_t count) { return (count + kGroup - 1) / kGroup; }
  void setDisc(std::size_t place, std::span<const Vec3f> vertices, const Triangle& triangle);
  void buildLevels(std::vector<FloatBox> boxes);
  static unsigned near(const Query& query, const DiscGroup& group) noexcept;
  static unsigned near(const Query& query, const BoxGroup& group) noexcept;
  void descend(Query& query, std::size_t level, std::size_t group) const noexcept;

  std::vector<std::uint32_t> triangles_;  // by place
  std::vector<DiscGroup> discs_;
  std::vector<Level> levels_;
  double rounding_ = 0;
};

}  // namespace hapticd::geometry
