// The successive shapes of a mesh whose vertices move.
#pragma once

#include <atomic>
#include <exception>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

#include "base/thread.h"
#include "scene/mesh_geometry.h"

namespace hapticd::scene {

/// Builds one index in a thread "index builder". The destructor waits for the build.
class IndexBuilder {
 public:
  void start(std::function<SpatialIndex()> build);
  /// From start() until takeIfBuilt() returned an index.
  bool running() const noexcept { return job_ != nullptr; }
  /// The index, once it is built; never waits for the build. Throws what the build threw.
  std::optional<SpatialIndex> takeIfBuilt();

 private:
  struct Job {
    std::function<SpatialIndex()> build;
    std::optional<SpatialIndex> index;
    std::exception_ptr error;
    std::atomic<bool> done{false};
  };

  std::shared_ptr<Job> job_;
  base::Thread thread_;  // last: it uses the job
};

/// Reuses from shape to shape the index of the shape before the last, and memory.
class Deformation {
 public:
  /// Forgets the shapes so far: the triangles changed, or there are none.
  void restart();

  /// The next shape, which rests until begin(). `triangles` are those of `old`, of which some may lack
  /// corners.
  std::shared_ptr<MeshGeometry> next(std::shared_ptr<MeshGeometry> old,
                                     std::shared_ptr<const std::vector<Triangle>> triangles,
                                     std::shared_ptr<const std::vector<Vec3f>> target, Nanos now);
  /// Upper bound of the way of a vertex to that shape, object units.
  double way() const noexcept { return way_; }
  /// The surface of `mesh`, of next(), travels from where the servo renders the shape before it.
  void begin(MeshGeometry& mesh, Nanos begin, Nanos end);

 private:
  // A box for each vertex, as in BoxedTriangles.
  struct Sweep {
    std::vector<float> lower, upper;
  };

  void sweep(const MeshGeometry& old, const std::vector<Vec3f>& target, Nanos now);
  double longestMove() const;
  void coverTrajectory(const MeshGeometry& old);
  void leaveOutLoneVertices();
  bool spareIsFree() const;
  SpatialIndex indexOver(const std::shared_ptr<const std::vector<Triangle>>& triangles);
  bool boxesAreAroundEachOther(const Box& bounds) const;
  SpatialIndex indexOfArrived(const std::vector<Triangle>& triangles, const std::vector<Vec3f>& target);

  // Sums of longestMove() over the last 100 to 200 ms.
  struct Moves {
    double recent = 0;
    double older = 0;
    Nanos begin = 0;
    double add(double move, Nanos now);
  };

  bool begun_ = false;
  Moves moves_;
  double way_ = 0;
  std::shared_ptr<std::vector<Vec3f>>
      from_;                         // room for where the next shape begins; null: where the last ended
  std::vector<std::uint32_t> lone_;  // vertices of no triangle
  Sweep sweep_;
  std::shared_ptr<MeshGeometry>
      spare_;  // the shape before the last; its index is reused once no snapshot holds it
  IndexBuilder rebuild_;
};

}  // namespace hapticd::scene
