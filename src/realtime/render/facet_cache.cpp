#include "realtime/render/facet_cache.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hapticd::realtime {
namespace {

// In skins: a path at half a skin above a face is free of it; the rest covers rounding.
constexpr double kClear = 0.625;

}  // namespace

void FacetCache::restart(const Vec3& centre, double reach) noexcept {
  centre_ = toolPosition_ = centre;
  reach_ = reach;
  complete_ = true;
  count_ = 0;
  maxSkin_ = 0;
  travel_ = 0;
}

void FacetCache::add(const Facet& facet, bool deforming) noexcept {
  const double limit = reach_ + 4 * facet.skin;
  if (std::abs(facet.normal.dot(centre_ - facet.a)) > limit && !deforming) return;
  if (count_ == kMaxFacets) return invalidate();
  const auto i = static_cast<std::size_t>(count_++);
  facets_[i] = facet;
  supportPlanes_[i] = {facet.normal, facet.normal.dot(facet.a)};
  maxSkin_ = std::max(maxSkin_, facet.skin);
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

int FacetCache::facetsNearPath(const Vec3& p, const Vec3& d, double limit,
                               const Facet** found) const noexcept {
  const Vec3 displacement = limit * d;
  const double height = kClear * maxSkin_;
  int n = 0;
  for (int i = 0; i < count_; ++i) {
    const SupportPlane& plane = supportPlanes_[static_cast<std::size_t>(i)];
    const double start = plane.normal.dot(p) - plane.offset;
    const double end = start + plane.normal.dot(displacement);
    found[n] = &facets_[static_cast<std::size_t>(i)];
    n += std::min(start, end) < height && std::max(start, end) > -height ? 1 : 0;
  }
  return n;
}

void FacetCache::moveTo(const Vec3& p) noexcept {
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
