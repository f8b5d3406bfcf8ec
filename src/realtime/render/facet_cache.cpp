#include "realtime/render/facet_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hapticd::realtime {
namespace {

constexpr double kClear = 2;  // in skins: beyond the radius, the ball is free of a face

}  // namespace

void FacetCache::restart(const Vec3& centre, double reach) noexcept {
  centre_ = toolPosition_ = centre;
  reach_ = reach;
  complete_ = true;
  count_ = 0;
  maxSkin_ = 0;
  maxRadius_ = 0;
  travel_ = 0;
}

void FacetCache::add(const Facet& facet, bool deforming) noexcept {
  const double limit = reach_ + facet.radius + 4 * facet.skin;
  // Of thin triangles, many have their planes near the tool and not themselves.
  const auto isBeyond = [&] {
    return std::abs(facet.normal.dot(centre_ - facet.a)) > limit ||
           (centre_ - nearestPointOf(facet, centre_)).squaredNorm() > limit * limit;
  };
  if (!deforming && isBeyond()) return;
  if (count_ == kMaxFacets) return invalidate();
  const auto i = static_cast<std::size_t>(count_++);
  facets_[i] = facet;
  const Vec3 middle = 0.5 * (facet.a + facet.b);  // of the longest edge
  distances_[i] = 0;
  measured_[i] = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < 3; ++k) {
    filter_.normal[k][i] = facet.normal[static_cast<int>(k)];
    filter_.centre[k][i] = middle[static_cast<int>(k)];
  }
  filter_.offset[i] = facet.normal.dot(facet.a);
  filter_.radius[i] = facet.extent;
  maxSkin_ = std::max(maxSkin_, facet.skin);
  maxRadius_ = std::max(maxRadius_, facet.radius);
}

void FacetCache::add(const TriangleId& id, double distance, double skin, bool deforming) noexcept {
  if (distance > reach_ + toolRadius_ + 4 * skin && !deforming) return;
  if (count_ == kMaxTriangles) return invalidate();
  const auto i = static_cast<std::size_t>(count_++);
  triangles_[i] = id;
  distances_[i] = distance;
  supportPlanes_[i] = {Vec3::Zero(), 0};
  maxSkin_ = std::max(maxSkin_, skin);
}

int FacetCache::facetsNearPath(const Vec3& p, const Vec3& d, std::uint16_t* found) const noexcept {
  const double height = maxRadius_ + kClear * maxSkin_;
  const Vec3 half = 0.5 * d;
  const Vec3 middle = p + half;
  const double reach = half.norm() + height;
  const auto& [normal, offset, centre, radius] = filter_;
  // By how much the path misses the plane of a face (metres) and the ball around it (square metres). Without
  // branches, so that the compiler computes several at once.
  std::array<double, kMaxFacets> missesPlane;
  std::array<double, kMaxFacets> missesBall;
  const auto count = static_cast<std::size_t>(count_);
  for (std::size_t i = 0; i < count; ++i) {
    const double above = normal[0][i] * middle.x() + normal[1][i] * middle.y() + normal[2][i] * middle.z();
    const double along = normal[0][i] * half.x() + normal[1][i] * half.y() + normal[2][i] * half.z();
    missesPlane[i] = std::abs(above - offset[i]) - std::abs(along) - height;
    const double x = centre[0][i] - middle.x();
    const double y = centre[1][i] - middle.y();
    const double z = centre[2][i] - middle.z();
    const double farthest = radius[i] + reach;
    missesBall[i] = x * x + y * y + z * z - farthest * farthest;
  }
  int n = 0;
  for (std::size_t i = 0; i < count; ++i) {
    found[n] = static_cast<std::uint16_t>(i);
    n += missesPlane[i] < 0 && missesBall[i] <= 0 ? 1 : 0;
  }
  return n;
}

bool FacetCache::isWithin(double distance, int k) noexcept {
  const auto i = static_cast<std::size_t>(k);
  if (distances_[i] > distance + travel_) return false;
  if (distances_[i] - 2 * measured_[i] <= distance - travel_) return true;
  const double here = (toolPosition_ - nearestPointOf(facets_[i], toolPosition_)).norm();
  distances_[i] = here + travel_;
  measured_[i] = travel_;
  return here <= distance;
}

void FacetCache::moveTo(const Vec3& p) noexcept {
  if (p == toolPosition_) return;
  travel_ += (p - toolPosition_).norm();
  toolPosition_ = p;
}

int FacetCache::nextWithin(double distance, int i) const noexcept {
  const double limit = distance + travel_;
  while (i < count_ && distances_[static_cast<std::size_t>(i)] > limit) ++i;
  return i;
}

// The distance from a face is convex: its tangent is a lower bound.
double FacetCache::lowerBound(int k, const Vec3& d) noexcept {
  const auto i = static_cast<std::size_t>(k);
  const double here = supportPlanes_[i].normal.dot(toolPosition_) - supportPlanes_[i].offset;
  distances_[i] = std::max(distances_[i], here + travel_);
  return here + std::min(0.0, supportPlanes_[i].normal.dot(d));
}

double FacetCache::refine(int k, const Vec3& foot, const Vec3& d) noexcept {
  const auto i = static_cast<std::size_t>(k);
  const Vec3 away = toolPosition_ - foot;
  const double distance = away.norm();
  distances_[i] = distance + travel_;
  const Vec3 normal = distance > 0 ? Vec3(away / distance) : Vec3(Vec3::Zero());
  supportPlanes_[i] = {normal, normal.dot(toolPosition_) - distance};
  return distance + std::min(0.0, normal.dot(d));
}

void FacetCache::exclude(int i) noexcept {
  distances_[static_cast<std::size_t>(i)] = std::numeric_limits<double>::infinity();
}

}  // namespace hapticd::realtime
