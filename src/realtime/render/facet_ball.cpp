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
  centre_ = centre;
  reach_ = reach;
  complete_ = true;
  count_ = 0;
  thickest_ = 0;
}

Facet* FacetBall::room() noexcept {
  if (count_ < kMost) return &facets_[static_cast<std::size_t>(count_)];
  complete_ = false;
  return nullptr;
}

void FacetBall::add(bool asFarAsItBends) noexcept {
  Facet& facet = facets_[static_cast<std::size_t>(count_)];
  const double limit = reach_ + toolRadius_ + 4 * facet.skin;
  if (std::abs(facet.normal.dot(centre_ - facet.a)) > limit && !asFarAsItBends) return;
  if (toolRadius_ > 0) facet.distance = (centre_ - nearestPointOf(facet, centre_)).norm();
  if (facet.distance > limit && !asFarAsItBends) return;
  sides_[static_cast<std::size_t>(count_++)] = {facet.normal, facet.normal.dot(facet.a)};
  thickest_ = std::max(thickest_, facet.skin);
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

void FacetBall::finish() noexcept {
  near_ = count_;
  farDistance_ = std::numeric_limits<double>::infinity();
  if (toolRadius_ > 0) sortOut();
}

void FacetBall::recentre(const Vec3& p) noexcept {
  const double moved = (p - centre_).norm();
  centre_ = p;
  reach_ -= moved;
  for (int i = 0; i < count_; ++i) {
    Facet& facet = facets_[static_cast<std::size_t>(i)];
    facet.distance -= moved;
    if (facet.distance <= nearLimit()) facet.distance = (p - nearestPointOf(facet, p)).norm();
  }
  sortOut();
}

// The nearest goes first: a ball stops early there, and then nothing farther needs a closer look.
void FacetBall::sortOut() noexcept {
  Facet* const first = facets_.data();
  Facet* const last = first + count_;
  Facet* const middle =
      std::partition(first, last, [this](const Facet& f) { return f.distance <= nearLimit(); });
  near_ = static_cast<int>(middle - first);
  farDistance_ = std::numeric_limits<double>::infinity();
  for (const Facet* f = middle; f != last; ++f)
    farDistance_ = std::min(farDistance_, f->distance - 2 * f->skin);
  Facet* const nearest =
      std::min_element(first, middle, [](const Facet& a, const Facet& b) { return a.distance < b.distance; });
  if (nearest != middle) std::swap(*first, *nearest);
}

}  // namespace hapticd::realtime
