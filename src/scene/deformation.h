// The shapes of a mesh whose vertices move, one after the other.
#pragma once

#include <functional>
#include <future>
#include <memory>
#include <vector>

#include "scene/mesh_geometry.h"

namespace hapticd::scene {

/// Keeps from shape to shape what need not be made anew: the index of the one before the last, and memory.
class Deformation {
 public:
  /// The triangles are others now, or there are none.
  void restart();

  /// The surface travels from where `old` is felt to where the client wants it, in at most `longest`.
  /// `triangles` are those of `old`, of which some may lack corners; `clock` gives the time, and `before` is
  /// when `old` was made.
  std::shared_ptr<MeshGeometry> next(std::shared_ptr<MeshGeometry> old,
                                     std::shared_ptr<const std::vector<Triangle>> triangles,
                                     std::shared_ptr<const std::vector<Vec3f>> target,
                                     const std::function<Nanos()>& clock, Nanos before, Nanos longest);

 private:
  // A box for each vertex, as in BoxedTriangles.
  struct Sweep {
    std::vector<float> lower, upper;
  };

  void sweep(const MeshGeometry& old, const std::vector<Vec3f>& target, Nanos now);
  bool spareIsFree() const;
  SpatialIndex indexOver(const std::shared_ptr<const std::vector<Triangle>>& triangles);

  bool begun_ = false;
  std::vector<std::uint32_t> lone_;  // vertices of no triangle
  Sweep sweep_;
  std::shared_ptr<MeshGeometry> spare_;  // the one before the last: used again once nobody reads it
  std::future<SpatialIndex> rebuilt_;    // built meanwhile; its end is waited for
};

}  // namespace hapticd::scene
