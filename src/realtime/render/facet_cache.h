// The facets that a tool inside a ball around the proxy, or near its way, can touch, in fixed storage.
//
// Point tool: keeps the facets themselves. A path first discards the faces whose plane or whose ball it does
// not come near, which leaves few. Ball tool: many triangles lie within its radius and few touch it. It keeps
// their ids, with a ball around each. Those whose ball a path comes near get a disc, and a supporting plane;
// exact facets are made only for what neither rules out.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "realtime/render/facet.h"

namespace hapticd::realtime {

using geometry::Vec3f;

/// Parameter, at most 1, at which p + t d leaves a ball. p is inside.
double exitOfBall(const Vec3& p, const Vec3& d, const Vec3& centre, double radius) noexcept;

/// Servo thread: noexcept, no allocation.
class FacetCache {
 public:
  /// For a point tool.
  static constexpr int kMaxFacets = 512;
  /// For a ball tool: a bowl of its radius is within reach as a whole.
  static constexpr int kMaxTriangles = 8192;

  /// A triangle of a near object, both by index.
  struct TriangleId {
    std::uint32_t triangle = 0;
    std::int16_t object = 0;
    std::int16_t level = 0;  ///< of its fan; 0: the triangle itself
  };

  explicit FacetCache(double toolRadius_m) noexcept : toolRadius_(toolRadius_m) {}

  /// Clears the cache; from now on it collects the facets that a tool within `reach` of the segment from
  /// `from` to from + way can touch.
  void restart(const Vec3& from, const Vec3& way, double reach) noexcept;
  /// Point tool: adds a facet. A `deforming` one is kept at any distance.
  void add(const Facet& facet, bool deforming) noexcept;
  /// Ball tool: adds a triangle by a ball around it.
  void add(const TriangleId& id, const Vec3& centre, double radius, double skin) noexcept;
  /// The same by a disc whose centre may be off by `rounding`.
  void add(const TriangleId& id, const Disc& disc, double skin, double rounding) noexcept;
  /// Marks the cache as incomplete.
  void invalidate() noexcept { complete_ = false; }
  /// The same, and drops what was learnt of earlier gathers.
  void forget() noexcept {
    invalidate();
    nearShare_ = kMostNearShare;
    nearUses_ = 0;
  }

  /// Whether the cache holds every facet that a tool within `radius` of p can touch.
  bool covers(const Vec3& p, double radius) const noexcept {
    return complete_ && (p - nearestOfWay(p)).norm() + radius <= reach_;
  }
  /// The same for all places between p and q.
  bool covers(const Vec3& p, const Vec3& q) const noexcept { return covers(p, 0) && covers(q, 0); }
  /// Whether p is not near the rim.
  bool isInside(const Vec3& p) const noexcept {
    return complete_ && (p - nearestOfWay(p)).squaredNorm() < 0.64 * reach_ * reach_;
  }
  /// Parameter, at most 1, up to which p + t d is covered. p is.
  double exitOf(const Vec3& p, const Vec3& d) const noexcept;
  /// Of the segment that it was restarted around.
  Vec3 nearestOfWay(const Vec3& p) const noexcept {
    const double length2 = way_.squaredNorm();
    if (length2 == 0) return from_;
    return from_ + std::clamp((p - from_).dot(way_) / length2, 0.0, 1.0) * way_;
  }
  bool complete() const noexcept { return complete_; }
  double reach() const noexcept { return reach_; }
  /// Of a ball around all that is covered.
  double extent() const noexcept { return reach_ + 0.5 * way_.norm(); }
  int size() const noexcept { return count_; }
  double maxSkin() const noexcept { return maxSkin_; }

  /// Point tool: the facets.
  const Facet* begin() const noexcept { return facets_.data(); }
  const Facet* end() const noexcept { return facets_.data() + count_; }

  /// The present position of the tool.
  void moveTo(const Vec3& p) noexcept;
  const TriangleId& triangle(int i) const noexcept { return triangles_[static_cast<std::size_t>(i)]; }
  /// Ball tool: all triangles that may be within `distance` of the segment from the present position by d.
  /// Valid until the next call. discOf(id) is the disc around a triangle.
  template <class DiscOf>
  std::span<const std::uint16_t> trianglesNear(const Vec3& d, double distance, const DiscOf& discOf) noexcept;
  /// How many tests of one disc against a path the searches since the last call took the time of.
  int takeScans() noexcept { return std::exchange(scans_, 0); }
  /// Lower bound of the distance while the tool moves by d; refine() makes it exact for the present position.
  double lowerBound(int i, const Vec3& d) const noexcept;
  /// Replaces the bound by the exact distance: `foot` is the nearest point. Returns the new lowerBound().
  double refine(int i, const Vec3& foot, const Vec3& d) noexcept;
  /// Marks entry i as unreachable.
  void exclude(int i) noexcept;
  /// Point tool: whether facet i may be within `distance` of the present position. Keeps how far it is.
  bool isWithin(double distance, int i) noexcept;
  /// Point tool: all facets that the path from p to p + d may reach. `found` has room for kMaxFacets. Returns
  /// how many.
  int facetsNearPath(const Vec3& p, const Vec3& d, std::uint16_t* found) const noexcept;

 private:
  // A path with what is within some distance of it, relative to centre_.
  using Reach = geometry::NearPath;
  // Through the point of a disc nearest to some place, and how far that is at least.
  struct NearPlane {
    Vec3f normal;
    float distance;
  };
  Reach reachOf(const Vec3& p, const Vec3& d, double distance) const noexcept;
  void missBalls(const Reach& reach) noexcept;
  void missDiscs(const Reach& reach) noexcept;
  bool reaches(const Reach& reach, std::size_t i) const noexcept;
  void set(std::size_t i, const Disc& disc) noexcept;
  template <class DiscOf>
  int findNear(const Reach& reach, const DiscOf& discOf, std::uint16_t* found) noexcept;
  NearPlane planeBefore(std::size_t i, const Vec3f& p) const noexcept;
  template <class DiscOf>
  void knowNear(double distance, const DiscOf& discOf) noexcept;
  void makeNearPlanes() noexcept;
  std::span<const std::uint16_t> nearPlanesMet(const Vec3& d, double distance) noexcept;

  // Ball tool. normal . x = offset: a plane with the face on its back.
  struct SupportPlane {
    Vec3 normal;
    double offset;
  };

  // Of facets for a point tool, one array for each number, so that the compiler computes several at once.
  struct Filter {
    template <class T>
    using Column = std::array<T, kMaxFacets>;
    std::array<Column<double>, 3> normal;  // of the plane of the face
    Column<double> offset;                 // normal . x = offset
    std::array<Column<double>, 3> centre;  // of a ball around it
    Column<double> radius;
  };

  double toolRadius_;
  Vec3 from_ = Vec3::Zero();
  Vec3 way_ = Vec3::Zero();
  Vec3 centre_ = Vec3::Zero();  // the middle of the way
  double reach_ = 0;
  bool complete_ = false;
  int count_ = 0;
  double maxSkin_ = 0;    // over all entries
  double maxRadius_ = 0;  // of the ball that touches them
  double rounding_ = 0;   // of the discs
  bool knowsAll_ = true;  // the normals of all discs
  std::array<SupportPlane, kMaxTriangles> supportPlanes_;
  std::array<Facet, kMaxFacets> facets_;
  Filter filter_;
  std::array<double, kMaxFacets> measured_;  // the travel when the distance was
  Vec3 toolPosition_ = Vec3::Zero();
  double travel_ = 0;                         // of the tool since restart()
  std::array<double, kMaxFacets> distances_;  // lower bounds, plus the travel at that time
  std::array<TriangleId, kMaxTriangles> triangles_;
  // The balls around them, relative to centre_, in single precision, for it is a first filter. One array for
  // each number, so that the compiler computes several at once. Once the normal is known, those of the disc;
  // before, its x is not a number.
  using TriangleColumn = std::array<float, kMaxTriangles>;
  std::array<TriangleColumn, 3> discCentres_;
  TriangleColumn discRadii_;
  std::array<TriangleColumn, 3> discNormals_;
  TriangleColumn misses_;
  std::array<std::uint16_t, kMaxTriangles + 1> found_;  // one more: see findNear()
  // Those around a place where the tool is or was, with their planes from there: a cast that stays near looks
  // at no others. One array for each number.
  std::array<std::uint16_t, kMaxTriangles + 1> near_;
  std::array<TriangleColumn, 3> nearNormals_;
  TriangleColumn nearBounds_;
  int nearCount_ = 0;
  Vec3 nearCentre_ = Vec3::Zero();
  double nearDistance_ = -1;  // up to which all are there
  int nearUses_ = 0;          // since then
  int scans_ = 0;
  // Of the tool radius: how much farther than asked they are sought. Little where the tool soon leaves them.
  static constexpr double kLeastNearShare = 0.003;
  static constexpr double kMostNearShare = 0.05;
  double nearShare_ = kMostNearShare;
};

template <class DiscOf>
int FacetCache::findNear(const Reach& reach, const DiscOf& discOf, std::uint16_t* found) noexcept {
  int n = 0;
  scans_ += count_;
  if (knowsAll_) {
    missDiscs(reach);
    for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
      found[n] = static_cast<std::uint16_t>(i);
      n += misses_[i] > 0 ? 0 : 1;
    }
    return n;
  }
  missBalls(reach);
  for (std::size_t i = 0; i < static_cast<std::size_t>(count_); ++i) {
    if (misses_[i] > 0) continue;
    if (std::isnan(discNormals_[0][i])) set(i, discOf(triangles_[i]));
    if (reaches(reach, i)) found[n++] = static_cast<std::uint16_t>(i);
  }
  return n;
}

// Those within `distance` and a little more. Not far from where the planes were made they tell nearly the
// distance.
template <class DiscOf>
void FacetCache::knowNear(double distance, const DiscOf& discOf) noexcept {
  constexpr int kFewUses = 4;
  const double from_m = (toolPosition_ - nearCentre_).norm();
  const bool known = from_m + distance <= nearDistance_;
  if (known && from_m <= 0.5 * nearShare_ * toolRadius_) return;
  nearCentre_ = toolPosition_;
  if (known) {
    nearDistance_ -= from_m;
  } else {
    if (nearUses_ < kFewUses) nearShare_ = std::max(0.5 * nearShare_, kLeastNearShare);
    if (nearUses_ > 2 * kFewUses) nearShare_ = std::min(2 * nearShare_, kMostNearShare);
    nearUses_ = 0;
    nearDistance_ = distance + nearShare_ * toolRadius_;
    nearCount_ = findNear(reachOf(nearCentre_, Vec3::Zero(), nearDistance_), discOf, near_.data());
    // In a hollow of about the tool's radius: farther away there are no others.
    if (nearCount_ == count_) nearDistance_ = std::numeric_limits<double>::infinity();
  }
  makeNearPlanes();
}

template <class DiscOf>
std::span<const std::uint16_t> FacetCache::trianglesNear(const Vec3& d, double distance,
                                                         const DiscOf& discOf) noexcept {
  const double length = d.norm();
  if (length <= kMostNearShare * toolRadius_) knowNear(distance + length, discOf);
  if ((toolPosition_ - nearCentre_).norm() + length + distance <= nearDistance_) {
    ++nearUses_;
    return nearPlanesMet(d, distance);
  }
  const int n = findNear(reachOf(toolPosition_, d, distance), discOf, found_.data());
  return {found_.data(), static_cast<std::size_t>(n)};
}

}  // namespace hapticd::realtime
