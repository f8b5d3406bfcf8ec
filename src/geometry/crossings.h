// Search for triangles of a mesh that cross each other, in bounded time.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/triangle_crossing.h"
#include "geometry/triangle_mesh.h"

namespace hapticd::geometry {

struct CrossingReport {
  std::uint64_t pairs = 0;  ///< crossing pairs found so far
  bool complete = false;    ///< the whole mesh was searched
};

/// Searches a tree of boxes over the triangles in slices. Ignores triangles that lack a corner or have no
/// area, and pairs with the same three corners: checkMesh() counts those.
///
/// Counts work in units of about two nanoseconds, so that slices and results are the same on every machine
/// and in every run.
class CrossingSearch {
 public:
  /// Sorts the triangles: O(n log n), about 0.2 s for a million, with 20 bytes of temporary memory per
  /// triangle. Vertices and triangles must outlive the search and stay unchanged.
  CrossingSearch(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

  /// Work after which a search ends, complete or not: four times what a typical mesh needs.
  static constexpr std::uint64_t budgetFor(std::size_t triangles) { return 10'000'000 + 2'500 * triangles; }

  /// Continues for about `work` units; true when the search has ended.
  bool run(std::uint64_t work);

  bool done() const { return pending_.empty() || work_ >= budget_; }
  CrossingReport report() const { return {pairs_, pending_.empty()}; }

 private:
  struct Bounds {
    Vec3f min;
    Vec3f max;
  };
  // Two nodes of one level; level 0 holds the leaves.
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
  std::vector<std::uint32_t> order_;         // triangles with area, along a space-filling curve
  std::vector<std::vector<Bounds>> levels_;  // from the leaves to the root
  std::vector<NodePair> pending_;
  std::uint64_t budget_ = 0;
  std::uint64_t work_ = 0;
  std::uint64_t pairs_ = 0;
};

/// The whole search in one call.
CrossingReport findCrossings(std::span<const Vec3f> vertices, std::span<const Triangle> triangles);

/// A sentence on the finding and its consequence for touch; none when a complete search found nothing.
std::vector<std::string> describe(const CrossingReport& report);

}  // namespace hapticd::geometry
