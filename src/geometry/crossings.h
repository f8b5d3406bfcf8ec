// Triangles of a mesh that run through each other, found in bounded time.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/triangle_crossing.h"
#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

struct CrossingReport {
  std::uint64_t pairs = 0;  ///< found so far
  bool complete = false;    ///< all of the mesh was searched
};

/// Searches a tree of boxes over the triangles, a slice at a time. Triangles that lack a corner or have no
/// area are left out, and so are pairs with the same three corners: checkMesh() counts those.
///
/// Work is counted in units of about two nanoseconds, so that slices and results are the same on every
/// machine and in every run.
class CrossingSearch {
 public:
  /// Sorts the triangles: time n log n, about 0.2 s for a million, and 20 bytes for each meanwhile. Vertices
  /// and triangles must outlive the search, unchanged.
  CrossingSearch(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

  /// What a usual mesh needs, four times over; a search ends there, complete or not.
  static constexpr std::uint64_t budgetFor(std::size_t triangles) { return 10'000'000 + 2'500 * triangles; }

  /// Goes on for about as much work; true when there is nothing left to do.
  bool run(std::uint64_t work);

  bool done() const { return pending_.empty() || work_ >= budget_; }
  CrossingReport report() const { return {pairs_, pending_.empty()}; }

 private:
  struct Bounds {
    Vec3f min;
    Vec3f max;
  };
  // Two nodes of one level, 0 being the leaves.
  struct NodePair {
    std::uint32_t level;
    std::uint32_t a;
    std::uint32_t b;
  };

  void sortTriangles();
  void buildTree();
  Corners3f corners(std::uint32_t place) const;
  void visit(const NodePair& pair);
  void descend(const NodePair& pair);
  void testLeaves(std::uint32_t a, std::uint32_t b);
  void test(std::uint32_t first, std::uint32_t second);

  std::span<const Vec3f> vertices_;
  std::span<const Triangle> triangles_;
  std::vector<std::uint32_t> order_;         // triangles with area, near ones near each other
  std::vector<std::vector<Bounds>> levels_;  // from leaves to the one root
  std::vector<NodePair> pending_;
  std::uint64_t budget_ = 0;
  std::uint64_t work_ = 0;
  std::uint64_t pairs_ = 0;
};

/// The whole search at once.
CrossingReport findCrossings(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

/// A plain sentence with what the finding means for touching; none when nothing was found and all searched.
std::vector<std::string> describe(const CrossingReport& report);

}  // namespace hapticd::geometry
