// The shape of one object as the servo loop sees it: immutable triangles with their index.
#pragma once

#include <memory>
#include <vector>

#include "base/time.h"
#include "geometry/disc_tree.h"
#include "geometry/fans.h"
#include "geometry/triangle_mesh.h"
#include "scene/spatial_index.h"

namespace hapticd::scene {

using base::Nanos;
using geometry::Box;
using geometry::Triangle;
using geometry::Vec3f;

/// Three corners of a triangle in object units, in winding order.
struct Corners {
  Vec3 a, b, c;
};

/// Immutable shape. While it deforms, vertices travel from `vertices` to `target` between two times; the
/// index then holds boxes around both ends. Shared by all snapshots that show it; freed on the scene thread.
struct MeshGeometry {
  std::uint64_t topology = 0;  ///< equal numbers mean equal triangle lists: triangle ids stay valid
  std::shared_ptr<const std::vector<Triangle>> triangles;
  std::shared_ptr<const std::vector<Vec3f>> vertices;
  std::shared_ptr<const std::vector<Vec3f>> target;  ///< null unless deforming
  std::shared_ptr<const std::vector<Vec3f>>
      before;  ///< the target before `target`, which may not be reached yet
  Nanos morphBegin = 0;
  Nanos morphEnd = 0;
  std::uint32_t shape = 0;  ///< counts the shapes of one list of triangles
  /// Upper bound of the way of a vertex during the shapes of the last 100 ms, object units. The index does
  /// not cover it: a late tick that missed a shape adds it to its reach.
  double recentMove = 0;
  Box bounds;          ///< of the shape once it has arrived: its index may cover more
  Box boundsOnTheWay;  ///< of all shapes that it has while it deforms
  SpatialIndex index;  ///< over triangle ids, in object units
  /// Over the shape once it has arrived, after a way so long that boxes around it are around each other;
  /// empty otherwise.
  SpatialIndex indexOfArrived;
  std::shared_ptr<const geometry::Fans> fans;  ///< null without any, and once a vertex has moved
  /// For a ball tool; null without one, and once a vertex has moved.
  std::shared_ptr<const geometry::DiscTree> discs;

  /// All positions of vertices, as of the last publication.
  const std::vector<Vec3f>& shapeVertices() const noexcept { return target ? *target : *vertices; }
  const Box& boundsAfter(Nanos now) const noexcept { return deformingAfter(now) ? boundsOnTheWay : bounds; }
  bool deformingAfter(Nanos now) const noexcept { return target && now < morphEnd; }

  /// For what is asked of the shape at `now` alone, without the way to it.
  const SpatialIndex& indexAt(Nanos now) const noexcept {
    return indexOfArrived.size() > 0 && !deformingAfter(now) ? indexOfArrived : index;
  }

  /// Corners of a triangle at `now`, object units. noexcept, allocation-free.
  Corners corners(std::uint32_t triangle, Nanos now) const noexcept {
    return corners((*triangles)[triangle], now);
  }
  /// The same for a triangle between any three vertices.
  Corners corners(const Triangle& t, Nanos now) const noexcept {
    return {vertex(t[0], now), vertex(t[1], now), vertex(t[2], now)};
  }

  Vec3 vertex(std::uint32_t i, Nanos now) const noexcept {
    const Vec3 from = (*vertices)[i].cast<double>();
    if (!target) return from;
    const Vec3 to = (*target)[i].cast<double>();
    if (now >= morphEnd) return to;
    return from + progress(now) * (to - from);
  }

  /// Part of the way that is done at `now`, while deforming: 0 to 1.
  double progress(Nanos now) const noexcept {
    if (now >= morphEnd) return 1;
    if (now <= morphBegin) return 0;
    return static_cast<double>(now - morphBegin) / static_cast<double>(morphEnd - morphBegin);
  }
};

}  // namespace hapticd::scene
