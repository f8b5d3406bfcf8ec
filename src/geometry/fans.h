// Vertices with very many triangles, and coarser triangles that stand for theirs near the vertex.
//
// The tips of cones, the poles of spheres and the middles of discs have thousands of triangles. Near such a
// vertex they are narrower than anything that a tool feels, and all of them are within its reach. There, a
// few triangles are the same surface: level k joins 2^k neighbours to one.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

/// Immutable. Queries are noexcept and allocation-free.
class Fans {
 public:
  /// Vertices with fewer triangles are not kept.
  static constexpr std::uint32_t kFewest = 256;

  /// The fans of a mesh. Corners at the same place are one vertex. `leftOut`: triangles that do not count, or
  /// empty. Linear time; about 20 ms for a million triangles without a fan.
  Fans(std::span<const Vec3f> vertices, std::span<const Triangle> triangles,
       const std::vector<bool>& leftOut);

  bool empty() const noexcept { return fans_.empty(); }
  /// The fan that a triangle belongs to; -1: none.
  int fanOf(std::uint32_t triangle) const noexcept {
    return triangle < members_.size() ? members_[triangle].fan : -1;
  }
  /// The vertex in the middle.
  std::uint32_t apexOf(int fan) const noexcept { return fans_[static_cast<std::size_t>(fan)].apex; }
  /// The coarsest level whose triangles are nowhere farther than `error` from those of the mesh, within
  /// `radius` of the apex. 0: the mesh itself.
  int levelFor(int fan, double radius, double error) const noexcept;
  /// The first of the triangles of a fan that a level joins with this one, and its place among the first
  /// ones.
  struct First {
    std::uint32_t triangle = 0;
    std::uint32_t place = 0;
  };
  First firstOf(int level, std::uint32_t triangle) const noexcept;
  /// The triangle that a level has in place of `first` and those joined with it, in their winding.
  Triangle joined(int level, std::uint32_t first) const noexcept;

 private:
  struct Member {
    std::int32_t fan = -1;
    std::uint32_t rank = 0;
  };
  struct Level {
    double error = 0;   // per distance from the apex
    double radius = 0;  // of the ball around the apex in which no triangle ends
  };
  struct Fan {
    std::uint32_t apex = 0;
    std::vector<std::uint32_t> triangles;  // in the order around the vertex
    std::vector<std::uint32_t> rim;        // of the first triangle its begin, then of each its end
    std::vector<Level> levels;             // from level 1 on
  };

  void add(std::span<const Vec3f> vertices, Fan fan);

  std::vector<Member> members_;  // by triangle; empty without a fan
  std::vector<Fan> fans_;
};

}  // namespace hapticd::geometry
