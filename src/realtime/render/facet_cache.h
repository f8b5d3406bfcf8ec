// The facets around the proxy: all that a tool inside a ball can meet, in fixed storage.
//
// A point asks first which faces have both ends of its way on one side: few have not.
// A ball tool has many faces within its radius and touches few. So it keeps their numbers and, for each, a
// lower bound of its distance, and a plane with the face behind it: only what these let pass is made and
// measured.
#pragma once

#include <array>

#include "realtime/render/facet.h"

namespace hapticd::realtime {

/// Everything noexcept and allocation-free.
class FacetCache {
 public:
  static constexpr int kMaxFacets = 512;        ///< facets for a point
  static constexpr int kMaxTriangles = 1024;  ///< triangles for a ball tool

  /// A triangle of an object, by their numbers.
  struct TriangleId {
    std::uint32_t triangle = 0;
    int object = 0;
  };

  /// For a point the tool's radius is 0.
  explicit FacetCache(double toolRadius_m) noexcept : toolRadius_(toolRadius_m) {}

  /// Empties it for the facets that a tool within `reach` of `centre` can meet.
  void restart(const Vec3& centre, double reach) noexcept;
  /// For a point: takes in a facet. `deforming`: it counts whatever its distance.
  void add(const Facet& facet, bool deforming) noexcept;
  /// For a ball tool: the same for a triangle that is `distance` or more from the centre.
  void add(const TriangleId& id, double distance, double skin, bool deforming) noexcept;
  /// Nothing is gathered.
  void invalidate() noexcept { complete_ = false; }

  /// Whether every facet is here that a tool within `radius` of p can meet.
  bool covers(const Vec3& p, double radius) const noexcept {
    return complete_ && (p - centre_).norm() + radius <= reach_;
  }
  bool complete() const noexcept { return complete_; }
  const Vec3& centre() const noexcept { return centre_; }
  double reach() const noexcept { return reach_; }
  int size() const noexcept { return count_; }
  double maxSkin() const noexcept { return maxSkin_; }

  /// For a point.
  const Facet* begin() const noexcept { return facets_.data(); }
  const Facet* end() const noexcept { return facets_.data() + count_; }

  /// For a ball tool: it is at p now.
  void moveTo(const Vec3& p) noexcept;
  const TriangleId& triangle(int i) const noexcept { return triangles_[static_cast<std::size_t>(i)]; }
  /// The next triangle from i on that may be within `distance` of where the tool is; size() when there is
  /// none.
  int nextWithin(double distance, int i) const noexcept;
  /// How near it may come on the way d from where the tool is. That there is no more than a guess to improve
  /// on.
  double lowerBound(int i, const Vec3& d) noexcept;
  /// It is there, with `foot` the nearest point of it. Returns the same as nearest() now.
  double refine(int i, const Vec3& foot, const Vec3& d) noexcept;
  /// It is nowhere.
  void exclude(int i) noexcept;
  /// For a point: all facets whose faces the way p + t d, t in [0, limit], or a part of
  /// it from p on, may come to; `found` has room for kMaxFacets. Returns how many.
  int facetsNearPath(const Vec3& p, const Vec3& d, double limit, const Facet** found) const noexcept;

 private:
  // A plane, normal . x = offset: for a point that of the face, else one with the face behind it.
  struct SupportPlane {
    Vec3 normal;
    double offset;
  };

  double toolRadius_;
  Vec3 centre_ = Vec3::Zero();
  double reach_ = 0;
  bool complete_ = false;
  int count_ = 0;
  double maxSkin_ = 0;  // of the skins
  std::array<SupportPlane, kMaxTriangles> supportPlanes_;
  std::array<Facet, kMaxFacets> facets_;
  Vec3 toolPosition_ = Vec3::Zero();                 // of the tool
  double travel_ = 0;                           // since it was gathered
  std::array<double, kMaxTriangles> distances_;  // and that way: a lower bound
  std::array<TriangleId, kMaxTriangles> triangles_;
};

}  // namespace hapticd::realtime
