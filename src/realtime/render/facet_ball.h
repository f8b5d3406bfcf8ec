// The facets around the proxy: all that a tool inside a ball can meet, in fixed storage.
//
// A point asks first which faces have both ends of its way on one side: few have not.
// A ball tool has many faces within its radius and touches few. So it keeps for each the distance from the
// centre, or a lower bound of it, and those that it may touch soon in front; when the tool has moved, only
// these are measured again.
#pragma once

#include <array>

#include "realtime/render/facet.h"

namespace hapticd::realtime {

/// Everything noexcept and allocation-free.
class FacetBall {
 public:
  /// For a point the tool's radius is 0.
  explicit FacetBall(double toolRadius_m) noexcept : toolRadius_(toolRadius_m) {}

  /// Empties it for the facets that a tool within `reach` of `centre` can meet.
  void begin(const Vec3& centre, double reach) noexcept;
  /// Room for one more, to be filled; add() takes it in. Null when full: the ball is then not complete.
  Facet* room() noexcept;
  /// `asFarAsItBends`: the facet counts whatever its distance.
  void add(bool asFarAsItBends) noexcept;
  /// After the last: ready to be asked.
  void finish() noexcept;
  /// Nothing is gathered.
  void drop() noexcept { complete_ = false; }

  /// Whether every facet is here that a tool within `radius` of p can meet.
  bool covers(const Vec3& p, double radius) const noexcept {
    return complete_ && (p - centre_).norm() + radius <= reach_;
  }
  bool complete() const noexcept { return complete_; }
  const Vec3& centre() const noexcept { return centre_; }
  double reach() const noexcept { return reach_; }

  const Facet* begin() const noexcept { return facets_.data(); }
  const Facet* end() const noexcept { return facets_.data() + count_; }
  int size() const noexcept { return count_; }
  /// For a ball tool: those from here on are at least farDistance() from the centre, two skins aside.
  const Facet* far() const noexcept { return facets_.data() + near_; }
  double farDistance() const noexcept { return farDistance_; }

  /// For a point: all facets whose faces the way p + t d, t in [0, limit], or a part of
  /// it from p on, may come to; `found` has room for kMost. Returns how many.
  int crossing(const Vec3& p, const Vec3& d, double limit, const Facet** found) const noexcept;

  /// Moves the centre to p, which is inside, so that distances are those from there; the ball shrinks.
  void recentre(const Vec3& p) noexcept;

  static constexpr int kMost = 512;

 private:
  // What a ball may touch soon, in radii from its surface.
  static constexpr double kNear = 0.1;

  void sortOut() noexcept;
  double nearLimit() const noexcept { return (1 + kNear) * toolRadius_; }

  // The plane of a face, normal . x = offset.
  struct Side {
    Vec3 normal;
    double offset;
  };

  double toolRadius_;
  Vec3 centre_ = Vec3::Zero();
  double reach_ = 0;
  bool complete_ = false;
  int count_ = 0;
  int near_ = 0;
  double farDistance_ = 0;
  double thickest_ = 0;  // of the skins
  std::array<Side, kMost> sides_;
  std::array<Facet, kMost> facets_;
};

}  // namespace hapticd::realtime
