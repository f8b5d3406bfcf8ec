// An oracle for single ticks on a mesh. It shares no code with the renderer: it has its own grid, crossing
// test and descent over the faces. Slow and simple.
#pragma once

#include <array>
#include <cstdint>
#include <unordered_map>
#include <vector>

#include "geometry/triangle_mesh.h"

namespace hapticd::realtime::fixture {

using geometry::TriangleMesh;
using geometry::Vec3;

/// Front faces are touchable. Corners at the same place are one. Metres.
class MeshOracle {
 public:
  explicit MeshOracle(const TriangleMesh& mesh, double toolRadius_m = 0);

  /// How often the straight way from p to q goes in, less how often it comes
  /// out. Of a closed mesh this is 0 for every p and q on the same side,
  /// whatever way was taken between.
  int entered(const Vec3& p, const Vec3& q) const;
  /// Whether a border is as near as the way from p to q is long: then the way
  /// may go around.
  bool borderNear(const Vec3& p, const Vec3& q) const;
  /// The largest exterior angle (0 … pi) of an edge that a way from p to q may
  /// have crossed.
  double sharpestEdge(const Vec3& p, const Vec3& q) const;
  /// Where the tool comes to rest that is drawn from `start` to `goal` and only
  /// ever gets nearer to it; a point may hop by `hop_m` off the faces to begin
  /// a step. It gives up after `reach_m`.
  Vec3 descend(const Vec3& start, const Vec3& goal, double reach_m, double hop_m = 2e-8) const;

 private:
  struct Face {
    std::array<std::uint32_t, 3> corner;
    std::array<double, 3> exterior;  // angle at the edge from corner i to the
                                     // next; negative where concave
    Vec3 normal;
  };
  using Found = std::vector<std::uint32_t>;

  void weld(const TriangleMesh& mesh);
  void findEdges();
  void fillGrid();
  std::array<std::int64_t, 3> cellOf(const Vec3& p) const;
  Found near(const Vec3& p, const Vec3& q, double margin) const;
  const Vec3& at(const Face& f, int i) const { return vertices_[f.corner[static_cast<std::size_t>(i % 3)]]; }
  bool sideOf(std::uint32_t u, std::uint32_t v, const Vec3& p, const Vec3& q) const;
  int crossing(const Face& f, const Vec3& p, const Vec3& q) const;
  double free(const Vec3& p, const Vec3& way) const;
  std::vector<Vec3> directions(const Vec3& x, const Vec3& pull, Vec3& out) const;
  bool stepPoint(Vec3& x, const Vec3& goal, double reach, double hop) const;
  bool stepBall(Vec3& x, const Vec3& goal, double reach) const;
  bool pushedOut(Vec3& x) const;
  std::vector<Vec3> awayFromTouched(const Vec3& x) const;
  Vec3 foot(const Face& f, const Vec3& x) const;

  double radius_;
  double cell_ = 1;
  std::vector<Vec3> vertices_;
  std::vector<Face> faces_;
  std::unordered_map<std::uint64_t, Found> grid_;
};

}  // namespace hapticd::realtime::fixture
