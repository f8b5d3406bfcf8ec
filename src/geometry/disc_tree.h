// Discs around the triangles of a mesh, in a tree of boxes: which triangles a ball may meet on its way.
//
// An index of boxes finds what is around a place. A ball that moves along a surface is near few of the
// triangles around the middle of its way, and to look at all of them took most of a tick. The numbers of a
// disc lie in the order of the tree, eight to a group, so that no corner is fetched and the compiler tests
// several at once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

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
  /// and returns how many these are; more than there is room for when they do not fit. Adds the number of
  /// groups that it tested to `groups`. The order depends on the mesh alone.
  std::size_t findNear(const Vec3& from, const Vec3& way, double distance, std::span<std::uint32_t> found,
                       int& groups) const noexcept;
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

  static unsigned near(const Query& query, const DiscGroup& group) noexcept;
  static unsigned near(const Query& query, const BoxGroup& group) noexcept;
  void descend(Query& query, std::size_t level, std::size_t group) const noexcept;

  std::vector<std::uint32_t> triangles_;  // by place
  std::vector<DiscGroup> discs_;
  std::vector<Level> levels_;
  double rounding_ = 0;
};

}  // namespace hapticd::geometry
