#include "realtime/render/facet_ball.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hapticd::realtime {
namespace {

// In skins: at half a skin over a face a way is free of it; the rest is for rounding.
constexpr double kClear = 0.625;

}  // namespace

void FacetBall::begin(const Vec3& centre, double reach) noexcept {
  centre_ = place_ = centre;
  reach_ = reach;
  complete_ = true;
  count_ = 0;
  thickest_ = 0;
  gone_ = 0;
}

void FacetBall::add(const Facet& facet, bool asFarAsItBends) noexcept {
  const double limit = reach_ + 4 * facet.skin;
  if (std::abs(facet.normal.dot(centre_ - facet.a)) > limit && !asFarAsItBends) return;
  if (count_ == kMost) return drop();
  const auto i = static_cast<std::size_t>(count_++);
  facets_[i] = facet;
  sides_[i] = {facet.normal, facet.normal.dot(facet.a)};
  thickest_ = std::max(thickest_, facet.skin);
}

void FacetBall::add(const Name& name, double distance, double skin, bool asFarAsItBends) noexcept {
  if (distance > reach_ + toolRadius_ + 4 * skin && !asFarAsItBends) return;
  if (count_ == kMostNames) return drop();
  const auto i = static_cast<std::size_t>(count_++);
  names_[i] = name;
  distances_[i] = distance;
  sides_[i] = {Vec3::Zero(), 0};
  thickest_ = std::max(thickest_, skin);
}

int FacetBall::crossing(const Vec3& p, const Vec3& d, double limit, const Facet** found) const noexcept {
  const Vec3 way = limit * d;
  const double height = kClear * thickest_;
  int n = 0;
  for (int i = 0; i < count_; ++i) {
    const Side& side = sides_[static_cast<std::size_t>(i)];
    const double start = side.normal.dot(p) - side.offset;
    const double end = start + side.normal.dot(way);
    found[n] = &facets_[static_cast<std::size_t>(i)];
    n += std::min(start, end) < height && std::max(start, end) > -height ? 1 : 0;
  }
  return n;
}

void FacetBall::moveTo(const Vec3& p) noexcept {
  gone_ += (p - place_).norm();
  place_ = p;
}

int FacetBall::nextWithin(double distance, int i) const noexcept {
  const double limit = distance + gone_;
  while (i < count_ && distances_[static_cast<std::size_t>(i)] > limit) ++i;
  return i;
}

// The distance from a face is convex: nowhere less than its tangent.
double FacetBall::nearest(int k, const Vec3& d) noexcept {
  const auto i = static_cast<std::size_t>(k);
  const double here = sides_[i].normal.dot(place_) - sides_[i].offset;
  distances_[i] = std::max(distances_[i], here + gone_);
  return here + std::min(0.0, sides_[i].normal.dot(d));
}

double FacetBall::measured(int k, const Vec3& foot, const Vec3& d) noexcept {
  const auto i = static_cast<std::size_t>(k);
  const Vec3 away = place_ - foot;
  const double distance = away.norm();
  distances_[i] = distance + gone_;
  const Vec3 normal = distance > 0 ? Vec3(away / distance) : Vec3(Vec3::Zero());
  sides_[i] = {normal, normal.dot(place_) - distance};
  return distance + std::min(0.0, normal.dot(d));
}

void FacetBall::leaveOut(int i) noexcept {
  distances_[static_cast<std::size_t>(i)] = std::numeric_limits<double>::infinity();
}

}  // namespace hapticd::realtime
